"""Screening: linear scores of the whole catalogue over the record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explaining.signatures import Template
from wind_sensors.simulation.drive import Drive

FloatArray = npt.NDArray[np.float64]

JOINT_TEMPLATES = 4
"""Up to so many templates of an effect are combined; of larger banks the best one counts."""

_WEAKEST = 1e-2
_RIDGE = 1e-3


@dataclass(frozen=True)
class Score:
    """Linear score of one effect of one instrument.

    Attributes:
        effect, instrument: Names.
        gain: Drop of the cost that the best combination of its templates promises.
        amplitudes: Best combination, by the number of the effect's template and in units of it.
        template: The best single template.
        amplitude: Of that template, in the same unit.
    """

    effect: str
    instrument: str
    gain: float
    amplitudes: Mapping[int, float]
    template: Template
    amplitude: float


def _joint(gram: FloatArray, seen: FloatArray) -> tuple[float, FloatArray]:
    """Gain and amplitudes of the least-squares combination of a few signatures."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    normal = gram / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
    scaled = np.linalg.solve(normal, seen / scale)
    return float(scaled @ (seen / scale)), scaled / scale


Key = tuple[str, str]
"""An effect and its instrument, by name."""


def group_templates(templates: Sequence[Template]) -> dict[Key, list[int]]:
    """Indices of the templates of each effect of each instrument."""
    groups: dict[Key, list[int]] = {}
    for k, template in enumerate(templates):
        groups.setdefault((template.effect.name, template.instrument), []).append(k)
    return groups


def group_sizes(templates: Sequence[Template]) -> dict[tuple[Key, float], list[int]]:
    """The same, with the sizes of an effect apart."""
    groups: dict[tuple[Key, float], list[int]] = {}
    for k, template in enumerate(templates):
        key = (template.effect.name, template.instrument)
        groups.setdefault((key, template.multiple), []).append(k)
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
    found: dict[Key, Score] = {}
    for (key, multiple), members in group_sizes(templates).items():
        alive = [k for k in members if power[k] > _WEAKEST]
        if not alive:
            continue
        single = max(alive, key=lambda k: seen[k] ** 2 / power[k])
        gain = float(seen[single] ** 2 / power[single])
        amplitudes = {templates[single].number: float(seen[single] / power[single])}
        if len(members) <= JOINT_TEMPLATES and len(alive) > 1:
            gain, solved = _joint(gram[np.ix_(alive, alive)], seen[alive])
            amplitudes = {
                templates[k].number: float(a) for k, a in zip(alive, solved, strict=True)
            }
        score = Score(
            *key, gain, {number: multiple * a for number, a in amplitudes.items()},
            templates[single], multiple * float(seen[single] / power[single]),
        )
        if key not in found or gain > found[key].gain:
            found[key] = score
    return sorted(found.values(), key=lambda s: -s.gain)


def is_possible(score: Score) -> bool:
    """Whether the effect can be there as the score has it: no wake speeds the wind up."""
    return score.template.effect.relative_size(starting_values(score)) > 0.0


def starting_values(score: Score, drive: Drive | None = None) -> dict[str, float]:
    """Parameters at which a nonlinear fit of a scored effect begins.

    Args:
        score: Of the effect.
        drive: What drives the recording; None: in proportion to the effect's templates.
    """
    effect = score.template.effect
    values = {p.name: (0.0 if p.healthy is None else p.healthy) for p in effect.parameters}
    for parameter in effect.parameters:
        if not parameter.graded:
            values[parameter.name] = score.template.values[parameter.name]
    joint = len(score.amplitudes) > 1
    for number, amplitude in score.amplitudes.items():
        template = effect.templates[number]
        if not joint and number != score.template.number:
            continue
        for parameter in effect.parameters:
            if parameter.healthy is not None and parameter.graded:
                departure = template[parameter.name] - parameter.healthy
                values[parameter.name] += amplitude * departure
    if drive is not None:
        values = effect.begun(values, drive)
    for parameter in effect.parameters:
        values[parameter.name] = float(
            np.clip(values[parameter.name], parameter.low, parameter.high)
        )
    return values
