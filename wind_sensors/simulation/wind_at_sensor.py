"""From the earth wind to the wind in an instrument's own axes, with what the site does to it.

The order is the physical one: motion of the mount, downwash, sensor axes, wakes, flow around the
mount, lean of the axis.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.instruments.dynamics.wake import wake_factor
from wind_sensors.motion import relative_wind, rotations
from wind_sensors.motion.downwash import rotor_downwash
from wind_sensors.motion.platform_errors import true_motion
from wind_sensors.motion.platform_track import Motion
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.memory import DriveMemory
from wind_sensors.station.model import (
    Angle,
    Downwash,
    FlowDistortion,
    Instrument,
    Platform,
    Station,
)

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Flow:
    """What an instrument feels, in its own axes (z along the axis of cup or vane).

    Attributes:
        wind: Wind against the mount [m/s], shape (n, 3).
        turning: Angular rate of the mount [rad/s], shape (n, 3).
        gravity: Gravity minus the mount's acceleration [m/s^2], shape (n, 3); zero for instruments
            in balance.
    """

    wind: FloatArray
    turning: FloatArray
    gravity: FloatArray


@compiled
def _scale_by_fourier(
    wind: FloatArray, c_1: float, s_1: float, c_2: float, s_2: float, deflection: float
) -> None:
    for i in range(wind.shape[0]):
        x, y = -wind[i, 0], -wind[i, 1]
        h = np.hypot(x, y)
        if h > 0.0:
            c, s = x / h, y / h
            cc, ss = c * c - s * s, 2.0 * c * s
            factor = 1.0 + c_1 * c + s_1 * s + c_2 * cc + s_2 * ss
            for k in range(3):
                wind[i, k] *= factor
            if deflection != 0.0:
                turn = -deflection * (c_1 * s - s_1 * c + c_2 * ss - s_2 * cc)
                ct, st = np.cos(turn), np.sin(turn)
                u, v = wind[i, 0], wind[i, 1]
                wind[i, 0], wind[i, 1] = ct * u - st * v, st * u + ct * v


@compiled
def _scale_by_wake(
    wind: FloatArray, centre: float, depth: float, width: float, flank: float
) -> None:
    for i in range(wind.shape[0]):
        away = np.arctan2(-wind[i, 1], -wind[i, 0]) - centre
        factor = wake_factor(away, depth, width, flank)
        for k in range(3):
            wind[i, k] *= factor


def _weighs(instrument: Instrument) -> bool:
    """Whether gravity turns an instrument."""
    return isinstance(instrument, Angle) and instrument.imbalance != 0.0


class WindAtSensors:
    """The flow at each instrument of a station in one drive; nothing is computed twice.

    Args:
        station: The station, without changes.
        drive: What drives it.
        memory: What is known of other stations in the drive; None: nothing.
        part: First and last instant of the drive within that of the memory.
    """

    def __init__(
        self,
        station: Station,
        drive: Drive,
        memory: DriveMemory | None = None,
        part: tuple[int, int] = (0, 0),
    ) -> None:
        self._station = station
        self._drive = drive
        self._memory = DriveMemory(drive) if memory is None else memory
        self._carrier = (part, station.platform)
        self._platform: Platform | None = None
        if drive.motion is not None:
            self._platform = station.platform or Platform()
            self._rotation = relative_wind.sensor_rotation(self._platform)
        else:
            heading = np.radians(station.sensor_heading_deg)
            self._rotation = rotations.matrix(rotations.from_roll_pitch_yaw(0.0, 0.0, heading))

    @property
    def _motion(self) -> Motion | None:
        """What the mount does in truth; None on a mast."""
        reported, platform = self._drive.motion, self._platform
        if reported is None or platform is None or self._drive.motion_is_true:
            return reported
        return self._memory.flows.of(
            ("motion", self._carrier),
            lambda: true_motion(platform, reported, self._drive.dt, self._drive.elapsed),
        )

    def flow(self, instrument: Instrument, lean: tuple[float, float] = (0.0, 0.0)) -> Flow:
        """The flow at an instrument.

        Args:
            instrument: One of the station's.
            lean: Tilt of what carries the instrument [deg], added to its own.
        """
        tilt = (instrument.tilt_deg[0] + lean[0], instrument.tilt_deg[1] + lean[1])
        return self._memory.flows.of(
            self.key(instrument, lean),
            lambda: self._computed(instrument, tilt, _weighs(instrument)),
        )

    def key(self, instrument: Instrument, lean: tuple[float, float] = (0.0, 0.0)) -> Hashable:
        """What the flow at an instrument depends on."""
        tilt = (instrument.tilt_deg[0] + lean[0], instrument.tilt_deg[1] + lean[1])
        own = (instrument.position, instrument.wake_shadows, instrument.flow_distortion)
        heading = self._station.sensor_heading_deg
        return self._carrier, heading, own, tilt, _weighs(instrument)

    def _lever_arm(self, position: tuple[float, float, float]) -> FloatArray:
        """The instrument's place in platform axes [m]."""
        assert self._platform is not None
        arm: FloatArray = np.asarray(self._platform.sensor_position) + self._rotation @ position
        return arm

    def _in_platform_axes(self, position: tuple[float, float, float]) -> FloatArray:
        """Wind against the mount in platform axes; on a mast these are ENU."""
        motion, platform = self._motion, self._platform
        if motion is None or platform is None:
            return self._drive.wind
        return self._memory.flows.of(
            ("felt", self._carrier, position),
            lambda: self._felt(motion, platform, position),
        )

    def _felt(
        self, motion: Motion, platform: Platform, position: tuple[float, float, float]
    ) -> FloatArray:
        """Wind against a moving mount in platform axes [m/s], shape (n, 3)."""
        felt: FloatArray = np.einsum("nji,nj->ni", motion.to_earth, self._drive.wind)
        if platform.velocity_share != 0.0:
            moving = relative_wind.sensor_velocity(motion, self._lever_arm(position))
            felt = felt - platform.velocity_share * moving
        if platform.downwash != Downwash():
            felt = felt + rotor_downwash(platform.downwash, felt)
        return felt

    def _computed(self, instrument: Instrument, tilt: tuple[float, float], weighs: bool) -> Flow:
        wind = self._in_platform_axes(instrument.position)
        to_platform = self._rotation
        in_sensor = wind @ to_platform
        for wake in instrument.wake_shadows:
            centre, width = np.radians((wake.bearing_from_deg, wake.width_deg))
            _scale_by_wake(in_sensor, float(centre), wake.depth, float(width), wake.flank)
        distortion = instrument.flow_distortion
        if distortion != FlowDistortion():
            _scale_by_fourier(
                in_sensor, distortion.cosine_1, distortion.sine_1, distortion.cosine_2,
                distortion.sine_2, distortion.deflection,
            )
        count = wind.shape[0]
        turning = np.zeros((count, 3))
        gravity = np.zeros((count, 3))
        motion = self._motion
        if motion is not None:
            turning = motion.angular_rate @ to_platform
        if weighs:
            gravity = self._gravity(instrument, count) @ to_platform
        if tilt != (0.0, 0.0):
            lean = relative_wind.axis_rotation(tilt)
            in_sensor, turning, gravity = in_sensor @ lean, turning @ lean, gravity @ lean
        return Flow(in_sensor, turning, gravity)

    def _gravity(self, instrument: Instrument, count: int) -> FloatArray:
        """Gravity minus the instrument's acceleration in platform axes [m/s^2], shape (n, 3)."""
        motion = self._motion
        if motion is None:
            return np.tile((0.0, 0.0, -relative_wind.STANDARD_GRAVITY), (count, 1))
        arm = self._lever_arm(instrument.position)
        return relative_wind.felt_gravity(motion, arm, self._drive.dt)
