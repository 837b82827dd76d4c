"""The catalogue: one object for each piece of physics that a station may lack."""

from __future__ import annotations

from functools import lru_cache
from importlib.metadata import entry_points

from wind_sensors.diagnosis.effects import output, platform, rotor, vane, wind
from wind_sensors.diagnosis.effects.definition import Effect

ENTRY_POINT_GROUP = "wind_sensors.effects"


@lru_cache(maxsize=1)
def catalogue() -> dict[str, Effect]:
    """All effects by name: the built-in ones and those of other installed packages.

    A package adds effects through the entry-point group `wind_sensors.effects`; each entry point
    loads an `Effect` or an iterable of them. A name that is already taken is not replaced.
    """
    effects = {
        effect.name: effect
        for module in (wind, rotor, vane, output, platform)
        for effect in module.EFFECTS
    }
    for point in entry_points(group=ENTRY_POINT_GROUP):
        loaded = point.load()
        for effect in (loaded,) if isinstance(loaded, Effect) else tuple(loaded):
            effects.setdefault(effect.name, effect)
    return effects
