"""Few candidate causes of a departure, with weights: a first opinion, not a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.effects.wording import number_text
from wind_sensors.diagnosis.explaining.screening import Score, group_templates, starting_values
from wind_sensors.diagnosis.explaining.signatures import Template
from wind_sensors.diagnosis.watch.evidence import Evidence, Registry, Snapshot
from wind_sensors.errors import UserError
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

SHORTLIST = 7
"""Effects whose size is tried out in the simulation itself."""

MOST = 3
"""Candidates told."""

LEAST_WEIGHT = 0.08
"""A candidate below this is not told."""

LINEAR_BANK = 4
"""Effects with more templates than this (bearings) take the best one instead of a combination."""

LARGEST = 4.0
"""Whitened differences far beyond this count by their logarithm: no single one may dominate."""

_COARSE_SIZES = (0.5, 1.0, 2.0, 4.0)
_SIZES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)
_FINE_SIZES = (0.89, 0.96, 1.04, 1.12)
_RIDGE = 1e-3
_PER_PARAMETER = 20.0
"""Misfit that one more parameter removes from a few healthy blocks, whose noise is not white."""


@dataclass(frozen=True)
class Candidate:
    """A cause that would explain a departure.

    Attributes:
        effect: Identifier in the catalogue.
        instrument: Name.
        weight: Share of belief among the catalogue's effects, 0 to 1.
        explained: Share of the excess misfit that it removes.
        gain: Misfit that it removes from one block, in squares of whitened differences.
        size: In smallest sizes worth reporting.
        values: Its parameters, roughly.
        units: Of the parameters.
    """

    effect: str
    instrument: str
    weight: float
    explained: float
    gain: float
    size: float
    values: Mapping[str, float]
    units: Mapping[str, str]

    def __str__(self) -> str:
        shown = ", ".join(
            f"{name} about {number_text(value, 2)}"
            + (f" {unit}" if (unit := self.units[name]) != "1" else "")
            for name, value in self.values.items()
        )
        return f"{self.effect} of {self.instrument} ({100 * self.weight:.0f} %; {shown})"


def limited(vector: FloatArray) -> float:
    """Sum of squares in which large differences count by their logarithm (Cauchy's loss)."""
    return float(LARGEST**2 * np.sum(np.log1p((vector / LARGEST) ** 2)))


def shortlist(registry: Registry, evidence: Sequence[Evidence]) -> list[Score]:
    """Effects by what their signatures explain of the blocks together, best first."""
    size = len(registry.templates)
    gram, seen = np.zeros((size, size)), np.zeros(size)
    for block in evidence:
        gram[np.ix_(block.places, block.places)] += block.gram
        seen[block.places] += block.seen
    power = np.diag(gram)
    out = []
    for (effect, instrument), members in group_templates(registry.templates).items():
        alive = [k for k in members if power[k] > 1e-2]
        if not alive:
            continue
        single = max(alive, key=lambda k: seen[k] ** 2 / power[k])
        best = registry.templates[single]
        amplitude = float(seen[single] / power[single])
        gain = float(seen[single] * amplitude)
        amplitudes = {best.number: amplitude}
        if len(alive) > 1 and len(members) <= LINEAR_BANK:
            scale = np.sqrt(power[alive])
            part = gram[np.ix_(alive, alive)] / np.outer(scale, scale)
            solved = np.linalg.solve(part + _RIDGE * np.eye(len(alive)), seen[alive] / scale)
            gain = float(solved @ (seen[alive] / scale))
            amplitudes = {
                registry.templates[k].number: float(a)
                for k, a in zip(alive, solved / scale, strict=True)
            }
        out.append(Score(effect, instrument, gain, amplitudes, best, amplitude))
    return sorted(out, key=lambda s: -s.gain)


def _free(effect: Effect, values: Mapping[str, float]) -> int:
    return sum(
        p.value_from != "forms" and (p.healthy is None or values[p.name] != p.healthy)
        for p in effect.parameters
    )


def _cost(snapshots: Sequence[Snapshot], station: Station, template: Template) -> float:
    total = 0.0
    for snapshot in snapshots:
        comparison = snapshot.comparison
        only = comparison.affected(station, template.instrument)
        try:
            moved = comparison.simulate(template.planted(station), only, snapshot.healthy)
        except (ValueError, UserError):
            return np.inf
        total += limited(snapshot.residual(moved))
    return total


def _starts(score: Score) -> list[dict[str, float]]:
    """Where the search for a size begins: the linear estimate, and what the effect proposes."""
    effect = score.template.effect
    first = starting_values(score)
    proposed = [
        {**first, p.name: start} for p in effect.parameters for start in p.starts if p.minimum
    ]
    return [first, *proposed]


def _tried(
    score: Score, snapshots: Sequence[Snapshot], station: Station
) -> tuple[float, Score, dict[str, float]]:
    """Best cost and values of an effect along rays from health through its starting points."""
    effect = score.template.effect
    newest = snapshots[-1:]
    options = [
        effect.scaled(start, factor) for start in _starts(score) for factor in _COARSE_SIZES
    ]
    costs = [_cost(newest, station, Template(effect, score.instrument, 0, v)) for v in options]
    start = options[int(np.argmin(costs))]
    return min(costs), score, start


def candidates(
    registry: Registry,
    station: Station,
    evidence: Sequence[Evidence],
    snapshots: Sequence[Snapshot],
) -> list[Candidate]:
    """The few effects that explain the blocks best.

    The linear scores of all blocks choose a shortlist; the sizes of its members are then tried in
    the simulation of the newest blocks, because large effects are not proportional to their
    signatures.

    Args:
        registry: Templates.
        station: The healthy station.
        evidence: Blocks since the onset.
        snapshots: The newest of them, whole.

    Returns:
        Best first; weights sum to one over the shortlist.
    """
    if not snapshots or not evidence:
        return []
    healthy = sum(limited(s.residual(s.healthy)) for s in snapshots)
    count = sum(s.residual(s.healthy).size for s in snapshots)
    coarse = sorted(
        (_tried(score, snapshots, station) for score in shortlist(registry, evidence)),
        key=lambda t: t[0],
    )
    tried: list[tuple[float, Score, dict[str, float]]] = []
    for _, score, start in coarse[:SHORTLIST]:
        effect = score.template.effect
        best, kept = np.inf, start
        for sizes in (_SIZES, _FINE_SIZES):
            around = kept
            for factor in sizes:
                values = effect.scaled(around, factor)
                template = Template(effect, score.instrument, 0, values)
                cost = _cost(snapshots, station, template)
                if cost < best:
                    best, kept = cost, values
        if effect.relative_size(kept) > 0.0 and best < healthy:
            tried.append((best + _PER_PARAMETER * _free(effect, kept), score, kept))
    if not tried:
        return []
    costs = np.array([t[0] for t in tried])
    # Differences that are not white overstate the evidence: the best fit's own excess calibrates.
    temper = 2.0 * max(4.0, float(costs.min()) / max(count, 1))
    weights = np.exp(-(costs - costs.min()) / temper)
    weights /= weights.sum()
    excess = max(healthy - count, 0.05 * healthy)
    found = [
        Candidate(
            effect=score.effect,
            instrument=score.instrument,
            weight=float(weight),
            explained=float(np.clip((healthy - cost) / excess, 0.0, 1.0)),
            gain=(healthy - cost) / len(snapshots),
            size=score.template.effect.relative_size(values),
            values=values,
            units={p.name: p.unit for p in score.template.effect.parameters},
        )
        for weight, (cost, score, values) in zip(weights, tried, strict=True)
    ]
    found.sort(key=lambda c: -c.weight)
    return [c for c in found if c.weight >= LEAST_WEIGHT][:MOST]
