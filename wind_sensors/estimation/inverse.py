"""The inverse method: the instruments' equations solved for the wind.

The turned angle of the rotor and the heading of the vane are fitted locally by parabolas with
Gaussian weights, which gives value, rate and acceleration in a stated bandwidth; the equations of
motion (`instruments.dynamics`) then give the wind that makes them. Sources: Jackson (c. 1980),
(10), for the rotor; Mitsuta (1966), (5), for the vane, with sin for large deviations.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.circumstances import CircumstanceSource
from wind_sensors.estimation.core import Estimates, SmallScales, no_estimates, output_times
from wind_sensors.estimation.forward import (
    AIR_DENSITY,
    AIR_TEMPERATURE,
    MOUNT_PITCH_RATE,
    MOUNT_ROLL_RATE,
    MOUNT_YAW_RATE,
)
from wind_sensors.estimation.history import History, NoseTrack, RotorTrack
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.naive import earth_estimates
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.instruments.dynamics.rotor import (
    PROPELLER_JACKSON,
    RotorParameters,
    table_at,
    torque_slope_ratio,
)
from wind_sensors.instruments.dynamics.vane import VaneParameters
from wind_sensors.station.model import Station
from wind_sensors.station.parameters import rotor_parameters, vane_parameters

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

GAUSSIAN_WIDTH = math.sqrt(math.log(2.0)) / (2.0 * math.pi)
"""Standard deviation in time of a Gaussian filter times its half-power frequency."""
_REACH = 4.0
"""The fit looks this many widths to each side."""
_FEWEST = 5
"""A fit reaches as far as it must to have so many points."""
_VARIANCE_ABOVE = 0.1096
"""Variance above f of an inertial range with D(t) = level t^(2/3) is this level f^(-2/3)."""
_EDGE_DEVIATION = 0.01
"""Usual scatter of an edge [slots]."""
_READING_DEVIATION = math.radians(0.3)


@compiled
def local_parabola(
    time: TimeArray, value: FloatArray, at: int, width: float
) -> tuple[float, float, float, float, float]:
    """Weighted parabola through samples around an instant.

    Args:
        time: [ns], increasing, shape (n,), n >= 3.
        value: Shape (n,).
        at: The instant [ns].
        width: Standard deviation of the weights [s].

    Returns:
        Value, first and second derivative at the instant, and the variances of value and first
        derivative for samples of unit variance.
    """
    n = time.shape[0]
    first = np.searchsorted(time, at - int(4.0e9 * width))
    last = np.searchsorted(time, at + int(4.0e9 * width))
    while last - first < min(_FEWEST, n):
        if first > 0 and (last >= n or at - time[first - 1] < time[last] - at):
            first -= 1
        else:
            last += 1
    span = max(abs(time[first] - at), abs(time[last - 1] - at)) * 1e-9
    scale = max(width, 0.5 * span if last - first <= _FEWEST else 0.0, 1e-6)
    base = value[first]
    m = np.zeros(5)
    r = np.zeros(3)
    q = np.zeros(5)
    for i in range(first, last):
        x = (time[i] - at) * 1e-9 / scale
        w = math.exp(-0.5 * x * x)
        p = w
        for k in range(5):
            m[k] += p
            q[k] += p * w
            if k < 3:
                r[k] += p * (value[i] - base)
            p *= x
    a = np.empty((3, 3))
    b = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a[i, j] = m[i + j]
            b[i, j] = q[i + j]
        a[i, i] += 1e-9 * m[0]
    inverse = np.linalg.inv(a)
    c = inverse @ r
    spread = inverse @ b @ inverse
    return (
        c[0] + base,
        c[1] / scale,
        2.0 * c[2] / (scale * scale),
        spread[0, 0],
        spread[1, 1] / (scale * scale),
    )


@compiled
def forcing_from_motion(
    p: RotorParameters,
    y: float,
    y_rate: float,
    angle: float,
    density_ratio: float,
    temperature: float,
) -> float:
    """Horizontal wind speed [m/s] that gives a rotor y = l s and its rate of change.

    Args:
        p: Constants.
        y: [m/s].
        y_rate: [m/s^2].
        angle: Between wind and rotor axis [rad], for a propeller.
        density_ratio: Air density relative to the calibration's.
        temperature: [deg C].
    """
    friction = p.friction * (
        1.0 + p.friction_temperature_coefficient * (temperature - p.reference_temperature)
    )
    push = (p.distance_constant * p.inertia_factor * y_rate + max(friction, 0.0)) / density_ratio
    if p.form == PROPELLER_JACKSON:
        f = max(table_at(p.angular_response, angle), 0.2)
        g = max(torque_slope_ratio(angle), 0.2)
        root = max(y * y * g * g + 4.0 * f * g * push, 0.0)
        forcing = (y * g + math.sqrt(root)) / (2.0 * g)
        return max(forcing / f, 0.0) / p.calibration_gain
    if p.a4 > 0.05:
        b = (1.0 - 2.0 * p.a4) * y
        root = max(b * b + 4.0 * p.a4 * ((1.0 - p.a4) * y * y + push), 0.0)
        forcing = (-b + math.sqrt(root)) / (2.0 * p.a4)
    else:
        forcing = y + push / max(y, 0.1)
    return max((forcing + p.starting_speed - p.calibration_offset) / p.calibration_gain, 0.0)


@compiled
def wind_heading_from_motion(
    p: VaneParameters,
    phi: float,
    rate: float,
    acceleration: float,
    speed: float,
    yaw_rate: float,
    density_ratio: float,
) -> float:
    """Heading the wind comes from [rad] that gives a vane its motion; see `vane_acceleration`."""
    omega = max(speed, 0.3) / p.distance_constant
    stiffness = density_ratio / p.inertia_factor
    damping = 2.0 * p.damping_ratio * p.damping_factor * stiffness * omega * (rate + yaw_rate)
    deviation = -(acceleration + damping) / (stiffness * omega * omega)
    return phi - p.aerodynamic_offset - math.asin(min(max(deviation, -1.0), 1.0))


def rotor_motion(
    track: RotorTrack, time: int, width: float, heard_until: int, stop_ns: int
) -> tuple[float, float, float, float, float]:
    """`local_parabola` of a rotor's turned angle; one that has stopped does not move.

    Args:
        track: Its edges.
        time: The instant [ns].
        width: Standard deviation of the weights [s].
        heard_until: Time up to which an edge would be known [ns].
        stop_ns: A rotor without an edge for this long has stopped [ns].
    """
    edges = track.time
    if edges.size < 3:
        return 0.0, 0.0, 0.0, 1.0, 1.0
    after = int(np.searchsorted(edges, time))
    since = time - edges[after - 1] if after > 0 else 0
    until = edges[after] - time if after < edges.size else heard_until - time
    if since + until > stop_ns:
        return 0.0, 0.0, 0.0, 1.0, 1.0
    return local_parabola(edges, track.angle, time, width)


class ScaleFollower:
    """Inertial range from the structure function of the estimates at one period of the bandwidth.

    Args:
        settings: `bandwidth`, `output_rate`, `adaptation_time`.
    """

    def __init__(self, settings: EstimatorSettings) -> None:
        self._settings = settings
        self._structure = np.zeros(2)
        self._recent: list[FloatArray] = []

    @property
    def unresolved(self) -> float:
        """Variance of a component above the bandwidth, for level 1."""
        return float(_VARIANCE_ABOVE * self._settings.bandwidth ** (-2.0 / 3.0))

    def follow(self, velocity: FloatArray) -> None:
        """Take new estimates [m/s], shape (n, 3)."""
        lag = max(round(self._settings.output_rate / self._settings.bandwidth), 1)
        self._recent.append(velocity[:, :2])
        joined = np.concatenate(self._recent)
        if joined.shape[0] > lag:
            steps = np.square(joined[lag:] - joined[:-lag]).mean()
            share = velocity.shape[0] / self._settings.output_rate / self._settings.adaptation_time
            keep = max(1.0 - share, 0.0)
            self._structure[0] = keep * self._structure[0] + share * steps
            self._structure[1] = keep * self._structure[1] + share
        self._recent = [joined[-lag:]]

    def level(self) -> float:
        """D(t) = level t^(2/3), the loss above the bandwidth allowed for."""
        if self._structure[1] <= 0.0:
            return 0.5
        seen = self._structure[0] / self._structure[1]
        lag = 1.0 / self._settings.bandwidth
        return float(seen / (lag ** (2.0 / 3.0) * (1.0 - 2.0 * _VARIANCE_ABOVE)))

    def small_scales(self) -> SmallScales | None:
        """The level of both components; None before there were estimates."""
        if self._structure[1] <= 0.0:
            return None
        level = self.level()
        return SmallScales(level, level)


class InverseCore:
    """The instruments' equations solved for the wind.

    Args:
        station: The station.
        settings: Settings; `bandwidth` is the half-power frequency of the local fits.
        origin: Start of the recording [ns].
    """

    def __init__(self, station: Station, settings: EstimatorSettings, origin: int) -> None:
        self._settings = settings
        self._width = GAUSSIAN_WIDTH / settings.bandwidth
        self._reach = round(_REACH * self._width * 1e9)
        self._history = History(station, origin, 4.0 * _REACH * self._width + 4.0)
        self._source = CircumstanceSource(station, settings.use_air)
        self._rotor = rotor_parameters(self._history.rotor)
        self._vane = vane_parameters(self._history.vane)
        self._fixed = getattr(self._history.rotor, "mounted_on", "") == ""
        self._next = 0
        self._stop = 0
        self._scales = ScaleFollower(settings)

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
        rows = self._source.at(times, np.zeros(3))
        n = times.size
        speed, heading = np.empty(n), np.empty(n)
        along, across = np.empty(n), np.empty(n)
        missing = self._scales.unresolved
        level = self._scales.level()
        slot = 2.0 * np.pi / h.rotor.pulses_per_revolution
        stop_ns = round(self._settings.stop_time * 1e9)
        for k in range(n):
            row = rows[k]
            turned = rotor_motion(h.edges, int(times[k]), self._width, self._stop, stop_ns)
            nose = local_parabola(h.nose.time, h.nose.angle, int(times[k]), self._width)
            y = max(turned[1] * self._rotor.calibration_distance, 0.0)
            y_rate = turned[2] * self._rotor.calibration_distance
            density = row[AIR_DENSITY] / h.rotor.reference_density
            vane_density = row[AIR_DENSITY] / h.vane.reference_density
            about = forcing_from_motion(self._rotor, y, y_rate, 0.0, density, row[AIR_TEMPERATURE])
            comes_from = wind_heading_from_motion(
                self._vane, nose[0], nose[1], nose[2], about, row[MOUNT_YAW_RATE], vane_density
            )
            angle = 0.0 if self._fixed else abs(comes_from - nose[0])
            speed[k] = forcing_from_motion(
                self._rotor, y, y_rate, angle, density, row[AIR_TEMPERATURE]
            )
            heading[k] = comes_from
            noise = turned[4] * (self._rotor.calibration_distance * slot * _EDGE_DEVIATION) ** 2
            along[k] = noise + level * missing
            across[k] = nose[3] * (speed[k] * _READING_DEVIATION) ** 2 + 4 / 3 * level * missing
        lift, vertical = None, np.full(n, level * 3.0)
        if h.elevation is not None and h.elevation.time.size >= 3:
            lift, vertical = self._lift(h.elevation, times, rows, speed, heading), across
        estimates = earth_estimates(times, speed, heading, along, across, vertical, rows, lift)
        self._scales.follow(estimates.velocity)
        return estimates

    def _lift(
        self,
        elevation: NoseTrack,
        times: TimeArray,
        rows: FloatArray,
        speed: FloatArray,
        heading: FloatArray,
    ) -> FloatArray:
        """Vertical wind [m/s] from the elevation of a bivane, shape (n,)."""
        out = np.empty(times.size)
        for k in range(times.size):
            row = rows[k]
            lift = local_parabola(elevation.time, elevation.angle, int(times[k]), self._width)
            pitching = row[MOUNT_PITCH_RATE] * math.cos(heading[k])
            pitching -= row[MOUNT_ROLL_RATE] * math.sin(heading[k])
            rises = wind_heading_from_motion(
                self._vane, lift[0], lift[1], lift[2], speed[k] / math.cos(lift[0]), pitching,
                row[AIR_DENSITY] / self._history.vane.reference_density,
            )  # fmt: skip
            out[k] = speed[k] * math.tan(rises)
        return out

    def small_scales(self) -> SmallScales | None:
        """From the structure function."""
        return self._scales.small_scales()

    def health(self) -> list[HealthItem]:
        """Nothing to say."""
        return []
