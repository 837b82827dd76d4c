"""What is normal in means: healthy recordings, and how much of a record they speak for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.averages import DAY, Averages, averages_of, joined
from wind_sensors.diagnosis.means.pair import (
    FEWEST_IN_CELL,
    SECTORS,
    SPEED_CLASSES,
    cells,
    direction_of,
    pairs_of,
)
from wind_sensors.diagnosis.means.silences import Silence, silences, without_silences
from wind_sensors.station.signals import Recording, Series

IndexArray = npt.NDArray[np.intp]

WORKING = 0.5
"""Share of its means that a vane must deliver to be compared with healthy ones."""

MUCH = 0.05
"""Share of a record outside the healthy directions and speeds that is worth a word."""


@dataclass(frozen=True)
class Healthy:
    """What healthy recordings of means tell.

    Attributes:
        names: Of the recordings.
        averages: Their means, without silences.
        pairs: Rotors that are each other's reference.
    """

    names: tuple[str, ...]
    averages: Averages
    pairs: tuple[tuple[str, str], ...]

    def of_same_vanes(self, averages: Averages) -> tuple[Healthy, Averages]:
        """Both with the vanes that work in both: a direction must mean the same in each."""

        def working(means: Averages) -> set[str]:
            return {n for n, v in means.heading.items() if np.mean(np.isfinite(v)) > WORKING}

        common = working(self.averages) & working(averages)
        if not common:
            return self, averages
        one, two = (
            replace(a, heading={n: v for n, v in a.heading.items() if n in common})
            for a in (self.averages, averages)
        )
        return replace(self, averages=one), two

    def reservations(self, averages: Averages) -> list[str]:
        """What the healthy recordings do not tell about a record, for people."""
        found = []
        if len(self.names) == 1:
            days = float(self.averages.elapsed[-1] - self.averages.elapsed[0]) / DAY
            found.append(
                f"What is normal was learnt from one recording of {days:.0f} days. How much "
                "instruments differ from season to season it cannot tell: its own thirds stand in."
            )
        missing = self._uncovered(averages)
        if missing > MUCH:
            found.append(
                f"{100.0 * missing:.0f} % of the means come from directions and speeds of which "
                "the healthy ones have too few: there their average over all speeds, or over all "
                "directions, is taken for normal."
            )
        return found

    def _uncovered(self, averages: Averages) -> float:
        known = np.zeros((SECTORS, len(SPEED_CLASSES) - 1))
        np.add.at(known, _kinds(self.averages), 1.0)
        return float(np.mean(known[_kinds(averages)] < FEWEST_IN_CELL))


def _kinds(averages: Averages) -> tuple[IndexArray, IndexArray]:
    """Direction sector and speed class of the means that have both."""
    fastest = np.fmax.reduce(list(averages.speed.values()))
    heading = direction_of(averages)
    good = np.isfinite(fastest) & np.isfinite(heading)
    return cells(fastest[good], heading[good])


def cleaned(
    recording: Recording, deviations: Mapping[str, Series] | None
) -> tuple[Averages, list[Silence]]:
    """Means without the intervals in which a sensor stood still, and those intervals.

    Raises:
        UserError: There are too few means.
    """
    raw = averages_of(recording, deviations)
    silent = silences(raw)
    return without_silences(raw, silent), silent


def learn_means(
    recordings: Sequence[tuple[Recording, Mapping[str, Series]]],
) -> Healthy | None:
    """What is normal in healthy recordings of means; None: there are none.

    Raises:
        UserError: A recording has too few means.
    """
    if not recordings:
        return None
    clean = joined([cleaned(recording, deviations)[0] for recording, deviations in recordings])
    return Healthy(tuple(r.name for r, _ in recordings), clean, tuple(pairs_of(clean)))
