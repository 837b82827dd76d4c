"""Schrenk's rotor of two cups that push and brake; K14 (2) to (7) and what follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class SchrenkRotor:
    """Two opposed cups on an arm.

    Attributes:
        arm_radius: r [m].
        driving: K+ = r A rho C+/(2 I) [1/m^2], the concave side.
        braking: K- [1/m^2], smaller than K+.
    """

    arm_radius: float
    driving: float
    braking: float

    def angular_acceleration(self, speed: float, rate: float) -> float:
        """dS/dt = K+ (U - r S)^2 - K- (U + r S)^2 [rad/s^2] for r S < U; K14 (2), (3)."""
        tip = self.arm_radius * rate
        return self.driving * (speed - tip) ** 2 - self.braking * (speed + tip) ** 2

    @property
    def factor(self) -> float:
        """f = l/r = (sqrt K+ + sqrt K-)/(sqrt K+ - sqrt K-) [1]; K14 (7)."""
        return (math.sqrt(self.driving) + math.sqrt(self.braking)) ** 2 / (
            self.driving - self.braking
        )

    @property
    def calibration_distance(self) -> float:
        """l = f r [m/rad]."""
        return self.factor * self.arm_radius

    @property
    def second_length(self) -> float:
        """Lambda = -r/f [m]: negative, against K94's Lambda >= 0 (derived)."""
        return -self.arm_radius / self.factor

    @property
    def distance_constant(self) -> float:
        """l0 = 1/(4 r sqrt(K+ K-)) [m] (derived)."""
        return 0.25 / (self.arm_radius * math.sqrt(self.driving * self.braking))

    @property
    def a4(self) -> float:
        """f^2/(f^2 - 1) [1], above one (derived)."""
        return self.factor**2 / (self.factor**2 - 1.0)


def drive_coefficient(
    arm_radius: float, cup_area: float, density: float, drag: float, inertia: float
) -> float:
    """K = r A rho C/(2 I) [1/m^2]; K14 (2).

    Args:
        arm_radius: r [m].
        cup_area: A [m^2].
        density: rho [kg/m^3].
        drag: C+ or C- [1].
        inertia: I [kg m^2].
    """
    return arm_radius * cup_area * density * drag / (2.0 * inertia)
