"""One fixed propeller's equation of motion, solved for the wind along its axis.

    (A - y) [a4 B + (1 - a4) y] + E = P,   P = (l0 I dy/dt + F sgn y)/rho

as in `instruments.dynamics.rotor`, with A = G U f(theta) + o and B = U g(theta)/g(0) in Jackson's
form (undated report, c. 1980, (5)), A = G U cos(theta) + o, B = |A| and
E = mu2 (U sin(theta))^2/2 in that of Kristensen (1994), (30); G and o are gain and offset of the
calibration. At a given direction both are quadratic in the axial wind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.dynamics.rotor import (
    PROPELLER_KRISTENSEN_1994,
    RESPONSE_TABLE_SIZE,
    RotorParameters,
)
from wind_sensors.instruments.friction_propeller import AxialInversion, torque_slope_ratio
from wind_sensors.instruments.propeller_array import cosine_over_response

FloatArray = npt.NDArray[np.float64]

_FLAT = 1e-6
"""With a smaller a4 the equation is linear in the axial wind."""


@dataclass(frozen=True)
class FamilyEquation:
    """A propeller of the rotor family as `propeller_array.solve` takes it.

    `indicated` is y = l s [m/s], `indicated_rate` is P [m^2/s^2].

    Attributes:
        p: Constants, in one of the propellers' forms.
    """

    p: RotorParameters

    def component(
        self, indicated: FloatArray, indicated_rate: FloatArray, speed: FloatArray,
        angle: FloatArray,
    ) -> AxialInversion:
        """U cos(theta) [m/s]; with the slope's a4 = 1 both roots of Jackson (10)."""
        p, y = self.p, indicated
        free = (y - p.calibration_offset) / p.calibration_gain
        if p.form == PROPELLER_KRISTENSEN_1994:
            lift = 0.5 * p.mu2 * np.square(speed * np.sin(angle))
            constant = p.a4 * p.calibration_offset + (1.0 - p.a4) * y
            ratio = np.full_like(y, 1.0 / p.calibration_gain)
            to_axis = np.ones_like(y)
        else:
            lift = np.zeros_like(y)
            constant = (1.0 - p.a4) * y
            ratio = self._response(angle) / torque_slope_ratio(angle)
            to_axis = cosine_over_response(angle, self._response)
        push = (indicated_rate - lift) / p.calibration_gain
        # (x - free) (a4 x/ratio + constant) = push for x = U f(theta), or U cos(theta).
        if abs(p.a4) < _FLAT:
            turning = np.where(constant != 0.0, constant, np.inf)
            value = to_axis * (free + push / turning)
            told = np.zeros(y.shape, dtype=bool)
            return AxialInversion(value, value, told, told)
        ratio = ratio / p.a4
        own = free + ratio * constant
        bracket = own * own + 4.0 * ratio * push
        half = 0.5 * np.where(own != 0.0, np.sign(own), np.sign(push)) * np.sqrt(np.abs(bracket))
        middle = 0.5 * (free - ratio * constant)
        value, other = to_axis * (middle + half), to_axis * (middle - half)
        return AxialInversion(value, other, value * other > 0.0, bracket < 0.0)

    def residual(
        self, indicated: FloatArray, indicated_rate: FloatArray, speed: FloatArray,
        angle: FloatArray,
    ) -> FloatArray:
        """The equation at a trial wind, left side minus right [m^2/s^2]."""
        p = self.p
        lift = np.zeros_like(indicated)
        if p.form == PROPELLER_KRISTENSEN_1994:
            forcing = p.calibration_gain * speed * np.cos(angle) + p.calibration_offset
            slope = np.abs(forcing)
            lift = 0.5 * p.mu2 * np.square(speed * np.sin(angle))
        else:
            forcing = p.calibration_gain * speed * self._response(angle) + p.calibration_offset
            slope = speed * torque_slope_ratio(angle)
        torque = (forcing - indicated) * (p.a4 * slope + (1.0 - p.a4) * indicated) + lift
        return np.asarray(torque - indicated_rate)

    def _response(self, angle: npt.ArrayLike) -> FloatArray:
        place = np.asarray(angle, dtype=np.float64) * (180.0 / math.pi)
        degrees = np.arange(RESPONSE_TABLE_SIZE, dtype=np.float64)
        return np.asarray(np.interp(place, degrees, self.p.angular_response))
