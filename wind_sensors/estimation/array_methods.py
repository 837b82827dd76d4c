"""Methods without a filter for propellers on fixed axes; Jackson (undated, c. 1980), sec. 4."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.array_equation import FamilyEquation
from wind_sensors.estimation.circumstances import CircumstanceSource, with_mount_covariance
from wind_sensors.estimation.constants import array_axes, fixed_propellers_of
from wind_sensors.estimation.core import (
    Estimates,
    SmallScales,
    no_estimates,
    not_known,
    output_times,
)
from wind_sensors.estimation.forward import AIR_DENSITY, AIR_TEMPERATURE, MOUNT_ROTATION
from wind_sensors.estimation.history import RotorTrack
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.inverse import GAUSSIAN_WIDTH, rotor_motion
from wind_sensors.estimation.outputs import HealthItem, HealthLevel
from wind_sensors.estimation.scale_follower import ScaleFollower
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.instruments.dynamics.rotor import bearing_friction
from wind_sensors.instruments.propeller_array import ArrayEstimate, solve, uncorrected_velocity
from wind_sensors.station.model import Propeller, Station
from wind_sensors.station.parameters import rotor_parameters

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_REACH = 4.0
"""The fit looks this many widths to each side."""
_EDGE_DEVIATION = 0.01
"""Usual scatter of an edge [slots]."""
_RELATIVE_DEVIATION = 0.1
_LEAST_DEVIATION = 0.1
"""Nobody states an uncertainty of a naive reading: a tenth of the speed, at least 0.1 m/s."""


def array_estimates(
    times: TimeArray, apparent: FloatArray, variance: FloatArray, rows: FloatArray
) -> Estimates:
    """Estimates from winds in the sensor frame.

    Args:
        times: [ns], shape (n,).
        apparent: [m/s], shape (n, 3).
        variance: Of every component [m^2/s^2], shape (n,).
        rows: Circumstances, shape (n, 23).
    """
    to_earth = rows[:, MOUNT_ROTATION : MOUNT_ROTATION + 9].reshape(-1, 3, 3)
    velocity = np.einsum("nij,nj->ni", to_earth, apparent) + rows[:, :3]
    covariance = variance[:, np.newaxis, np.newaxis] * np.eye(3)
    return Estimates(
        times, velocity, with_mount_covariance(covariance, velocity, rows), apparent, covariance,
        to_earth, not_known(times.size),
    )


class _ArrayCore:
    """What both methods share: the propellers' edges and their axes."""

    def __init__(
        self,
        station: Station,
        settings: EstimatorSettings,
        origin: int,
        seconds: float,
        restored: bool,
    ) -> None:
        self._settings = settings
        self._propellers = fixed_propellers_of(station)
        self._axes = array_axes(self._propellers)
        self._tracks = [
            RotorTrack(p.name, station, origin, restored) for p in self._propellers
        ]
        self._source = CircumstanceSource(station, settings.use_air)
        self._keep = round(seconds * 1e9)

    def _take(self, block: Block) -> None:
        self._source.take(block)
        for track in self._tracks:
            track.take(block.pulses[track.rotor.name])
            track.forget_before(block.stop - self._keep)


class NaiveArrayCore(_ArrayCore):
    """Calibration and cosine response only.

    Args:
        station: The station.
        settings: Settings.
        origin: Start of the recording [ns].
    """

    def __init__(self, station: Station, settings: EstimatorSettings, origin: int) -> None:
        super().__init__(station, settings, origin, 2.0, restored=False)

    def process(self, block: Block) -> Estimates:
        """Take a block; its estimates."""
        self._take(block)
        times = output_times(block.start, block.stop, self._settings.output_rate)
        shown = np.stack([track.latest_speed(times) for track in self._tracks], axis=1)
        apparent = uncorrected_velocity(self._axes, shown)
        speed = np.linalg.norm(apparent, axis=1)
        variance = np.square(_RELATIVE_DEVIATION * speed + _LEAST_DEVIATION)
        return array_estimates(times, apparent, variance, self._source.at(times, np.zeros(3)))

    def finish(self) -> Estimates:
        """Nothing remains."""
        return no_estimates()

    def small_scales(self) -> SmallScales | None:
        """Not known."""
        return None

    def health(self) -> list[HealthItem]:
        """Nothing to say."""
        return []


class InverseArrayCore(_ArrayCore):
    """The propellers' equations of motion solved for the wind vector, each with its own constants.

    Args:
        station: The station.
        settings: Settings; `bandwidth` is the half-power frequency of the local fits.
        origin: Start of the recording [ns].
    """

    def __init__(self, station: Station, settings: EstimatorSettings, origin: int) -> None:
        width = GAUSSIAN_WIDTH / settings.bandwidth
        super().__init__(station, settings, origin, 4.0 * _REACH * width + 4.0, restored=True)
        self._equations = [FamilyEquation(rotor_parameters(p)) for p in self._propellers]
        self._width = width
        self._reach = round(_REACH * width * 1e9)
        self._scales = ScaleFollower(settings)
        self._next = 0
        self._stop = 0
        self._solved = 0
        self._flags = np.zeros(5, dtype=np.int64)

    def process(self, block: Block) -> Estimates:
        """Take a block; estimates whose fit needs no later message."""
        self._take(block)
        self._next = self._next or block.start
        self._stop = block.stop
        return self._until(block.stop - self._reach)

    def finish(self) -> Estimates:
        """The remaining estimates, fitted from one side."""
        return self._until(self._stop)

    def _until(self, stop: int) -> Estimates:
        if stop <= self._next:
            return no_estimates()
        times = output_times(self._next, stop, self._settings.output_rate)
        self._next = stop
        rows = self._source.at(times, np.zeros(3))
        stop_ns = round(self._settings.stop_time * 1e9)
        shown = np.zeros((times.size, len(self._tracks)))
        torque = np.zeros_like(shown)
        noise = np.zeros(times.size)
        for i, track in enumerate(self._tracks):
            rotor = track.rotor
            assert isinstance(rotor, Propeller)
            p = self._equations[i].p
            slot = 2.0 * np.pi / rotor.pulses_per_revolution
            for k, time in enumerate(times.tolist()):
                turned = rotor_motion(track, time, self._width, self._stop, stop_ns)
                y = p.calibration_distance * turned[1]
                push = p.distance_constant * p.inertia_factor * p.calibration_distance * turned[2]
                density = rows[k, AIR_DENSITY] / rotor.reference_density
                friction = bearing_friction(p, y, rows[k, AIR_TEMPERATURE])
                shown[k, i] = y
                torque[k, i] = (push + friction * np.sign(y)) / density
                noise[k] += turned[4] * (p.calibration_distance * slot * _EDGE_DEVIATION) ** 2
        found = solve(self._axes, self._equations, shown, torque)
        self._count(found)
        variance = noise / len(self._tracks) + 4.0 / 3.0 * self._scales.unresolved * (
            self._scales.level()
        )
        estimates = array_estimates(times, found.velocity, variance, rows)
        self._scales.follow(estimates.velocity)
        return estimates

    def _count(self, found: ArrayEstimate) -> None:
        self._solved += int(found.converged.size)
        self._flags += [
            int(np.count_nonzero(~found.converged)),
            int(np.count_nonzero(found.interference.any(axis=1))),
            int(np.count_nonzero(found.near_plane.any(axis=1))),
            int(np.count_nonzero(found.ambiguous.any(axis=1))),
            int(np.count_nonzero(found.noisy.any(axis=1))),
        ]

    def small_scales(self) -> SmallScales | None:
        """From the structure function."""
        return self._scales.small_scales()

    def health(self) -> list[HealthItem]:
        """Item `array`: how often the solution is in doubt, and why."""
        names = (
            "not converged", "in another's wake (beyond 135 deg)", "near a plane of rotation",
            "two possible roots", "noise beyond any wind",
        )
        total = max(self._solved, 1)
        values = {
            name: f"{100.0 * count / total:.1f} %"
            for name, count in zip(names, self._flags.tolist(), strict=True)
        }
        lost, behind = (int(v) for v in self._flags[:2])
        if lost or behind > 0.02 * total:
            worst = "did not converge" if lost > behind else "saw one propeller in another's wake"
            text = f"{math.ceil(100.0 * max(lost, behind) / total)} % of the solutions {worst}."
            return [HealthItem("array", HealthLevel.WARN, text, values)]
        return [HealthItem("array", HealthLevel.OK, "The solutions converge.", values)]
