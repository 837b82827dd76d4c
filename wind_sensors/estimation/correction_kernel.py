"""Messages correct the filter: readings, edges, counters, and the silence of a rotor."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.filter_state import EDGE, READING, FilterState, Ring
from wind_sensors.estimation.forward import ON_VANE, Instruments, forcing_of
from wind_sensors.estimation.turbulence_process import PAIRS, WIND_STATES
from wind_sensors.estimation.wind_state import wind_of

FloatArray = npt.NDArray[np.float64]

_SURPRISE = 3.5
"""Innovations beyond this many standard deviations make the filter look for the wind again."""
_CALM = 0.3
"""[m/s]"""
_AMBIGUOUS = 0.35
"""Uncertainty of the turned angle [slots] from which an edge no longer tells how many slots have
passed."""
_LEAST_PART = 0.2
"""[slots]"""
_RARE = 7.0
"""Log of the odds against a lost or an extra edge before any was seen."""
_FAR_OUT = 5.0
"""Innovations beyond this many standard deviations are cut back to it."""


@compiled
def correct(
    f: FilterState, ring: Ring, slot: int, measured: int, innovation: float, variance: float
) -> float:
    """Scalar measurement of one state; returns the squared normalised innovation.

    An innovation far outside its scatter is given the noise that makes it believable.
    """
    n = f.mean.shape[0]
    p = f.covariance
    total = p[measured, measured] + variance
    squared = innovation * innovation / total
    if squared > _FAR_OUT * _FAR_OUT:
        total = innovation * innovation / (_FAR_OUT * _FAR_OUT)
    gain = ring.gain[slot]
    for i in range(n):
        gain[i] = p[i, measured] / total
    for i in range(n):
        f.mean[i] += gain[i] * innovation
    for i in range(n):
        for j in range(i + 1):
            value = p[i, j] - gain[i] * total * gain[j]
            p[i, j] = value
            p[j, i] = value
    ring.measured[slot] = measured
    ring.innovation[slot] = innovation
    ring.variance[slot] = total
    return float(squared)


@compiled
def correct_by_reading(f: FilterState, s: Instruments, ring: Ring, slot: int, v: int, angle: float,
                       half_width: float) -> None:
    """A vane's reading, already turned into a heading of the nose [rad].

    With a half width the nose is only known to be within so much of the heading.
    """
    rotors = s.rotor.shape[0]
    measured = WIND_STATES + 2 * (rotors + v)
    innovation = angle - f.mean[measured]
    innovation -= 2.0 * math.pi * math.floor((innovation + math.pi) / (2.0 * math.pi))
    ring.which[slot] = v
    if half_width > 0.0:
        _correct_by_range(f, ring, slot, measured, innovation, half_width, f.reading_variance[v])
        ring.kind[slot] = -READING
        return
    squared = correct(f, ring, slot, measured, innovation, f.reading_variance[v])
    ring.kind[slot] = READING
    _note(f, rotors + v, squared)


@compiled
def _correct_by_range(
    f: FilterState, ring: Ring, slot: int, measured: int, middle: float, reach: float, noise: float
) -> None:
    """A state lies within `reach` of its mean plus `middle`, limits as unsharp as a reading.

    Mean and variance of the truncated normal distribution, by an equivalent measurement.
    """
    prior = f.covariance[measured, measured]
    blurred = prior + noise
    deviation = math.sqrt(blurred)
    low, high = (middle - reach) / deviation, (middle + reach) / deviation
    if low > 4.0 or high < -4.0:
        variance = noise + reach * reach / 3.0
        correct(f, ring, slot, measured, middle, variance)
        return
    root = math.sqrt(2.0)
    inside = 0.5 * (math.erfc(low / root) - math.erfc(high / root))
    share = 1.0 / (math.sqrt(2.0 * math.pi) * max(inside, 1e-6))
    at_low, at_high = share * math.exp(-0.5 * low * low), share * math.exp(-0.5 * high * high)
    shift = at_low - at_high
    left = 1.0 + low * at_low - high * at_high - shift * shift
    # Of the state itself: what the limits say reaches it by its part in the blurred variance.
    gained = min(max((1.0 - left) * prior / blurred, 1e-6), 0.9999)
    variance = prior * (1.0 - gained) / gained
    moved = shift * prior / deviation
    correct(f, ring, slot, measured, moved * (prior + variance) / prior, variance)


@compiled
def _note(f: FilterState, which: int, squared: float) -> None:
    """Running consistency of the innovations."""
    keep = 0.998
    f.innovation[which, 0] = keep * f.innovation[which, 0] + min(squared, 100.0)
    f.innovation[which, 1] = keep * f.innovation[which, 1] + 1.0
    if squared > _FAR_OUT * _FAR_OUT:
        f.outliers[which] += 1


@compiled
def correct_by_edge(
    f: FilterState, s: Instruments, ring: Ring, slot: int, r: int, time: int, counted: bool
) -> None:
    """An edge of rotor r at a time [ns], the number of lost edges resolved unless it is counted.

    Edges were lost (or came extra) when the filter says so and the interval has grown (or shrunk)
    as much: no rotor changes so quickly by itself.
    """
    measured = WIND_STATES + 2 * r + 1
    width = 2.0 * math.pi / f.slots[r]
    number = f.edge_count[r]
    place = int(number % f.slots[r])
    expected = (number + f.slot_error[r, place]) * width
    off = (expected - f.mean[measured]) / width
    spread = math.sqrt(f.covariance[measured, measured]) / width
    if spread > _AMBIGUOUS:
        _forget_angle(f, ring, slot, r, expected)
        f.last_used[r] = time
        f.slot_interval[r] = 0.0
        return
    interval = (time - f.last_used[r]) * 1e-9 / f.stride[r]
    lost = 0 if counted else _lost_or_extra(f, r, off, spread, interval)
    if lost != 0:
        number += lost
        f.edge_count[r] = number
        if lost > 0:
            f.tally[r, 1] += lost
        else:
            f.tally[r, 2] -= lost
        place = int(number % f.slots[r])
        expected = (number + f.slot_error[r, place]) * width
    if f.last_used[r] > 0:
        f.slot_interval[r] = interval * f.stride[r] / max(f.stride[r] + lost, 1)
    f.last_used[r] = time
    innovation = expected - f.mean[measured]
    regain_wind(f, s, r, innovation)
    variance = f.edge_variance[r] * width * width
    squared = correct(f, ring, slot, measured, innovation, variance)
    ring.kind[slot] = EDGE
    ring.which[slot] = r
    ring.slot[slot] = place
    _note(f, r, squared)


@compiled
def _lost_or_extra(
    f: FilterState, r: int, off: float, spread: float, interval: float
) -> int:
    """Lost (positive) or extra (negative) edges of rotor r that the evidence speaks for.

    Args:
        f, r: Filter, rotor.
        off: Edge expected minus angle believed [slots].
        spread: Uncertainty of the latter [slots].
        interval: Since the last edge used, for each of the stride [s].
    """
    lost = int(-math.floor(off + 0.5))
    if f.slot_interval[r] == 0.0 or lost == 0:
        return 0
    even = (1.0 + 0.5 * lost / f.stride[r]) * f.slot_interval[r]
    if (lost > 0 and interval < even) or (lost < 0 and interval > even):
        return 0
    # An edge too many or too few is rare: the evidence must outweigh that.
    share = (f.tally[r, 1] + f.tally[r, 2] + 0.5) / (f.tally[r, 0] + 1.0)
    doubt = min(max(-math.log(share), 1.0), _RARE)
    gained = 0.5 * (off * off - (off + lost) * (off + lost))
    if gained < doubt * (spread * spread + f.edge_variance[r]):
        return 0
    return lost


@compiled
def _forget_angle(f: FilterState, ring: Ring, slot: int, r: int, angle: float) -> None:
    """Count anew from an edge after too long a silence: only the rotor's angle is known then.

    The step's transition loses the row of the angle, so that the smoother draws nothing from it.
    """
    n = f.mean.shape[0]
    state = WIND_STATES + 2 * r + 1
    width = 2.0 * math.pi / f.slots[r]
    if ring.moved[slot] == 0:
        ring.moved[slot] = 1
        ring.decay[slot, :] = 1.0
        ring.noise[slot, :, :] = 0.0
        ring.noise_gain[slot, :, :] = 0.0
        ring.transition[slot, :, :] = 0.0
        for k in range(n - WIND_STATES):
            ring.transition[slot, k, WIND_STATES + k] = 1.0
    ring.transition[slot, 2 * r + 1, :] = 0.0
    ring.noise_gain[slot, 2 * r + 1, :] = 0.0
    f.mean[state] = angle
    for k in range(n):
        f.covariance[state, k] = 0.0
        f.covariance[k, state] = 0.0
    f.covariance[state, state] = f.edge_variance[r] * width * width


@compiled
def regain_wind(f: FilterState, s: Instruments, r: int, innovation: float) -> None:
    """Look for the wind again when rotor r runs ahead although the believed wind would brake it.

    The torque as a function of the wind has two branches around half the rotor's speed; in a lull
    the filter may sit on the lower one when the wind comes back, and no small step leads across.
    The wind is then put to what drives the rotor, along the vane, with a wide covariance.
    """
    rotors = s.rotor.shape[0]
    state = WIND_STATES + 2 * r
    variance = f.covariance[state + 1, state + 1]
    if innovation < _SURPRISE * math.sqrt(variance) or s.vane.shape[0] == 0:
        return
    v = int(s.mounting[r, 1]) if int(s.mounting[r, 0]) == ON_VANE else 0
    phi = f.mean[WIND_STATES + 2 * (rotors + v)]
    c = f.circumstances
    wind = np.empty(3)
    wind_of(f.mean, wind)
    forcing, _, _ = forcing_of(s, r, wind, c, phi, 0.0)
    y = f.mean[state]
    if forcing > y:
        return
    speed = 1.2 * y + s.rotor[r, 2] + 0.1
    x = -speed * math.cos(phi)
    z = -speed * math.sin(phi)
    spread = (0.3 * speed + _CALM) ** 2
    for k in range(2 * PAIRS):
        f.mean[k] = 0.0
    f.mean[2 * PAIRS - 2] = c[3] * x + c[4] * z + c[0]
    f.mean[2 * PAIRS - 1] = c[6] * x + c[7] * z + c[1]
    f.covariance[2 * PAIRS - 2, 2 * PAIRS - 2] += spread
    f.covariance[2 * PAIRS - 1, 2 * PAIRS - 1] += spread
    f.covariance[state, state] += spread
    f.covariance[state + 1, state + 1] += innovation * innovation
    f.tally[r, 3] += 1


@compiled
def correct_by_turns(f: FilterState, ring: Ring, slot: int, r: int, angle: float) -> None:
    """The angle that rotor r has turned through [rad], from a counter or an encoder.

    A reading far from what the rotor can have done means that the counter began anew.
    """
    measured = WIND_STATES + 2 * r + 1
    width = 2.0 * math.pi / f.slots[r]
    innovation = angle - f.mean[measured]
    spread = math.sqrt(f.covariance[measured, measured])
    if abs(innovation) > 4.0 * spread + 20.0 * width:
        f.rejected[r] += 1
        if f.rejected[r] >= 3:
            f.mean[measured] = angle
            f.rejected[r] = 0
            f.tally[r, 3] += 1
        return
    f.rejected[r] = 0
    if f.tally[r, 0] > 1:
        step = abs(angle - f.last_angle[r]) / width
        # A step of part of a slot: the angle is sampled in time.
        sampled = _LEAST_PART < step < 1.0 - _LEAST_PART
        f.largest_step[r] = math.inf if sampled else max(f.largest_step[r], step)
    f.last_angle[r] = angle
    squared = correct(f, ring, slot, measured, innovation, f.edge_variance[r] * width * width)
    ring.kind[slot] = EDGE
    ring.which[slot] = r
    _note(f, r, squared)


@compiled
def correct_by_silence(
    f: FilterState, ring: Ring, slot: int, r: int, limit: float, side: float
) -> None:
    """No edge yet: rotor r has not passed `limit` [rad]; a truncated normal distribution.

    `side` is 1 for a limit ahead of the rotor, -1 for one behind it. Mean and variance are matched
    by an equivalent measurement, so that the smoother sees an ordinary one.
    """
    measured = WIND_STATES + 2 * r + 1
    variance = f.covariance[measured, measured]
    deviation = math.sqrt(variance)
    z = side * (limit - f.mean[measured]) / deviation
    if z > 2.5:
        return
    if z > -5.0:
        ratio = math.exp(-0.5 * z * z) / (
            math.sqrt(2.0 * math.pi) * 0.5 * math.erfc(-z / math.sqrt(2.0))
        )
    else:
        ratio = -z - 1.0 / z
    left = min(max(1.0 - z * ratio - ratio * ratio, 1e-4), 0.999)
    noise = variance * left / (1.0 - left)
    innovation = -side * deviation * ratio * (variance + noise) / variance
    correct(f, ring, slot, measured, innovation, noise)
