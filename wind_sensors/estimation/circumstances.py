"""Motion of the mount and state of the air at the instants of the events."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation import forward
from wind_sensors.estimation.intake import Block, Series
from wind_sensors.motion import Motion, PlatformTrack, TrackLimits, rotations, true_motion
from wind_sensors.motion.downwash import rotor_downwash
from wind_sensors.motion.relative_wind import sensor_rotation, sensor_velocity
from wind_sensors.station.model import (
    STANDARD_DENSITY,
    Clock,
    Downwash,
    Platform,
    Rotor,
    Station,
)
from wind_sensors.station.signals import PlatformStates, Velocities

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

GAS_CONSTANT_DRY_AIR = 287.05
"""[J kg^-1 K^-1]"""
STANDARD_PRESSURE = 101_325.0
"""[Pa]"""
STANDARD_GRAVITY = 9.80665
"""[m/s^2]"""
_KEPT_STATES = 50


def as_calibrated(station: Station) -> Station:
    """The station in air of which every instrument's calibration holds, whatever its density."""
    return station.model_copy(update={"instruments": tuple(
        i.model_copy(update={"reference_density": STANDARD_DENSITY}) for i in station.instruments
    )})


class _Latest:
    """The latest messages of an input.

    Args:
        width: Numbers in a message.

    Attributes:
        time: [ns], shape (n,).
        value: Shape (n, width).
    """

    def __init__(self, width: int) -> None:
        self.time: TimeArray = np.empty(0, dtype=np.int64)
        self.value: FloatArray = np.empty((0, width))

    def take(self, new: Series) -> None:
        """Messages of a block, some of which may have been looked at ahead of it."""
        if new.time.size:
            old = self.time < new.time[0]
            kept = _KEPT_STATES + new.time.size
            self.time = np.concatenate((self.time[old], new.time))[-kept:]
            self.value = np.concatenate((self.value[old], new.value))[-kept:]


class CircumstanceSource:
    """Remembers the latest platform states and air, and reads them at any instant of a block.

    Args:
        station: The station, without changes.
        use_air: Use measured temperature and pressure, else the standard density (`as_calibrated`
            makes it that of every calibration) and the first rotor's reference temperature.
    """

    def __init__(self, station: Station, use_air: bool) -> None:
        self._use_air = use_air
        self._states = _Latest(13)
        platform = station.platform
        self._velocities = _Latest(3) if platform is not None and platform.moves_apart else None
        self._temperature = np.nan
        self._pressure = np.nan
        self.station = station
        # Without a thermometer friction is that of the calibration.
        self._usual_temperature = next(
            (i.reference_temperature for i in station.instruments if isinstance(i, Rotor)), np.nan
        )
        heading = float(np.radians(station.sensor_heading_deg))
        turn = rotations.matrix(rotations.from_roll_pitch_yaw(0.0, 0.0, heading))
        self._mast_rotation: FloatArray = turn.ravel()

    @property
    def known(self) -> bool:
        """Whether the carrier has been heard of, if there is one."""
        if self.station.platform is None:
            return True
        moves = self._velocities is None or self._velocities.time.size > 0
        return moves and self._states.time.size > 0

    def take(self, block: Block) -> None:
        """Remember what a block says about mount and air."""
        if block.temperature.time.size:
            self._temperature = float(block.temperature.value[-1, 0])
        if block.pressure.time.size:
            self._pressure = float(block.pressure.value[-1, 0])
        self._states.take(block.platform)
        if self._velocities is not None:
            self._velocities.take(block.velocity)

    def _air(self, rows: FloatArray) -> None:
        rows[:, forward.AIR_TEMPERATURE] = self._usual_temperature
        rows[:, forward.AIR_DENSITY] = STANDARD_DENSITY
        if self._use_air and np.isfinite(self._temperature):
            rows[:, forward.AIR_TEMPERATURE] = self._temperature
            pressure = self._pressure if np.isfinite(self._pressure) else STANDARD_PRESSURE
            kelvin = self._temperature + 273.15
            rows[:, forward.AIR_DENSITY] = pressure / (GAS_CONSTANT_DRY_AIR * kelvin)

    def at(self, times: TimeArray, wind: FloatArray) -> FloatArray:
        """Circumstances at the times of events.

        Args:
            times: [ns], shape (n,).
            wind: Latest estimate of the wind, ENU [m/s], shape (3,); only a multirotor's downwash
                needs it.

        Returns:
            Shape (n, 23), see `forward`.
        """
        rows = np.zeros((times.size, forward.CIRCUMSTANCES))
        self._air(rows)
        platform = self.station.platform
        if platform is None:
            rows[:, 3:12] = self._mast_rotation
            rows[:, forward.MOUNT_GRAVITY_Z] = -STANDARD_GRAVITY
        elif self.known and times.size:
            self._moving(rows, times, platform, wind)
        else:
            rows[:, 3:12] = np.eye(3).ravel()
            rows[:, forward.VELOCITY_VARIANCE] = np.inf
        return rows

    def _moving(
        self, rows: FloatArray, times: TimeArray, platform: Platform, wind: FloatArray
    ) -> None:
        states, apart = self._states.value, self._velocities
        track = PlatformTrack(
            PlatformStates(
                time=self._states.time,
                attitude=states[:, 0:4],
                velocity=states[:, 4:7],
                angular_rate=states[:, 7:10],
                position=states[:, 10:13],
            ),
            TrackLimits(
                attitude_deviation=float(np.radians(platform.attitude_noise_deg)),
                velocity_deviation=platform.velocity_noise,
            ),
            with_travel=platform.position_share != 0.0,
            velocities=None if apart is None else Velocities(apart.time, apart.value),
        )
        sample = track.at(times)
        motion = true_motion(replace_clock(platform), sample.motion, 1.0)
        rotation = sensor_rotation(platform)
        arm = self._lever_arm(platform, rotation)
        moving = platform.velocity_share * sensor_velocity(motion, arm)
        if platform.downwash != Downwash():
            felt = np.einsum("nji,j->ni", motion.to_earth, wind) - moving
            moving = moving - rotor_downwash(platform.downwash, felt)
        rows[:, 0:3] = np.einsum("nij,nj->ni", motion.to_earth, moving)
        rows[:, 3:12] = np.einsum("nij,jk->nik", motion.to_earth, rotation).reshape(-1, 9)
        turning = motion.angular_rate @ rotation
        rows[:, forward.MOUNT_ROLL_RATE] = turning[:, 0]
        rows[:, forward.MOUNT_PITCH_RATE] = turning[:, 1]
        rows[:, forward.MOUNT_YAW_RATE] = turning[:, 2]
        if any(getattr(i, "imbalance", 0.0) for i in self.station.instruments):
            felt_gravity = self._gravity(track, platform, arm, rotation, times)
            rows[:, forward.MOUNT_GRAVITY_X] = felt_gravity[:, 0]
            rows[:, forward.MOUNT_GRAVITY_Y] = felt_gravity[:, 1]
            rows[:, forward.MOUNT_GRAVITY_Z] = felt_gravity[:, 2]
        mounting = np.radians(platform.mounting_noise_deg) ** 2
        swinging = np.radians(platform.angular_rate_noise_deg) ** 2 * float(arm @ arm) * 2.0 / 3.0
        rows[:, forward.VELOCITY_VARIANCE] = np.where(
            sample.known, sample.velocity_variance + swinging, np.inf
        )
        rows[:, forward.MOUNTING_VARIANCE] = mounting
        if platform.velocity_axes == "earth":
            # A velocity measured in the earth frame does not turn with the attitude's error.
            rows[:, forward.MOUNTING_VARIANCE] += sample.attitude_variance
        else:
            rows[:, forward.ATTITUDE_VARIANCE] = sample.attitude_variance

    def _lever_arm(self, platform: Platform, rotation: FloatArray) -> FloatArray:
        """The first instrument's place in platform axes [m]; the others stand close to it."""
        place = np.asarray(self.station.instruments[0].position)
        arm: FloatArray = np.asarray(platform.sensor_position) + rotation @ place
        return arm

    def _gravity(
        self,
        track: PlatformTrack,
        platform: Platform,
        arm: FloatArray,
        rotation: FloatArray,
        times: TimeArray,
    ) -> FloatArray:
        """Gravity minus the sensor's acceleration in sensor axes [m/s^2], shape (n, 3)."""
        half = 20_000_000

        def earth_velocity(at: TimeArray) -> tuple[FloatArray, Motion]:
            motion = true_motion(replace_clock(platform), track.at(at).motion, 1.0)
            return np.einsum("nij,nj->ni", motion.to_earth, sensor_velocity(motion, arm)), motion

        before, _ = earth_velocity(times - half)
        after, _ = earth_velocity(times + half)
        _, motion = earth_velocity(times)
        force = -(after - before) / (2.0 * half * 1e-9)
        force[:, 2] -= STANDARD_GRAVITY
        felt: FloatArray = np.einsum("nji,nj->ni", motion.to_earth, force) @ rotation
        return felt


def replace_clock(platform: Platform) -> Platform:
    """The platform with a true clock: the intake has already corrected the stamps."""
    if platform.clock == Clock():
        return platform
    return platform.model_copy(update={"clock": Clock()})


def with_mount_covariance(
    covariance: FloatArray, wind: FloatArray, rows: FloatArray
) -> FloatArray:
    """Add what attitude, velocity and mounting contribute to the earth wind's covariance.

    The earth wind is R (apparent + velocity). With both vectors measured on the platform a small
    rotation of R turns it as a whole; the mounting, and the attitude where the velocity comes in
    earth axes, turn the apparent wind alone.

    Args:
        covariance: [m^2/s^2], shape (n, 3, 3).
        wind: ENU [m/s], shape (n, 3).
        rows: Circumstances, shape (n, 23).

    Returns:
        Shape (n, 3, 3); nan where the mount's motion is not known.
    """
    velocity = rows[:, forward.VELOCITY_VARIANCE]
    known = np.isfinite(velocity)
    total = covariance + np.where(known, velocity, 0.0)[:, np.newaxis, np.newaxis] * np.eye(3)
    for vector, column in (
        (wind, forward.ATTITUDE_VARIANCE),
        (wind - rows[:, :3], forward.MOUNTING_VARIANCE),
    ):
        size2 = np.einsum("ni,ni->n", vector, vector)[:, np.newaxis, np.newaxis]
        outer = vector[:, :, np.newaxis] * vector[:, np.newaxis, :]
        total = total + rows[:, column][:, np.newaxis, np.newaxis] * (size2 * np.eye(3) - outer)
    total[~known] = np.nan
    return total
