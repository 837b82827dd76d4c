"""The wind along a path through frozen turbulence, and what a reference beside it measures.

Taylor's hypothesis in the earth frame: the turbulence drifts with the mean wind. A carrier passes
through it at its velocity against that wind, so that one that drives upwind meets the gusts faster
than one that drives downwind. The record is read by the length of the path through the air, which
is exact for motion along the wind slower than the wind, and right in rate for any other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.station.model import Reference
from wind_sensors.station.signals import Winds
from wind_sensors.turbulence.synthesis import TurbulenceSpec, TurbulenceStream

FloatArray = npt.NDArray[np.float64]

DECAY_OF_COHERENCE = 7.0
"""Exponent c of the root coherence exp(-c r k / 2 pi) at a separation r (Davenport's form)."""
_FILTER_SECONDS = 6.4
"""Length of the filters that make the reference's wind [s]."""
_SECOND_FIELD = 1_000_003
"""Added to the seed for the part of the reference's wind that the sensor does not see."""


class WindSource(Protocol):
    """Anything that can blow on a station."""

    def mean_at(self, time: FloatArray) -> FloatArray:
        """Velocity at which the gusts drift past, ENU [m/s], shape (n, 3)."""

    def along(self, time: FloatArray, travelled: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Wind at the sensor and at the reference, ENU [m/s], shape (n, 3) each.

        Args:
            time: Since the start [s], increasing, shape (n,).
            travelled: Time that the air path would have taken on a mast [s], shape (n,).
        """


def coherence_filters(
    mean_speed: float, sample_rate: float, separation: float, path_length: float
) -> tuple[FloatArray, FloatArray]:
    """Symmetric filters that make a reference's wind from the sensor's and an independent one.

    Args:
        mean_speed: [m/s].
        sample_rate: Of the records [1/s].
        separation: Distance of the reference [m].
        path_length: Over which it averages [m].

    Returns:
        Taps for the sensor's record (root coherence times path average) and for the independent
        record (what is missing of the variance); shape (taps,) each.
    """
    half = round(0.5 * _FILTER_SECONDS * sample_rate)
    taps = 2 * half + 1
    frequency = np.fft.rfftfreq(taps, 1.0 / sample_rate)
    coherent = np.exp(-DECAY_OF_COHERENCE * separation * frequency / mean_speed)
    own = np.sqrt(1.0 - np.square(coherent))
    path = np.sinc(frequency * path_length / mean_speed)
    shared = np.roll(np.fft.irfft(coherent * path, taps), half)
    independent = np.roll(np.fft.irfft(own * path, taps), half)
    return shared, independent


class TurbulentWind:
    """A turbulent wind by its specification.

    Args:
        spec: Mean, spectra, slow changes, seed.
        sample_rate: Of the record [1/s]; a station on a mast samples it exactly at this rate.
        reference: Its separation and path decide what the reference measures; None: the same wind.
    """

    def __init__(
        self, spec: TurbulenceSpec, sample_rate: float, reference: Reference | None = None
    ) -> None:
        self._spec = spec
        self._rate = sample_rate
        # Filters reach into the record on both sides: t = 0 lies that far from its start.
        self._half = round(0.5 * _FILTER_SECONDS * sample_rate)
        self._lead = self._half + 8
        self._sensor = TurbulenceStream(spec, sample_rate)
        self._filters: tuple[FloatArray, FloatArray] | None = None
        if reference is not None and (reference.separation > 0.0 or reference.path_length > 0.0):
            other = replace(spec, seed=spec.seed + _SECOND_FIELD)
            self._other = TurbulenceStream(other, sample_rate)
            self._filters = coherence_filters(
                spec.mean_speed, sample_rate, reference.separation, reference.path_length
            )

    def mean_at(self, time: FloatArray) -> FloatArray:
        """The specification's mean velocity, without its slow changes; shape (n, 3)."""
        spec = self._spec
        mean = spec.mean_speed * np.array([np.cos(spec.direction), np.sin(spec.direction), 0.0])
        return np.tile(mean, (time.shape[0], 1))

    def along(self, time: FloatArray, travelled: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `WindSource.along`."""
        place = travelled * self._rate + self._lead
        nearest = np.rint(place)
        place = np.where(np.abs(place - nearest) < 1e-6, nearest, place)
        half = self._half
        first = int(np.floor(place[0])) - 1
        count = int(np.floor(place.max())) + 3 - first
        wide = self._sensor.fluctuations(first - half, count + 2 * half)
        sensor = _read_at(wide[half:-half], place - first)
        if self._filters is None:
            beside = sensor
        else:
            other = self._other.fluctuations(first - half, count + 2 * half)
            shared, independent = self._filters
            record = np.stack(
                [
                    np.convolve(wide[:, k], shared, "valid")
                    + np.convolve(other[:, k], independent, "valid")
                    for k in range(3)
                ],
                axis=1,
            )
            beside = _read_at(record, place - first)
        return self._with_mean(time, sensor), self._with_mean(time, beside)

    def _with_mean(self, time: FloatArray, fluctuation: FloatArray) -> FloatArray:
        spec = self._spec
        speed, heading = spec.mean_wind(time)
        along = speed + fluctuation[:, 0]
        cosine, sine = np.cos(heading), np.sin(heading)
        return np.stack(
            (
                along * cosine - fluctuation[:, 1] * sine,
                along * sine + fluctuation[:, 1] * cosine,
                spec.mean_vertical + fluctuation[:, 2],
            ),
            axis=-1,
        )


class MeasuredWind:
    """A wind that was measured, blowing again.

    Args:
        winds: Earth wind over time.
        start: Time that becomes t = 0 [ns]; None: the first sample.

    Raises:
        UserError: There are fewer than two samples.
    """

    def __init__(self, winds: Winds, start: int | None = None) -> None:
        usable = np.isfinite(winds.velocity).all(axis=1)
        stamps, first = np.unique(winds.time[usable], return_index=True)
        if stamps.size < 2:
            raise UserError(
                "A wind needs at least two samples.", "wind", "Give a longer recording."
            )
        begin = int(stamps[0]) if start is None else start
        self._time = (stamps - begin).astype(np.float64) * 1e-9
        self._velocity = winds.velocity[usable][first]

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self._time[-1])

    def mean_at(self, time: FloatArray) -> FloatArray:
        """Mean of the whole record, shape (n, 3)."""
        return np.tile(self._velocity.mean(axis=0), (time.shape[0], 1))

    def along(self, time: FloatArray, travelled: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `WindSource.along`; the path does not matter, the wind was measured on it."""
        wind = np.stack(
            [np.interp(time, self._time, self._velocity[:, k]) for k in range(3)], axis=1
        )
        return wind, wind


def _read_at(record: FloatArray, place: FloatArray) -> FloatArray:
    """A record at places between its samples, by the cubic through four neighbours.

    Args:
        record: Shape (m, 3).
        place: Position in samples, 1 to m - 3 at most, shape (n,).
    """
    left = np.floor(place).astype(np.int64)
    u = (place - left)[:, np.newaxis]
    if not np.any(u):
        return record[left]
    before = -u * (u - 1.0) * (u - 2.0) / 6.0
    here = (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0
    after = -(u + 1.0) * u * (u - 2.0) / 2.0
    beyond = (u + 1.0) * u * (u - 1.0) / 6.0
    value: FloatArray = (
        before * record[left - 1]
        + here * record[left]
        + after * record[left + 1]
        + beyond * record[left + 2]
    )
    return value
