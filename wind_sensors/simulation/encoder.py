"""From a vane's heading to its stamped readings: mounting, potentiometer, filter, clock."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from wind_sensors.compiled import compiled
from wind_sensors.motion.frames import wrap
from wind_sensors.simulation import random_numbers
from wind_sensors.simulation.clocks import measured_seconds
from wind_sensors.simulation.response import AngleResponse, Response, Stretch
from wind_sensors.station.model import Angle

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


def angle_at(movement: AngleResponse, dt: float, seconds: FloatArray) -> FloatArray:
    """A vane's angle at any instants, by the cubic through angle and rate at its samples.

    Args:
        movement: Angle and rate every dt.
        dt: [s].
        seconds: Since the first sample [s]; held at the ends. Shape (n,).

    Returns:
        [rad, continuous], shape (n,).
    """
    angle, rate = movement.angle, movement.rate
    place = np.clip(seconds / dt, 0.0, angle.shape[0] - 1.0)
    # A stamp is rounded to the nanosecond: what lies that close to a sample is that sample.
    nearest = np.rint(place)
    place = np.where(np.abs(place - nearest) < 2e-9 / dt, nearest, place)
    left = np.minimum(place.astype(np.int64), angle.shape[0] - 2)
    u = place - left
    a, b = angle[left], angle[left + 1]
    slope_a, slope_b = rate[left] * dt, rate[left + 1] * dt
    c_2 = 3.0 * (b - a) - 2.0 * slope_a - slope_b
    c_3 = -2.0 * (b - a) + slope_a + slope_b
    value: FloatArray = np.where(u == 1.0, b, a + u * (slope_a + u * (c_2 + u * c_3)))
    return value


@compiled
def _behind_play(angle: FloatArray, start: float, half: float) -> FloatArray:
    """What a shaft with a free angle of two halves shows of another's angle, shape (n,)."""
    out = np.empty(angle.size)
    shaft = start
    for i in range(angle.size):
        shaft = min(max(shaft, angle[i] - half), angle[i] + half)
        out[i] = shaft
    return out


@compiled
def _no_faster(time: FloatArray, angle: FloatArray, start: float, fastest: float) -> FloatArray:
    """Readings that follow an angle the shorter way round, no faster than so many rad/s, (n,)."""
    out = np.empty(angle.size)
    shown = start
    for i in range(angle.size):
        most = fastest * (time[i] - time[i - 1]) if i > 0 else 0.0
        jump = angle[i] - shown
        jump -= 2.0 * math.pi * math.floor((jump + math.pi) / (2.0 * math.pi))
        shown += min(max(jump, -most), most)
        out[i] = shown
    return out


class AngleEncoder:
    """Sensor and logger of one vane axis; keeps its state between responses.

    Args:
        name: Name in `Response.angles`.
        origin: Start of the recording [ns].
        seed: Of the noise; None: no noise.
        first_sample: Running number of the first reading, which the noise belongs to.
    """

    def __init__(self, name: str, origin: int, seed: int | None, first_sample: int = 0) -> None:
        self._name = name
        self._origin = origin
        self._seed = seed
        self._samples = first_sample
        self._shaft: float | None = None
        self._filtered: float | None = None
        self._shown: tuple[float, float] | None = None
        self._held: float | None = None

    def readings(self, response: Response, stamped: TimeArray) -> FloatArray:
        """Readings with given stamps [ns] in a response; shape (n,) [rad, within -pi..pi].

        Stamps must increase and belong to measurements inside the response; readings that would
        lie outside take the nearest end.
        """
        movement = response.angles[self._name]
        out = np.empty(stamped.shape[0])
        numbers = self._samples + np.arange(stamped.shape[0], dtype=np.int64)
        done = 0
        for k, stretch in enumerate(response.stretches):
            vane = stretch.segment.station.instrument(self._name.split("/", maxsplit=1)[0])
            assert isinstance(vane, Angle)
            since = measured_seconds(vane.clock, stamped, self._origin)
            stop = stamped.shape[0]
            if k + 1 < len(response.stretches):
                stop = int(np.searchsorted(since, stretch.segment.stop - 1e-9))
            stop = max(stop, done)
            here = slice(done, stop)
            turned = self._behind_coupling(vane, movement, stretch)
            part = self._through_filter(vane, turned, response.drive.dt)
            begin = response.drive.elapsed + stretch.first * response.drive.dt
            angle = angle_at(part, response.drive.dt, since[here] - begin)
            read = self._not_too_fast(
                vane, since[here], self._read(vane, angle, numbers[here])
            )
            out[here] = self._held_in_outages(vane, since[here], read)
            done = stop
        self._samples += stamped.shape[0]
        return out

    def _behind_coupling(
        self, vane: Angle, movement: AngleResponse, stretch: Stretch
    ) -> AngleResponse:
        """Movement of the sensor's shaft in one stretch."""
        here = slice(stretch.first, stretch.last + 1)
        angle, rate = movement.angle[here], movement.rate[here]
        half = 0.5 * np.radians(vane.play_deg)
        if half == 0.0:
            self._shaft = None
            return AngleResponse(angle, rate)
        start = float(angle[0]) if self._shaft is None else self._shaft
        shaft = _behind_play(angle, start, half)
        self._shaft = float(shaft[-1])
        return AngleResponse(shaft, np.where(np.abs(angle - shaft) >= half, rate, 0.0))

    def _through_filter(self, vane: Angle, movement: AngleResponse, dt: float) -> AngleResponse:
        """The sensed angle after the logger's low-pass filter, exact for a linear course."""
        angle, rate = movement.angle, movement.rate
        if "/" not in self._name:
            amplitude = np.radians(vane.eccentricity_deg)
            if amplitude != 0.0:
                turned = angle - np.radians(vane.eccentricity_phase_deg)
                angle = angle + amplitude * np.sin(turned)
                rate = rate * (1.0 + amplitude * np.cos(turned))
        constant = vane.filter_time_constant
        if constant <= 0.0:
            self._filtered = None
            return AngleResponse(angle, rate)
        start = float(angle[0]) if self._filtered is None else self._filtered
        decay = float(np.exp(-dt / constant))
        ramp = constant / dt * (1.0 - decay)
        later = lfilter(
            [1.0 - ramp, ramp - decay],
            [1.0, -decay],
            angle[1:],
            zi=[(ramp - decay) * angle[0] + decay * start],
        )[0]
        slow = np.concatenate(([start], later))
        self._filtered = float(slow[-1])
        return AngleResponse(slow, (angle - slow) / constant)

    def _read(self, vane: Angle, angle: FloatArray, numbers: npt.NDArray[np.int64]) -> FloatArray:
        azimuth = "/" not in self._name
        if azimuth:
            angle = angle + np.radians(vane.offset_deg)
        if vane.noise_deg > 0.0 and self._seed is not None:
            noise = random_numbers.normal(self._seed, f"{self._name}/noise", numbers)
            angle = angle + np.radians(vane.noise_deg) * noise
        if azimuth and vane.gap_width_deg > 0.0:
            angle = self._over_gap(vane, angle, numbers)
        if azimuth and vane.reversed:
            angle = -angle
        if vane.quantisation_deg > 0.0:
            step = np.radians(vane.quantisation_deg)
            origin = np.radians(vane.quantisation_origin_deg)
            angle = np.rint(wrap(angle - origin) / step) * step + origin
        return wrap(angle)

    def _not_too_fast(
        self, vane: Angle, since: FloatArray, readings: FloatArray
    ) -> FloatArray:
        """Readings as a logger passes them on that refuses to turn faster than so much."""
        fastest = np.radians(vane.slew_limit_deg_s)
        if fastest == 0.0 or readings.size == 0:
            self._shown = None
            return readings
        time, start = since, float(readings[0])
        if self._shown is not None:
            before, start = self._shown
            time = np.concatenate(([before], since))
            readings = np.concatenate(([start], readings))
        shown = _no_faster(time, readings, start, float(fastest))
        self._shown = (float(time[-1]), float(shown[-1]))
        return wrap(shown[-since.size :])

    def _over_gap(
        self, vane: Angle, angle: FloatArray, numbers: npt.NDArray[np.int64]
    ) -> FloatArray:
        half = 0.5 * np.radians(vane.gap_width_deg)
        centre = np.radians(vane.gap_centre_deg)
        into = wrap(angle - centre)
        edge = centre + np.where(into < 0.0, -half, half)
        if vane.gap_reading_deg == "floating":
            chance = random_numbers.uniform(self._seed or 0, f"{self._name}/gap", numbers)
            edge = 2.0 * np.pi * chance - np.pi
        elif vane.gap_reading_deg is not None:
            edge = np.full_like(angle, np.radians(vane.gap_reading_deg))
        gapped: FloatArray = np.where(np.abs(into) < half, edge, angle)
        return gapped

    def _held_in_outages(self, vane: Angle, since: FloatArray, readings: FloatArray) -> FloatArray:
        """Readings with the last good one repeated while the sensor is stuck."""
        stuck = np.zeros(readings.shape[0], dtype=np.bool_)
        for outage in vane.outages:
            stuck |= (since >= outage.start) & (since < outage.stop)
        if np.any(stuck):
            before = float(readings[0]) if self._held is None else self._held
            good = np.where(stuck, -1, np.arange(readings.shape[0]))
            latest = np.maximum.accumulate(good)
            readings = np.where(latest >= 0, readings[np.maximum(latest, 0)], before)
            for outage in vane.outages:
                if outage.reading_deg is not None:
                    inside = (since >= outage.start) & (since < outage.stop)
                    readings[inside] = wrap(np.array(np.radians(outage.reading_deg)))
        if readings.shape[0]:
            self._held = float(readings[-1])
        return readings


def angle_readings(
    response: Response, name: str, stamped: TimeArray, seed: int | None = None
) -> FloatArray:
    """Readings of one vane axis with given stamps, in a response that begins a recording.

    Args:
        response: From `respond`; the recording starts `drive.elapsed` before its first instant.
        name: Vane, or `<bivane>/elevation`.
        stamped: Increasing stamps [ns], shape (n,); the vane's clock tells when they were measured.
        seed: Of the noise; None: no noise.

    Returns:
        [rad, within -pi..pi], shape (n,).
    """
    drive = response.drive
    origin = drive.start_ns - round(drive.elapsed * 1e9)
    return AngleEncoder(name, origin, seed).readings(response, stamped)
