"""A located mismatch, as data and as the sentence a person reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from wind_sensors.diagnosis.watch.direct import Oddity
from wind_sensors.diagnosis.watch.evidence import ChannelExcess, Evidence
from wind_sensors.diagnosis.watch.naming import Candidate

SURE = 0.75
"""Weight from which one candidate is called likely."""

EXPLAINS = 0.4
"""Share of the excess that a candidate must remove to be believed."""

SETTLE = "Record the topics with `wind record` and let `wind diagnose` settle it."


@dataclass(frozen=True)
class Located:
    """Where the mismatch is largest.

    Attributes:
        channel: E.g. `cup/rotor_rate`.
        mean, deviation: Measured minus simulated and its standard error [unit].
        excess: Root mean square of measured minus simulated [unit].
        unit: `m/s` or `deg`.
        share: Of the whole excess misfit that lies in this channel.
        speed: Range of the block means of the wind speed [m/s].
        direction_from: Range of the block mean directions the wind comes from [deg].
    """

    channel: str
    mean: float
    deviation: float
    excess: float
    unit: str
    share: float
    speed: tuple[float, float]
    direction_from: tuple[float, float]


@dataclass
class UsualMisfit:
    """Squares of the whitened differences of each channel on healthy blocks, per difference."""

    totals: dict[str, tuple[float, float]] = field(default_factory=dict)

    def learn(self, channels: Mapping[str, ChannelExcess]) -> None:
        """One healthy block."""
        for name, of in channels.items():
            total, blocks = self.totals.get(name, (3.0, 3.0))
            self.totals[name] = (total + of.chi_square / of.count, blocks + 1.0)

    def of(self, name: str) -> float:
        """Expected square of one whitened difference."""
        total, blocks = self.totals.get(name, (1.0, 1.0))
        return total / blocks


def located(
    blocks: Sequence[Evidence], usual: UsualMisfit, named: Sequence[Candidate] = ()
) -> Located:
    """The channel with the largest excess over the blocks, in its unit.

    Args:
        blocks: Since the onset.
        usual: Misfit of healthy blocks.
        named: Candidates; the channels of the best one's instrument go first.
    """
    names = list(dict.fromkeys(name for b in blocks for name in b.channels))
    blamed = [n for n in names if named and n.partition("/")[0] == named[0].instrument]
    excess = {}
    for name in names:
        of = [b.channels[name] for b in blocks if name in b.channels]
        excess[name] = max(sum(c.chi_square - usual.of(name) * c.count for c in of), 0.0)
    channel = max(blamed or names, key=lambda n: excess[n])
    of = [b.channels[channel] for b in blocks if channel in b.channels]
    speed = [b.speed for b in blocks]
    is_vane = channel.endswith("vane_angle")
    scale = float(np.degrees(1.0 / max(float(np.mean(speed)), 0.5))) if is_vane else 1.0
    bearings = [float(np.degrees(np.pi / 2.0 - b.direction)) for b in blocks]
    around = np.degrees(np.unwrap(np.radians(bearings)))
    return Located(
        channel=channel,
        mean=scale * float(np.mean([c.mean for c in of])),
        deviation=scale * float(np.mean([c.deviation for c in of])) / np.sqrt(len(of)),
        excess=scale * float(np.sqrt(np.mean([c.square for c in of]))),
        unit="deg" if is_vane else "m/s",
        share=excess[channel] / max(sum(excess.values()), 1e-9),
        speed=(min(speed), max(speed)),
        direction_from=(float(around.min()) % 360.0, float(around.max()) % 360.0),
    )


@dataclass(frozen=True)
class Finding:
    """A mismatch between a station and its simulation.

    Attributes:
        onset: Estimated beginning [ns].
        detected: When it was first told [ns].
        latest: End of the newest block that shows it [ns].
        located: Where; None for what the readings show by themselves.
        candidates: Best first; weights are a first opinion.
        blocks: That show it.
        text: What was seen, when no statistics were needed.
        ended: When it was over [ns].
    """

    onset: int
    detected: int
    latest: int
    located: Located | None
    candidates: tuple[Candidate, ...]
    blocks: int = 1
    text: str = ""
    ended: int | None = None

    @classmethod
    def of_oddity(cls, oddity: Oddity, onset: int, detected: int, latest: int) -> Finding:
        """A finding that needs no statistics."""
        seconds = (oddity.stop - oddity.start) * 1e-9
        only = Candidate(oddity.effect, oddity.instrument, 1.0, 1.0, 0.0, seconds / 10.0, {}, {})
        return cls(onset, detected, latest, None, (only,), text=oddity.text)

    @property
    def certain(self) -> bool:
        """Seen in the readings themselves."""
        return self.located is None

    @property
    def likely(self) -> bool:
        """One candidate explains it and stands out."""
        believed = [c for c in self.candidates if c.explained >= EXPLAINS]
        return bool(believed) and believed[0].weight >= SURE

    @property
    def channel(self) -> str:
        """Where it is."""
        return self.candidates[0].instrument if self.located is None else self.located.channel

    @property
    def opinion(self) -> str:
        """The candidates in words, with how sure."""
        if self.certain:
            return f"The readings themselves show {self.candidates[0].effect}."
        believed = [c for c in self.candidates if c.explained >= EXPLAINS]
        if not believed:
            return "Cannot tell yet why: no effect of the catalogue explains most of it."
        if self.likely:
            return f"Likely {believed[0]}."
        listed = "; or ".join(str(c) for c in believed)
        return f"Cannot tell yet which: {listed}."

    def message(self) -> str:
        """One line for people."""
        if self.located is None:
            return f"{self.text[:1].upper()}{self.text[1:]}. {self.opinion} {SETTLE}"
        at = self.located
        return (
            f"{at.channel} departs from its simulation: mean {at.mean:+.2f} ± "
            f"{at.deviation:.2f} {at.unit}, rms {at.excess:.2f} {at.unit}. {self.opinion} {SETTLE}"
        )
