"""What one block says about every signature of the catalogue."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison, Trust
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.diagnosis.explaining.signatures import Template
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.commissioning import STANDING_TOLERANCES

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.intp]

_LEAST_POWER = 0.05


def unit(template: Template) -> float:
    """Size of a template in smallest sizes worth reporting."""
    return max(template.effect.relative_size(template.values), 0.5)


@dataclass
class Registry:
    """All templates met so far; arrays over templates use their places here.

    Attributes:
        templates: By place.
        places: By key.
    """

    templates: list[Template] = field(default_factory=list)
    places: dict[str, int] = field(default_factory=dict)

    def places_of(self, templates: list[Template]) -> IndexArray:
        """Places of templates, new ones added at the end."""
        for template in templates:
            if template.key not in self.places:
                self.places[template.key] = len(self.templates)
                self.templates.append(template)
        return np.array([self.places[t.key] for t in templates], dtype=np.intp)


@dataclass(frozen=True)
class ChannelExcess:
    """One channel of one block.

    Attributes:
        chi_square: Squares of its whitened differences, spectra and intervals included.
        count: Number of them.
        mean: Mean residual [m/s; lateral m/s for a vane].
        deviation: Its noise.
        square: Mean squared residual [m^2/s^2].
    """

    chi_square: float
    count: int
    mean: float
    deviation: float
    square: float


@dataclass(frozen=True)
class Evidence:
    """One block.

    Attributes:
        number: Of the block.
        start, stop: [ns]
        places: Of its templates in the registry.
        gram: Products of the whitened signatures.
        seen: Products of the signatures with the residual beyond the standing differences.
        chi_square: Squares of that residual, each limited.
        count: Number of whitened differences.
        channels: By channel name.
        speed: Mean wind speed [m/s].
        direction: Mean direction the wind comes from [rad, ENU].
    """

    number: int
    start: int
    stop: int
    places: IndexArray
    gram: FloatArray
    seen: FloatArray
    chi_square: float
    count: int
    channels: Mapping[str, ChannelExcess]
    speed: float
    direction: float


def channel_excess(
    comparison: Comparison, trust: Mapping[str, Trust], residual: FloatArray
) -> dict[str, ChannelExcess]:
    """How each channel departs, from the whitened residual of a block."""
    out = {}
    at = 0
    later = sum(comparison.measured.cosine[c.name].size for c in comparison.channels)
    mask = np.ones(comparison.grid.n) if comparison.mask is None else comparison.mask
    share = float(np.mean(mask))
    for channel in comparison.channels:
        deviation = trust[channel.name].deviation
        part = residual[at : at + deviation.size]
        extra_size = trust[channel.name].statistics_deviation.size
        extra = residual[later : later + extra_size]
        at += deviation.size
        later += extra_size
        # Where a series is not compared its noise is infinite and its residual says nothing.
        known = np.where(np.isfinite(deviation), deviation, 0.0)
        mean_scale = np.sqrt(comparison.grid.n) * share
        both = np.concatenate((part, extra))
        out[channel.name] = ChannelExcess(
            chi_square=float(np.sum(np.minimum(both * both, 25.0))),
            count=both.size,
            mean=float(known[0] * part[0] / mean_scale),
            deviation=float(known[0] / mean_scale),
            square=float(np.sum((part * known) ** 2) / comparison.grid.n / share),
        )
    return out


def departures(
    registry: Registry, evidence: Evidence, seen: FloatArray, odd: Collection[str]
) -> tuple[FloatArray, FloatArray]:
    """Amplitudes of one block in smallest sizes and one over their noise variance, by place.

    Args:
        registry: Templates.
        evidence: The block.
        seen: Products of its signatures with the residual to test.
        odd: Instruments whose readings are not to be trusted in this block.
    """
    size = len(registry.templates)
    departure, precision = np.zeros(size), np.zeros(size)
    power = np.diag(evidence.gram)
    for place, p, product in zip(evidence.places, power, seen, strict=True):
        template = registry.templates[place]
        affected = odd and template.instrument in (*odd, PLATFORM, STATION)
        if p < _LEAST_POWER or affected:
            continue
        scale = unit(template)
        departure[place] = product / p * scale
        precision[place] = p / scale**2
    return departure, precision


def standing_amplitudes(baseline: Baseline, registry: Registry) -> FloatArray:
    """Amplitudes that healthy recordings of the station share, by place."""
    return np.array([baseline.means.get(t.key, 0.0) for t in registry.templates])


@dataclass
class Learning:
    """Standing gains, offsets and mounting angles of this session, from its first blocks.

    What a calibration laboratory would correct, and no more: many signatures that are nearly
    parallel would fit the first blocks well and the wind of the next hour badly.

    Attributes:
        normal: Sum of the Gram matrices, by place.
        right: Sum of the products with the residuals, by place.
    """

    normal: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    right: FloatArray = field(default_factory=lambda: np.zeros(0))

    def add(self, places: IndexArray, gram: FloatArray, seen: FloatArray, size: int) -> None:
        """One healthy block, before any standing difference is taken off."""
        if size > self.right.size:
            grown = np.zeros((size, size))
            old = self.right.size
            grown[:old, :old] = self.normal
            self.normal = grown
            self.right = np.append(self.right, np.zeros(size - old))
        self.normal[np.ix_(places, places)] += gram
        self.right[places] += seen

    def amplitudes(self, registry: Registry) -> FloatArray:
        """Standing amplitudes; each is expected within one smallest size."""
        out = np.zeros(len(registry.templates))
        known = {name for name, _, _ in STANDING_TOLERANCES}
        used = [
            k for k in range(self.right.size) if registry.templates[k].effect.name in known
        ]
        if used:
            prior = np.diag([unit(registry.templates[k]) ** 2 for k in used])
            normal = self.normal[np.ix_(used, used)] + prior
            out[used] = np.linalg.solve(normal, self.right[used])
        return out


@dataclass(frozen=True)
class Snapshot:
    """A recent block kept whole, so that candidates can be simulated in its wind.

    Attributes:
        number: Of the block.
        comparison: The block.
        trust: Its noise.
        standing: Whitened standing difference.
        healthy: The healthy station in its wind.
    """

    number: int
    comparison: Comparison
    trust: Mapping[str, Trust]
    standing: FloatArray
    healthy: Simulated

    def residual(self, simulated: Simulated) -> FloatArray:
        """Whitened differences beyond the standing ones."""
        return self.comparison.vector(simulated, self.trust) - self.standing
