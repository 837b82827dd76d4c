"""What fixed propellers cannot tell: which root, whose wake, how close to their plane.

Jackson's inversion (undated report, c. 1980, (10)) has two roots X with the sum P omega. A filter
follows one of them by continuity; which one holds cannot be known where they lie within the
estimate's own uncertainty of each other and turn the propeller the same way. Only the propeller
that meets most of the wind matters: it decides the speed, and with the speed known the equations
of the others have one root. Beyond 3 pi/4 one propeller stands in another's wake and f(theta) no
longer holds. Close to its plane of rotation friction and blade-to-blade differences decide what a
propeller shows.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import array_axes, fixed_propellers_of, rotors_of
from wind_sensors.estimation.core import Estimates
from wind_sensors.estimation.outputs import HealthItem, HealthLevel
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.instruments.propeller_array import (
    INTERFERENCE_ANGLE,
    PLANE_MARGIN,
    wind_angles,
)
from wind_sensors.station.model import Station
from wind_sensors.station.parameters import rotor_parameters

FloatArray = npt.NDArray[np.float64]

_CLOSE = 3.0
"""Roots within so many standard deviations of the axial wind cannot be told apart."""
_TURNING = 0.1
"""Slower propellers are close to a stall, where the roots differ by next to nothing [m/s]."""
_WAKE_SHARE = 0.02
_ROOT_SHARE = 0.02
_PLANE_SHARE = 0.5


class PropellerWatch:
    """Keeps the shares of recent estimates that are in doubt, propeller by propeller.

    Args:
        station: The station, without changes.
        settings: `adaptation_time` is the memory, `output_rate` the rate of the estimates.
    """

    def __init__(self, station: Station, settings: EstimatorSettings) -> None:
        self._propellers = fixed_propellers_of(station)
        names = [r.name for r in rotors_of(station)]
        self._places = [names.index(p.name) for p in self._propellers]
        self._axes = array_axes(self._propellers)
        self._tables = [rotor_parameters(p).angular_response for p in self._propellers]
        self._forget = 1.0 / (settings.adaptation_time * settings.output_rate)
        self._seen = 0.0
        self._shares = np.zeros((len(self._propellers), 3))

    def take(self, estimates: Estimates, rotor_speeds: FloatArray) -> None:
        """New estimates.

        Args:
            estimates: In order of time, n of them.
            rotor_speeds: y = l s of all rotors at those instants [m/s], shape (n, rotors).
        """
        n = estimates.time.size
        if not self._propellers or n == 0:
            return
        angles = wind_angles(self._axes, estimates.apparent)
        speed = np.linalg.norm(estimates.apparent, axis=1)
        spread = np.sqrt(
            np.einsum("mi,nij,mj->nm", self._axes, estimates.apparent_covariance, self._axes)
        )
        keep = (1.0 - self._forget) ** n
        self._seen = keep * self._seen + (1.0 - keep)
        leading = np.argmax(np.abs(np.cos(angles)), axis=1)
        for k, place in enumerate(self._places):
            y = rotor_speeds[:, place]
            axial = speed * np.interp(
                np.degrees(angles[:, k]), np.arange(self._tables[k].size), self._tables[k]
            )
            same_sense = axial * (y - axial) > 0.0
            close = np.abs(2.0 * axial - y) < _CLOSE * spread[:, k]
            doubtful = (
                same_sense & close & (np.abs(y) > _TURNING) & (leading == k),
                angles[:, k] > INTERFERENCE_ANGLE,
                np.abs(angles[:, k] - 0.5 * np.pi) < PLANE_MARGIN,
            )
            for j, flags in enumerate(doubtful):
                share = float(np.mean(flags))
                self._shares[k, j] = keep * self._shares[k, j] + (1.0 - keep) * share

    def health(self, told_by_edges: list[bool]) -> list[HealthItem]:
        """Item `<propeller> angle` of each fixed propeller.

        Args:
            told_by_edges: By rotor: its signal does not tell the sense of rotation.
        """
        items = []
        for k, propeller in enumerate(self._propellers):
            root, wake, plane = self._shares[k] / max(self._seen, 1e-9)
            values = {
                "which root is unknown": f"{100.0 * root:.1f} %",
                "beyond 135 deg": f"{100.0 * wake:.1f} %",
                "within 5 deg of its plane": f"{100.0 * plane:.1f} %",
                "sense of rotation": "forward, assumed" if told_by_edges[self._places[k]]
                else "measured",
            }
            level, text = _judged(root, wake, plane, told_by_edges[self._places[k]])
            items.append(HealthItem(f"{propeller.name} angle", level, text, values))
        return items


def _judged(root: float, wake: float, plane: float, by_edges: bool) -> tuple[HealthLevel, str]:
    if wake > _WAKE_SHARE:
        return (
            HealthLevel.WARN,
            f"For {100.0 * wake:.0f} % of the time the wind comes from behind, beyond 135 deg: "
            "other propellers' wakes are not in the equations.",
        )
    if root > _ROOT_SHARE:
        return (
            HealthLevel.WARN,
            f"For {100.0 * root:.0f} % of the time two winds fit its motion and neither can be "
            "excluded.",
        )
    if plane > _PLANE_SHARE:
        return (
            HealthLevel.WARN,
            f"For {100.0 * plane:.0f} % of the time the wind blows within 5 deg of its plane: "
            "friction and its unknown response there limit this component.",
        )
    if by_edges:
        return (
            HealthLevel.WARN,
            "Edges do not tell the sense of rotation; it is taken as forward.",
        )
    return HealthLevel.OK, "The wind meets it where its response is known."
