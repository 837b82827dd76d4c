"""The smallest size of an effect that the blocks of a bench would have shown."""

from __future__ import annotations

import numpy as np

from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.means.bench import CLIP, Bench, FloatArray, block_sums
from wind_sensors.station.model import Station

DETECTED = 3.3
"""Standard errors from which a size is seen: twice the 95 % quantile of the normal distribution,
with which false alarms and misses are 5 % each (Currie 1968, limit of detection)."""


def smallest_size(bench: Bench, station: Station, term: Term, change: FloatArray) -> SmallestSize:
    """Departure from health of a term's first parameter that would have shown.

    Args:
        bench: Rows.
        station: The station with everything that was found.
        term: An effect in a size of which its change is nearly a multiple.
        change: What it changes in the residual, shape (n,).

    Returns:
        `DETECTED` standard errors, from the scatter of its scores over blocks.
    """
    parameter = term.effect.parameters[0]
    signature = change / bench.noise
    psi = np.clip(bench.white(station, bench.everything), -CLIP, CLIP)
    scores = block_sums(psi * signature, bench.block, bench.blocks)
    error = float(np.sqrt(np.sum(scores**2))) / max(float(signature @ signature), 1e-9)
    moved = abs(term.values[parameter.name] - (parameter.healthy or 0.0))
    return SmallestSize(DETECTED * error * moved, parameter.unit, parameter.name)
