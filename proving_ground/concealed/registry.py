"""Every cause that can be planted, by name."""

from __future__ import annotations

from proving_ground.concealed import flow, moving, output, rotor, vane
from proving_ground.concealed.kinds import Cause
from proving_ground.concealed.strangers import STRANGERS

CATALOGUED: dict[str, Cause] = {
    **flow.CAUSES,
    **moving.CAUSES,
    **rotor.CAUSES,
    **vane.CAUSES,
    **output.CAUSES,
}


def cause(name: str) -> Cause:
    """The cause of a name, catalogued or not.

    Raises ValueError with the known names if there is none.
    """
    found = CATALOGUED.get(name) or STRANGERS.get(name)
    if found is None:
        known = ", ".join([*CATALOGUED, *STRANGERS])
        raise ValueError(f"no cause is called {name!r}; known are {known}")
    return found
