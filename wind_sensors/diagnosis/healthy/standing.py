"""What stands on healthy instruments too, and how loud effects are on a healthy day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.screening import is_possible, scores_of
from wind_sensors.diagnosis.explaining.search import (
    PENALTY_PER_FURTHER_PARAMETER,
    PENALTY_PER_PARAMETER,
)
from wind_sensors.diagnosis.explaining.signatures import (
    Template,
    signature_bank,
    templates_of,
    with_larger,
)
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.reference_lag import lag_weights
from wind_sensors.diagnosis.healthy.whitening import (
    in_series,
    shared_liveliness,
    trust_of,
    whitener_of,
)

FloatArray = npt.NDArray[np.float64]

_STANDING_FACTOR = 1.3

STANDING_MEAN_PRIOR = 0.7
"""Prior deviation of the shared amplitudes, in templates."""

FEWEST_DAYS = 3
"""Of fewer healthy recordings nobody knows how loud they may be."""

LARGEST_SHARED_BANK = 4
"""Effects with more templates than this have no shared amplitude, only a scatter."""


@dataclass(frozen=True)
class Evidence:
    """What one healthy recording says about the amplitudes of the templates.

    Attributes:
        probes: The catalogue's templates, then their larger sizes.
        gram: Products of the noise-whitened signatures of all probes, shape (p, p).
        seen: Products of these signatures with the residual, shape (p,).
        common: Products of all of them with the catalogue's in the series alone, shape (p, k).
        inner: Products of the catalogue's signatures when every effect may stand at its least
            size, shape (k, k).
        inner_seen: The same with the residual, shape (k,).
        lag: Delays that the wind's way may bring, as sums of the catalogue's signatures.
    """

    probes: tuple[Template, ...]
    gram: FloatArray
    seen: FloatArray
    common: FloatArray
    inner: FloatArray
    inner_seen: FloatArray
    lag: FloatArray

    @property
    def keys(self) -> tuple[str, ...]:
        """Of the catalogue's templates."""
        return tuple(t.key for t in self.probes[: len(self.inner)])


def evidence_of(comparison: Comparison, baseline: Baseline) -> Evidence:
    """What a healthy recording says about every template."""
    station = baseline.station
    own = signature_bank(comparison, station, templates_of(comparison, station, catalogue()))
    templates = own.templates
    bank = with_larger(own, comparison, station)
    trust = trust_of(comparison, bank.without, baseline)
    probed = bank.whitened(comparison, trust)
    signatures = in_series(comparison, probed[: len(templates)])
    residual = comparison.vector(bank.without, trust)
    least = np.array([t.smallest_standing for t in templates])
    lively = shared_liveliness(comparison, trust, baseline.liveliness)
    shared = whitener_of(comparison, trust, lively, np.ones(len(lively)))
    whitener = whitener_of(
        comparison,
        trust,
        np.concatenate((signatures, lively)),
        np.concatenate((least, np.ones(len(lively)))),
    )
    probed = shared.through_standing(probed)
    white = whitener.through_standing(signatures)
    return Evidence(
        probes=tuple(bank.templates),
        gram=probed @ probed.T,
        seen=probed @ shared.through_standing(residual),
        common=probed @ signatures.T,
        inner=white @ white.T,
        inner_seen=white @ whitener.through_standing(residual),
        lag=lag_weights(comparison, templates),
    )


def _bank(key: str) -> str:
    return key.rpartition("|")[0]


def standing_means(rows: Sequence[Evidence]) -> dict[str, float]:
    """Amplitudes that all healthy recordings share.

    Of effects with few templates that are not just there or not. They are taken off the series
    alone: statistics have means of their own, beyond which nothing is shared, and so hold those
    effects back that would change them.
    """
    effects = {t.key: t.effect for row in rows for t in row.probes}
    every = sorted({key for row in rows for key in row.keys})
    crowd = {key: sum(_bank(k) == _bank(key) for k in every) for key in every}
    keys = [
        key
        for key in every
        if crowd[key] <= LARGEST_SHARED_BANK and effects[key].standing > 0.0
    ]
    place = {key: k for k, key in enumerate(keys)}
    normal = np.eye(len(keys)) / STANDING_MEAN_PRIOR**2
    right = np.zeros(len(keys))
    for row in rows:
        used = [k for k, key in enumerate(row.keys) if key in place]
        target = [place[row.keys[k]] for k in used]
        normal[np.ix_(target, target)] += row.inner[np.ix_(used, used)]
        right[target] += row.inner_seen[used]
    solved = np.linalg.solve(normal, right)
    return {key: float(solved[k]) for key, k in place.items()}


def standing_sizes(rows: Sequence[Evidence], means: Mapping[str, float]) -> dict[str, float]:
    """Standing scatter of each template about the shared amplitudes.

    Banks of templates (bearings) have none of their own: few healthy recordings see each of them,
    and what errors of the reference do to them is in the noise.
    """
    amplitudes: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        shared = np.array([means.get(key, 0.0) for key in row.keys])
        size = len(row.keys)
        power = np.diag(row.gram)[:size]
        rest = row.seen[:size] - row.common[:size] @ shared
        for k, key in enumerate(row.keys):
            if power[k] > 1e-3:
                amplitudes.setdefault(key, []).append(
                    (float(rest[k] / power[k]), float(power[k] ** -0.5))
                )
    out = {}
    for key, seen in amplitudes.items():
        if sum(_bank(other) == _bank(key) for other in amplitudes) > LARGEST_SHARED_BANK:
            continue
        b = np.array([a for a, _ in seen])
        error = np.array([e for _, e in seen])
        # Recordings that can hardly show the effect say little about its standing size.
        weight = 1.0 / error**2
        mean = float(np.sum(weight * (b**2 - error**2)) / np.sum(weight))
        out[key] = float(np.sqrt(_STANDING_FACTOR * max(0.0, mean)))
    return out


def loudest_gains(
    rows: Sequence[Evidence], calm: Sequence[bool] | None = None
) -> dict[str, float]:
    """Largest gain that each effect promises in a healthy recording judged by the others.

    Args:
        rows: Of each healthy recording.
        calm: Which of them say nothing of a windy day; None, or too few others: none.

    Returns:
        By `effect|instrument` (or `station`, `platform`), drop of the cost beyond what the
        parameters cost, where there is one; nothing with fewer than three recordings. The wind's
        way from the reference is taken for granted, as the search does.
    """
    loudest: dict[str, float] = {}
    if len(rows) < FEWEST_DAYS:
        return loudest
    counted = list(range(len(rows)))
    if calm is not None and calm.count(False) >= FEWEST_DAYS:
        counted = [k for k in counted if not calm[k]]
    for left_out in counted:
        row = rows[left_out]
        others = [r for k, r in enumerate(rows) if k != left_out]
        means, sizes = standing_means(others), standing_sizes(others, standing_means(others))
        own = row.probes[: len(row.keys)]
        standing = np.array([max(sizes.get(t.key, 0.0), t.smallest_standing) for t in own])
        shared = np.array([means.get(t.key, 0.0) for t in own])
        seen = row.seen - row.common @ shared
        usual = np.concatenate((np.diag(standing)[standing > 0.0], row.lag))
        part = usual @ row.gram[: len(own)]
        inner = np.linalg.solve(np.eye(len(usual)) + part[:, : len(own)] @ usual.T, part)
        gram = row.gram - part.T @ inner
        seen = seen - inner.T @ (usual @ seen[: len(own)])
        for score in filter(is_possible, scores_of(row.probes, gram, seen)):
            parameters = len(score.template.effect.parameters)
            cost = PENALTY_PER_PARAMETER + PENALTY_PER_FURTHER_PARAMETER * (parameters - 1)
            key = f"{score.effect}|{score.instrument}"
            if score.gain - cost > loudest.get(key, 0.0):
                loudest[key] = score.gain - cost
    return loudest
