"""Screening: linear scores of the whole catalogue, over the record and over parts of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis import spectra
from wind_sensors.diagnosis.comparison import Comparison, Simulated, Trust
from wind_sensors.diagnosis.signatures import SignatureBank, Template
from wind_sensors.diagnosis.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

WINDOW_STEP = 30.0
"""Onsets and endings are screened every so many seconds."""

SHORTEST_WINDOW = 60.0
"""What lasts less [s] tells an effect badly from a gust."""

_WEAKEST = 1e-2
_RIDGE = 1e-3


@dataclass(frozen=True)
class Score:
    """Linear score of one effect of one instrument.

    Attributes:
        effect, instrument: Names.
        gain: Drop of the cost that the best combination of its templates promises.
        amplitudes: Best combination, by template number.
        template: The best single template.
        amplitude: Of that template.
        interval: Where it holds [s since the start of the comparison]; None is always.
    """

    effect: str
    instrument: str
    gain: float
    amplitudes: Mapping[int, float]
    template: Template
    amplitude: float
    interval: tuple[float, float] | None = None


def _joint(gram: FloatArray, seen: FloatArray) -> tuple[float, FloatArray]:
    """Gain and amplitudes of the least-squares combination of a few signatures."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    normal = gram / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
    scaled = np.linalg.solve(normal, seen / scale)
    return float(scaled @ (seen / scale)), scaled / scale


def group_templates(templates: Sequence[Template]) -> dict[tuple[str, str], list[int]]:
    """Indices of the templates of each effect of each instrument."""
    groups: dict[tuple[str, str], list[int]] = {}
    for k, template in enumerate(templates):
        groups.setdefault((template.effect.name, template.instrument), []).append(k)
    return groups


def screen(
    templates: Sequence[Template], signatures: FloatArray, vector: FloatArray
) -> list[Score]:
    """Scores of all effects, best first.

    Args:
        templates: Of the catalogue.
        signatures: White signatures, one a row.
        vector: White vector of what is to be explained.
    """
    return scores_of(templates, signatures @ signatures.T, signatures @ vector)


def scores_of(templates: Sequence[Template], gram: FloatArray, seen: FloatArray) -> list[Score]:
    """Scores of all effects, best first, from inner products.

    Args:
        templates: Of the catalogue.
        gram: Products of the white signatures, shape (k, k).
        seen: Products of the signatures with the white vector, shape (k,).
    """
    power = np.diag(gram)
    out = []
    for (effect, instrument), members in group_templates(templates).items():
        alive = [k for k in members if power[k] > _WEAKEST]
        if not alive:
            continue
        single = max(alive, key=lambda k: seen[k] ** 2 / power[k])
        gain = float(seen[single] ** 2 / power[single])
        amplitudes = {templates[single].number: float(seen[single] / power[single])}
        if len(members) <= 4 and len(alive) > 1:
            gain, solved = _joint(gram[np.ix_(alive, alive)], seen[alive])
            amplitudes = {
                templates[k].number: float(a) for k, a in zip(alive, solved, strict=True)
            }
        out.append(
            Score(
                effect, instrument, gain, amplitudes, templates[single],
                float(seen[single] / power[single]),
            )
        )  # fmt: skip
    return sorted(out, key=lambda s: -s.gain)


def starting_values(score: Score) -> dict[str, float]:
    """Parameters at which a nonlinear fit of a scored effect begins."""
    effect = score.template.effect
    values = {p.name: (0.0 if p.healthy is None else p.healthy) for p in effect.parameters}
    for parameter in effect.parameters:
        if parameter.healthy is None:
            values[parameter.name] = score.template.values[parameter.name]
    joint = len(score.amplitudes) > 1
    for number, amplitude in score.amplitudes.items():
        template = effect.templates[number]
        if not joint and number != score.template.number:
            continue
        for parameter in effect.parameters:
            if parameter.healthy is not None:
                departure = template[parameter.name] - parameter.healthy
                values[parameter.name] += amplitude * departure
    for parameter in effect.parameters:
        values[parameter.name] = float(
            np.clip(values[parameter.name], parameter.low, parameter.high)
        )
    return values


def windowed_signature(
    comparison: Comparison,
    without: Simulated,
    planted: Simulated,
    trust: Mapping[str, Trust],
    inside: npt.NDArray[np.bool_],
) -> FloatArray:
    """Noise-whitened signature of an effect that holds in a part of the record only.

    Spectra and interval statistics take the share of the time.
    """
    share = float(np.mean(inside))
    parts = []
    for channel in comparison.channels:
        name = channel.name
        moved = np.where(inside, planted.series[name] - without.series[name], 0.0)
        moved = comparison.masked(moved)
        coefficients = spectra.to_cosine(moved)[: comparison.coefficients]
        parts.append(trust[name].slope * coefficients / trust[name].deviation)
    for channel in comparison.channels:
        name = channel.name
        t = trust[name]
        moved = planted.statistics[name] - without.statistics[name]
        parts.append(np.nan_to_num(share * moved / t.statistics_deviation))
    return np.concatenate(parts)


def windows(comparison: Comparison) -> list[tuple[float, float]]:
    """Beginnings-to-end, start-to-endings, and middles [s since the first bin]."""
    length = comparison.grid.n * comparison.grid.dt
    cuts = np.arange(SHORTEST_WINDOW, length - SHORTEST_WINDOW + 1.0, WINDOW_STEP)
    out = [(float(c), length) for c in cuts] + [(0.0, float(c)) for c in cuts]
    coarse = cuts[1::4]
    out += [
        (float(a), float(b)) for k, a in enumerate(coarse) for b in coarse[k + 1 :]
    ]
    return out


def screen_windows(
    whitener: Whitener,
    bank: SignatureBank,
    members: Sequence[int],
    vector: FloatArray,
) -> tuple[float, tuple[float, float] | None, float, int]:
    """The window in which one of an effect's templates explains most.

    Args:
        whitener: The null.
        bank: Simulated templates.
        members: Indices of the effect's templates.
        vector: White vector of what is to be explained.

    Returns:
        Gain, window, amplitude and template index; gain 0 without a usable window.
    """
    comparison = whitener.comparison
    at = comparison.grid.centres
    spans = windows(comparison)
    best: tuple[float, tuple[float, float] | None, float, int] = (0.0, None, 0.0, members[0])
    for k in members:
        rows = np.array(
            [
                windowed_signature(
                    comparison, bank.without, bank.with_each[k], whitener.trust,
                    (at >= begin) & (at < end),
                )
                for begin, end in spans
            ]
        )  # fmt: skip
        white = whitener.through_standing(rows)
        power = np.einsum("ij,ij->i", white, white)
        seen = white @ vector
        gains = np.where(power > _WEAKEST, seen**2 / np.maximum(power, _WEAKEST), 0.0)
        top = int(np.argmax(gains))
        if gains[top] > best[0]:
            best = (float(gains[top]), spans[top], float(seen[top] / power[top]), k)
    return best
