"""The loop over events: prediction, correction, and the smoother at the end of each block."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.correction_kernel import (
    correct_by_edge,
    correct_by_reading,
    correct_by_silence,
    correct_by_turns,
)
from wind_sensors.estimation.filter_state import EDGE, READING, TURNS, FilterState, Ring
from wind_sensors.estimation.forward import Instruments
from wind_sensors.estimation.prediction_kernel import predict
from wind_sensors.estimation.smoother_kernel import smooth
from wind_sensors.estimation.turbulence_process import WIND_STATES

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_STOPPABLE = 16.0
"""A rotor whose y^2 is less than this times its friction may stop at once [1]."""
_SLOT_BY_SLOT = 1.2
"""Largest step of a shaft angle [slots] that is told whenever it passes a slot."""
_SLOT_BY_SLOT_AFTER = 10
"""Messages until that is believed."""
_LOSS_NOTICED = 0.002
"""Share of lost edges from which silence no longer means that the rotor waits."""
_TOO_EARLY = 0.4
"""An edge that comes after less than this share of a slot, by the last interval and by what is
known of the rate, is an extra one."""


@compiled
def is_extra_edge(f: FilterState, s: Instruments, r: int, time: int) -> bool:
    """Whether an edge comes before the rotor can have turned half a slot."""
    since = (time - f.last_edge[r]) * 1e-9
    if since > _TOO_EARLY * f.slot_interval[r]:
        return False
    width = 2.0 * math.pi / f.slots[r]
    y = WIND_STATES + 2 * r
    turned = f.mean[y] * since / (s.rotor[r, 1] * width)
    unsure = math.sqrt(f.covariance[y, y]) * since / (s.rotor[r, 1] * width)
    return bool(turned + 3.0 * unsure < _TOO_EARLY)


@compiled
def _doubt_rate(f: FilterState, r: int) -> None:
    """Widen what is known about the rate of rotor r, which edges have contradicted."""
    y = WIND_STATES + 2 * r
    f.covariance[y, y] += (0.3 * f.mean[y] + 0.3) ** 2


@compiled
def run(
    f: FilterState,
    s: Instruments,
    ring: Ring,
    time: IntArray,
    kind: IntArray,
    index: IntArray,
    value: FloatArray,
    extra: FloatArray,
    circumstances: FloatArray,
    stop: int,
    block: int,
    lag: int,
    weight: float,
    out_time: IntArray,
    out_states: FloatArray,
    out_covariance: FloatArray,
    out_circumstances: FloatArray,
) -> int:
    """Process events up to `stop`, a whole number of blocks.

    Args:
        f, s, ring: Filter, station, steps.
        time: Of the events, in order [ns].
        kind: OUTPUT, READING, EDGE or TURNS.
        index: Vane or rotor; running number of an output.
        value: Angle of a reading or of the rotor [rad]; for an edge the slots passed since the last
            one where lost edges have been counted, else nan.
        extra: Half the width of the range that a reading stands for [rad], 0 for an ordinary one.
        circumstances: Mount and air at the events, shape (n, 23).
        stop: End of the last block [ns].
        block: Length of a block [ns].
        lag: Of the smoother [ns].
        weight: Weight of a block in running averages.
        out_time, out_states, out_covariance, out_circumstances: Receive the estimates.

    Returns:
        Number of estimates.
    """
    filled = 0
    rotors = s.rotor.shape[0]
    capacity = ring.time.shape[0]
    end = (f.clock[0] // block + 1) * block
    n = time.shape[0]
    i = 0
    while True:
        if i >= n or time[i] >= end:
            if end > stop:
                break
            filled = smooth(
                f, s, ring, end - lag, weight, out_time, out_states, out_covariance,
                out_circumstances, filled,
            )
            end += block
            continue
        this = kind[i]
        which = index[i]
        counted = this == EDGE and not math.isnan(value[i])
        if counted:
            f.edge_count[which] += int(value[i]) - 1
            f.tally[which, 1] += int(value[i]) - 1
        if this == EDGE:
            if not counted and is_extra_edge(f, s, which, time[i]):
                if f.rejected[which] == 0:
                    f.tally[which, 2] += 1
                    f.rejected[which] = 1
                    i += 1
                    continue
                # Two in a row were no extra edges: the rotor is faster than believed.
                f.tally[which, 2] -= 1
                f.edge_count[which] += 1
                _doubt_rate(f, which)
            f.tally[which, 0] += 1
            f.rejected[which] = 0
            f.edge_count[which] += 1
            f.last_edge[which] = time[i]
            if f.edge_count[which] % f.stride[which] != 0:
                i += 1
                continue
        at = f.clock[2] % capacity
        ring.time[at] = time[i]
        ring.kind[at] = this
        ring.which[at] = which
        ring.slot[at] = -1
        ring.measured[at] = -1
        ring.moved[at] = 0
        dt = (time[i] - f.clock[0]) * 1e-9
        if dt > 0.0:
            predict(f, s, ring, at, circumstances[i], dt)
            f.clock[0] = time[i]
        if this == READING:
            correct_by_reading(f, s, ring, at, which, value[i], extra[i])
        elif this == EDGE:
            correct_by_edge(f, s, ring, at, which, time[i], counted)
        elif this == TURNS:
            f.tally[which, 0] += 1
            f.stride[which] = 0
            correct_by_turns(f, ring, at, which, value[i])
        else:
            _listen(f, s, ring, at, rotors, which)
            ring.circumstances[at] = circumstances[i]
            ring.mean[at] = f.mean
            ring.covariance[at] = f.covariance
        f.clock[2] += 1
        i += 1
    return filled


@compiled
def _must_have_turned(f: FilterState, s: Instruments, r: int) -> float:
    """Angle that rotor r has turned since its last edge whatever the wind did [rad].

    The wind brakes at most by y^2/(4 l0), with half the rotor's own speed; a longer silence is an
    outage and says nothing of the wind. 0 for a rotor that friction may have stopped.
    """
    if f.slot_interval[r] <= 0.0:
        return 0.0
    length = s.rotor[r, 3] * s.rotor[r, 12]
    y = 2.0 * math.pi * s.rotor[r, 1] / (f.slots[r] * f.slot_interval[r])
    friction = s.rotor[r, 9] + s.rotor[r, 2] * s.rotor[r, 2]
    if y * y < _STOPPABLE * friction:
        return 0.0
    since = (f.clock[0] - f.last_edge[r]) * 1e-9
    return float(4.0 * length / s.rotor[r, 1] * math.log(1.0 + 0.25 * y * since / length))


@compiled
def _listen_to_encoder(f: FilterState, ring: Ring, at: int, r: int) -> None:
    """A shaft angle that is told slot by slot has not left its slot, one way or the other."""
    if f.tally[r, 0] < _SLOT_BY_SLOT_AFTER or f.largest_step[r] > _SLOT_BY_SLOT:
        return
    measured = WIND_STATES + 2 * r + 1
    width = 2.0 * math.pi / f.slots[r]
    side = 1.0 if f.mean[measured] > f.last_angle[r] else -1.0
    correct_by_silence(f, ring, at, r, f.last_angle[r] + 1.2 * side * width, side)


@compiled
def _listen(f: FilterState, s: Instruments, ring: Ring, at: int, rotors: int, which: int) -> None:
    """No edge until now: at output instants one rotor in turn may not have passed its next edge."""
    if rotors == 0:
        return
    r = which % rotors
    if f.tally[r, 0] == 0:
        return
    if f.stride[r] == 0:
        _listen_to_encoder(f, ring, at, r)
        return
    lost = f.tally[r, 1] / max(f.tally[r, 0], 1)
    allowance = 1.2 if lost < _LOSS_NOTICED else 4.0
    width = 2.0 * math.pi / f.slots[r]
    if _must_have_turned(f, s, r) > (allowance + 1.0) * width:
        return
    correct_by_silence(f, ring, at, r, (f.edge_count[r] + allowance) * width, 1.0)
