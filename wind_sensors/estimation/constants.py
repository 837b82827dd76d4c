"""From a station to the constant arrays of the filter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.forward import CUP, FIXED_AXIS, ON_VANE, Instruments
from wind_sensors.instruments.dynamics.vane import VaneParameters
from wind_sensors.motion.relative_wind import axis_rotation
from wind_sensors.station.model import Bivane, Cup, Instrument, Propeller, Rotor, Station, Vane
from wind_sensors.station.parameters import rotor_parameters, vane_parameters

FloatArray = npt.NDArray[np.float64]


def rotors_of(station: Station) -> tuple[Cup | Propeller, ...]:
    """Rotors in the station's order."""
    return tuple(i for i in station.instruments if isinstance(i, (Cup, Propeller)))


def vanes_of(station: Station) -> tuple[Vane, ...]:
    """Vanes in the station's order."""
    return tuple(i for i in station.instruments if isinstance(i, Vane))


class NoseAxis(NamedTuple):
    """An axis about which a vane or bivane turns, with a signal of its own.

    Attributes:
        name: Of the signal: `<vane>`, `<bivane>` (azimuth), `<bivane>/elevation`.
        instrument: The vane or bivane.
        azimuth: For an elevation the index of the azimuth that turns it; -1 for an azimuth.
    """

    name: str
    instrument: Vane | Bivane
    azimuth: int


def axes_of(station: Station) -> tuple[NoseAxis, ...]:
    """Axes of all vanes, then of all bivanes, in the station's order."""
    axes = [NoseAxis(v.name, v, -1) for v in vanes_of(station)]
    for bivane in station.instruments:
        if isinstance(bivane, Bivane):
            axes.append(NoseAxis(bivane.name, bivane, -1))
            axes.append(NoseAxis(f"{bivane.name}/elevation", bivane, len(axes) - 1))
    return tuple(axes)


def counted_pair(station: Station) -> tuple[Cup | Propeller, NoseAxis]:
    """The rotor whose run is counted and the nose that tells its direction.

    They are the first rotor, and the vane that carries it or else the first one.

    Args:
        station: With a vane or bivane.
    """
    rotor, axes = rotors_of(station)[0], axes_of(station)
    carried_by = getattr(rotor, "mounted_on", "")
    return rotor, next((a for a in axes if a.name == carried_by), axes[0])


def told_by(station: Station, method: str) -> tuple[str, ...]:
    """Names of the instruments whose signals a method takes for the wind."""
    if method == "kalman":
        every = (*rotors_of(station), *(a.instrument for a in axes_of(station)))
    elif is_array(station):
        every = fixed_propellers_of(station)
    else:
        rotor, nose = counted_pair(station)
        every = (rotor, nose.instrument)
    return tuple(dict.fromkeys(i.name for i in every))


def fixed_propellers_of(station: Station) -> tuple[Propeller, ...]:
    """Propellers that do not turn with the wind."""
    return tuple(
        i for i in station.instruments if isinstance(i, Propeller) and not i.mounted_on
    )


def array_axes(propellers: tuple[Propeller, ...]) -> FloatArray:
    """Unit vectors of fixed propellers in the sensor frame, shape (propellers, 3)."""
    given = [p.axis if p.axis is not None else (1.0, 0.0, 0.0) for p in propellers]
    axes = np.array(given, dtype=np.float64).reshape(len(propellers), 3)
    out: FloatArray = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return out


def is_array(station: Station) -> bool:
    """Whether fixed propellers alone must tell the wind: nothing points into it."""
    axes = array_axes(fixed_propellers_of(station))
    spanned = bool(axes.size) and int(np.linalg.matrix_rank(axes[:, :2], tol=0.05)) == 2
    return not axes_of(station) and spanned


def measures_vertical(station: Station) -> bool:
    """Whether the station's signals tell the vertical wind."""
    if any(isinstance(i, Bivane) for i in station.instruments):
        return True
    axes = array_axes(fixed_propellers_of(station))
    return bool(axes.size) and int(np.linalg.matrix_rank(axes, tol=0.05)) == 3


def _mounting(rotor: Rotor, vanes: tuple[Vane, ...]) -> list[float]:
    if isinstance(rotor, Propeller) and rotor.mounted_on:
        carrier = [v.name for v in vanes].index(rotor.mounted_on)
        row = [ON_VANE, carrier, rotor.distance_to_vane_axis, 0.0, 0.0, 0.0]
    elif isinstance(rotor, Propeller):
        row = [FIXED_AXIS, 0, 0.0, *array_axes((rotor,))[0]]
    else:
        row = [CUP, 0, 0.0, 0.0, 0.0, 0.0]
    return [float(v) for v in (*row, rotor.reference_density)]


def instruments_of(station: Station) -> Instruments:
    """Constant arrays of all rotors and nose axes of a station (without changes)."""
    rotors, vanes, axes = rotors_of(station), vanes_of(station), axes_of(station)
    every: tuple[Instrument, ...] = (*rotors, *(a.instrument for a in axes))
    count = len(every)
    most = max([len(i.wake_shadows) for i in every], default=0)
    shadow = np.zeros((count, max(most, 1), 4))
    shadow[:, :, 2] = 1.0
    distortion = np.zeros((count, 5))
    lean = np.zeros((count, 3, 3))
    plain = np.zeros(count, dtype=np.int64)
    for k, instrument in enumerate(every):
        for j, wake in enumerate(instrument.wake_shadows):
            centre, width = np.radians((wake.bearing_from_deg, wake.width_deg))
            shadow[k, j] = centre, wake.depth, width, wake.flank
        d = instrument.flow_distortion
        distortion[k] = d.cosine_1, d.sine_1, d.cosine_2, d.sine_2, d.deflection
        tilt = instrument.tilt_deg
        if isinstance(instrument, Propeller) and instrument.mounted_on:
            carrier = next(v for v in vanes if v.name == instrument.mounted_on)
            tilt = (tilt[0] + carrier.tilt_deg[0], tilt[1] + carrier.tilt_deg[1])
        lean[k] = axis_rotation(tilt)
        plain[k] = int(
            not instrument.wake_shadows and not np.any(distortion[k]) and tilt == (0.0, 0.0)
        )
    rotor_rows = np.zeros((len(rotors), 16))
    tables = np.ones((len(rotors), 181))
    mounting = np.zeros((len(rotors), 7))
    for k, rotor in enumerate(rotors):
        p = rotor_parameters(rotor)
        rotor_rows[k] = [v for name, v in p._asdict().items() if name != "angular_response"]
        tables[k] = p.angular_response
        mounting[k] = _mounting(rotor, vanes)
    return Instruments(
        rotor=rotor_rows,
        response=tables,
        mounting=mounting,
        vane=np.array([list(vane_parameters(a.instrument)) for a in axes]).reshape(
            len(axes), len(VaneParameters._fields)
        ),
        vane_density=np.array([a.instrument.reference_density for a in axes], dtype=np.float64),
        azimuth=np.array([a.azimuth for a in axes], dtype=np.int64),
        shadow=shadow,
        distortion=distortion,
        lean=lean,
        plain=plain,
    )
