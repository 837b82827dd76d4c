"""The inverse method: the instruments' equations solved for the wind.

The turned angle of the rotor and the heading of the vane are fitted locally by parabolas with
Gaussian weights, which gives value, rate and acceleration in a stated bandwidth; the equations of
motion (`instruments.dynamics`) then give the wind that makes them, and what gusts above the
bandwidth add to it is taken off (`unresolved`). Sources: Jackson (c. 1980),
(10), for the rotor; Mitsuta (1966), (5), for the vane, with sin for large deviations.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.circumstances import CircumstanceSource
from wind_sensors.estimation.constants import instruments_of, measures_vertical, rotors_of
from wind_sensors.estimation.core import (
    Estimates,
    SmallScales,
    joined,
    no_estimates,
    output_times,
)
from wind_sensors.estimation.history import History, NoseTrack, RotorTrack
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.inverse_kernel import local_parabola, wind_from_motion
from wind_sensors.estimation.naive import earth_estimates
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.scale_follower import ScaleFollower
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.site import with_site_covariance
from wind_sensors.estimation.timeline import Timeline
from wind_sensors.estimation.turbulence_process import neutral_vertical_variance
from wind_sensors.estimation.unresolved import excess_speed
from wind_sensors.station.model import Downwash, Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

GAUSSIAN_WIDTH = math.sqrt(math.log(2.0)) / (2.0 * math.pi)
"""Standard deviation in time of a Gaussian filter times its half-power frequency."""
_REACH = 4.0
"""The fit looks this many widths to each side."""
_EDGE_DEVIATION = 0.01
"""Usual scatter of an edge [slots]."""
_READING_DEVIATION = math.radians(0.3)
_REPEATED = 20.0
"""Readings inside a potentiometer's gap repeat one another: so many count as one."""
_ROUNDS = 6
"""Of a multirotor's inflow and the wind."""
_STRUCTURE_ACROSS = 4.0 / 3.0
_NO_LIFT = (0.0, 0.0, 0.0)

Motion = tuple[float, float, float, float, float, float]


def rotor_motion(
    track: RotorTrack, time: int, width: float, heard_until: int, stop_ns: int
) -> Motion:
    """`local_parabola` of a rotor's turned angle; one that has stopped does not move.

    Args:
        track: Its edges.
        time: The instant [ns].
        width: Standard deviation of the weights [s].
        heard_until: Time up to which an edge would be known [ns].
        stop_ns: A rotor without an edge for this long has stopped [ns], unless an outage is known.
    """
    edges = track.time
    if edges.size < 3:
        return 0.0, 0.0, 0.0, 1.0, 1.0, 0.0
    after = int(np.searchsorted(edges, time))
    since = time - edges[after - 1] if after > 0 else 0
    until = edges[after] - time if after < edges.size else heard_until - time
    if since + until > stop_ns and not track.is_silenced(time):
        return 0.0, 0.0, 0.0, 1.0, 1.0, 0.0
    return local_parabola(edges, track.angle, np.empty(0), time, width)


def _nose_motion(track: NoseTrack, time: int, width: float) -> Motion:
    unsharp = _REPEATED * np.square(track.half_width) / 3.0 / _READING_DEVIATION**2
    return local_parabola(
        track.time, track.angle, unsharp if unsharp.any() else np.empty(0), time, width
    )


class InverseCore:
    """The instruments' equations solved for the wind.

    Args:
        station: The station with its changes.
        settings: Settings; `bandwidth` is the half-power frequency of the local fits.
        origin: Start of the recording [ns].
    """

    def __init__(self, station: Station, settings: EstimatorSettings, origin: int) -> None:
        self._settings = settings
        self._width = GAUSSIAN_WIDTH / settings.bandwidth
        self._reach = round(_REACH * self._width * 1e9)
        self._timeline = Timeline(station, origin)
        silent = max((o.stop - o.start for i in station.instruments for o in i.outages), default=0)
        self._history = History(station, origin, 4.0 * _REACH * self._width + 4.0 + silent)
        self._instruments = [instruments_of(s) for s in self._timeline.stations]
        self._vertical_is_measured = measures_vertical(station)
        self._source = CircumstanceSource(self._timeline.stations[0], settings.use_air)
        self._next = 0
        self._stop = 0
        self._scales = ScaleFollower(settings)
        self._wind = np.zeros(3)

    def process(self, block: Block) -> Estimates:
        """Take a block; estimates whose fit needs no later message."""
        self._source.take(block)
        self._history.take(block)
        self._history.forget_before(block.stop)
        self._next = self._next or block.start
        self._stop = block.stop
        return self._until(block.stop - self._reach)

    def finish(self) -> Estimates:
        """The remaining estimates, fitted from one side."""
        return self._until(self._stop)

    def _until(self, stop: int) -> Estimates:
        h = self._history
        if stop <= self._next or h.nose.time.size < 3 or h.edges.time.size < 3:
            return no_estimates()
        times = output_times(self._next, stop, self._settings.output_rate)
        self._next = stop
        estimates = joined(
            [self._under(number, times[here]) for number, here in self._timeline.parts(times)]
        )
        if estimates.time.size:
            self._scales.follow(estimates.velocity)
        return estimates

    def _under(self, number: int, times: TimeArray) -> Estimates:
        """Estimates while one set of constants holds."""
        station = self._timeline.stations[number]
        self._source.station = station
        estimates = self._solved(number, times)
        platform = station.platform
        if platform is not None and platform.downwash != Downwash():
            # The inflow depends on the wind that it disturbs.
            for _ in range(_ROUNDS):
                self._wind = 0.5 * (self._wind + estimates.velocity.mean(axis=0))
                estimates = self._solved(number, times)
        return with_site_covariance(station, estimates)

    def _solved(self, number: int, times: TimeArray) -> Estimates:
        h = self._history
        rows = self._source.at(times, self._wind)
        n = times.size
        wind = np.empty((n, 3))
        along, across, upwards = np.empty(n), np.empty(n), np.empty(n)
        missing = self._scales.unresolved
        level = self._scales.level()
        slot = 2.0 * np.pi / h.rotor.pulses_per_revolution
        stop_ns = round(self._settings.stop_time * 1e9)
        length = h.rotor.calibration_distance
        for k, time in enumerate(times.tolist()):
            turned = rotor_motion(h.edges, time, self._width, self._stop, stop_ns)
            nose = _nose_motion(h.nose, time, self._width)
            lift = None
            if h.elevation is not None and h.elevation.time.size >= 3:
                lift = _nose_motion(h.elevation, time, self._width)
            wind[k] = wind_from_motion(
                self._instruments[number], (0, h.nose_number),
                (max(turned[1] * length, 0.0), turned[2] * length), nose[:3],
                _NO_LIFT if lift is None else lift[:3], lift is not None, rows[k],
            )
            size2 = float(wind[k, 0] ** 2 + wind[k, 1] ** 2)
            away, aside = (level * gap ** (2.0 / 3.0) for gap in (turned[5], nose[5]))
            along[k] = turned[4] * (length * slot * _EDGE_DEVIATION) ** 2 + level * missing + away
            seen = nose[3] * _READING_DEVIATION**2 * size2
            across[k] = seen + _STRUCTURE_ACROSS * (level * missing + aside)
            upwards[k] = np.nan if lift is None else across[k]
        speed = np.hypot(wind[:, 0], wind[:, 1])
        inferred = self._inferred_vertical_variance(number, speed)
        upwards[np.isnan(upwards)] = inferred
        unseen = 0.0 if self._vertical_is_measured else inferred
        speed = speed - self._excess(number, speed, unseen)
        heading = np.arctan2(-wind[:, 1], -wind[:, 0])
        return earth_estimates(times, speed, heading, along, across, upwards, rows, wind[:, 2])

    def _inferred_vertical_variance(self, number: int, speed: FloatArray) -> float:
        """That of a neutral surface layer with the cross-wind's small scales [m^2/s^2]."""
        height = self._timeline.stations[number].recording.measuring_height
        mean = float(speed.mean()) if speed.size else 0.0
        across = _STRUCTURE_ACROSS * self._scales.level()
        return across * neutral_vertical_variance(height, mean)

    def _excess(self, number: int, speed: FloatArray, vertical: float) -> FloatArray:
        """What gusts that the fits smooth away have added to the speed [m/s], shape (n,)."""
        scales = self._scales.small_scales()
        if scales is None:
            return np.zeros_like(speed)
        rotor = rotors_of(self._timeline.stations[number])[0]
        return excess_speed(rotor, scales, self._settings.bandwidth, vertical, speed)

    def small_scales(self) -> SmallScales | None:
        """From the structure function."""
        return self._scales.small_scales()

    def health(self) -> list[HealthItem]:
        """Nothing to say."""
        return []
