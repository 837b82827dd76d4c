"""How much of a diagnosis is done, phase by phase: shares that never fall."""

from __future__ import annotations

from collections.abc import Callable

Report = Callable[[float], None]
"""Called with the share of something that is done."""

OF_WHAT_IS_LEFT = 0.9
"""Each run through a phase takes this share of what is left of it: most phases are run through
once, but what is found may ask for another run."""


class Phases:
    """Shares of the phases of a diagnosis.

    Args:
        progress: Called with a phase and the share of it that is done; None: nobody asks.
    """

    def __init__(self, progress: Callable[[str, float], None] | None) -> None:
        self._progress = progress
        self._left: dict[str, float] = {}

    def run(self, phase: str) -> Report:
        """The progress function of one more run through a phase.

        Args:
            phase: Its name, for people.
        """
        left = self._left.get(phase, 1.0)
        self._left[phase] = left * (1.0 - OF_WHAT_IS_LEFT)

        def report(share: float) -> None:
            if self._progress is not None:
                self._progress(phase, 1.0 - left * (1.0 - OF_WHAT_IS_LEFT * share))

        return report

    def done(self) -> None:
        """All phases so far are over."""
        for phase in self._left:
            self._left[phase] = 0.0
            if self._progress is not None:
                self._progress(phase, 1.0)
