"""From a vane's reading back to the heading of its nose: what the mounting and the sensor did."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.station.model import Angle

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_REPEATED = 20.0
"""Readings inside a gap repeat one another: so many count as one."""


class Headings(NamedTuple):
    """Usable readings: time [ns], heading [rad], variance beyond the usual noise [rad^2]."""

    time: TimeArray
    heading: FloatArray
    extra_variance: FloatArray


def _wrapped(angle: FloatArray) -> FloatArray:
    out: FloatArray = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
    return out


def headings(vane: Angle, time: TimeArray, reading: FloatArray, origin: int) -> Headings:
    """Undo sensor and mounting.

    Args:
        vane: The vane with what is known to be wrong with it.
        time: Of the measurements [ns], shape (n,).
        reading: As delivered [rad], shape (n,).
        origin: Start of the recording [ns]; outages count from there.

    Returns:
        Readings outside outages. One inside the potentiometer's gap says only that the nose is
        somewhere in the gap; its variance says so.
    """
    since = (time - origin) * 1e-9
    usable = np.isfinite(reading)
    for outage in vane.outages:
        usable &= (since < outage.start) | (since >= outage.stop)
    time, angle = time[usable], reading[usable]
    extra = np.zeros(angle.shape[0])
    if vane.reversed:
        angle = -angle
    if vane.gap_width_deg > 0.0:
        width, centre = np.radians(vane.gap_width_deg), np.radians(vane.gap_centre_deg)
        off = _wrapped(angle - centre)
        tolerance = 0.5 * np.radians(vane.quantisation_deg) + 1e-6
        if vane.gap_reading_deg is None:
            inside = np.abs(off) <= 0.5 * width + tolerance
            # The nearer edge is shown: the nose is in that half of the gap.
            middle, reach = centre + 0.25 * width * np.sign(off), 0.5 * width
        else:
            shown = _wrapped(angle - np.radians(vane.gap_reading_deg))
            inside = (np.abs(shown) <= tolerance) | (np.abs(off) < 0.5 * width - tolerance)
            middle, reach = np.full_like(angle, centre), width
        angle = np.where(inside, middle, angle)
        extra = np.where(inside, _REPEATED * reach * reach / 12.0, extra)
    angle = _wrapped(angle - np.radians(vane.offset_deg))
    amplitude = np.radians(vane.eccentricity_deg)
    if amplitude != 0.0:
        phase = np.radians(vane.eccentricity_phase_deg)
        heading = angle.copy()
        for _ in range(8):
            heading = angle - amplitude * np.sin(heading - phase)
        angle = heading
    return Headings(time, angle, extra)
