"""Wind in the axes of a rotor: along the shaft, and across it in the plane of rotation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.instruments.dynamics.rotor_record import cup_axes
from wind_sensors.instruments.dynamics.vane import propeller_vane_axes
from wind_sensors.simulation.wind_at_sensor import Flow, WindAtSensors
from wind_sensors.station.model import Cup, Propeller, Station

FloatArray = npt.NDArray[np.float64]


def wind_in_rotor_axes(
    station: Station,
    rotor: Cup | Propeller,
    winds: WindAtSensors,
    carrier: tuple[FloatArray, FloatArray] | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axial and transverse wind of a rotor [m/s] and the transverse wind's direction [rad].

    Args:
        station: The rotor's.
        rotor: A cup, or a propeller on a vane or on an axis of its own.
        winds: What is felt where the instruments stand.
        carrier: Heading [rad] and its rate [rad/s] of the vane that carries a propeller, shape
            (n,) each; None: nothing does.

    Returns:
        Shape (n,) each, as `instruments.dynamics.rotor.rotor_forcing` takes them.

    Raises:
        UserError: A propeller has neither.
    """
    if isinstance(rotor, Cup):
        return cup_axes(winds.flow(rotor).wind)
    if carrier is not None:
        flow = winds.flow(rotor, station.instrument(rotor.mounted_on).tilt_deg)
        phi, rate = carrier
        return propeller_vane_axes(
            flow.wind, phi, rate + flow.turning[:, 2], rotor.distance_to_vane_axis
        )
    return _fixed_axes(rotor, winds.flow(rotor))


def _fixed_axes(propeller: Propeller, flow: Flow) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Wind in the axes of a propeller that does not turn with the wind."""
    if propeller.axis is None:
        raise UserError(
            f"The propeller '{propeller.name}' has neither `mounted_on` nor `axis`.",
            f"instruments.{propeller.name}",
            "Name the vane that carries it, or give its axis as a unit vector in the sensor frame.",
        )
    axis = np.asarray(propeller.axis, dtype=np.float64)
    axis = axis / np.linalg.norm(axis)
    helper = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    across, up = flow.wind @ first, flow.wind @ np.cross(axis, first)
    return flow.wind @ axis, np.hypot(across, up), np.arctan2(up, across)
