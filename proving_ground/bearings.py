"""Friction that sticks: static, Stribeck, Coulomb and viscous torque of a bearing."""

from __future__ import annotations

import math

from wind_sensors.compiled import compiled


@compiled
def stribeck_torque(
    rate: float, static: float, coulomb: float, viscous: float, stribeck_rate: float
) -> float:
    """Magnitude of the friction torque [N m] of a turning bearing at |rate| [rad/s]."""
    fall = math.exp(-((rate / stribeck_rate) ** 2))
    return coulomb + (static - coulomb) * fall + viscous * abs(rate)


@compiled
def advance(
    rate: float, drive: float, friction: float, breakaway: float, inertia: float, step: float
) -> float:
    """Rate [rad/s] one step [s] later under a drive torque and a friction that can hold it still.

    drive, friction, breakaway in [N m]; inertia [kg m^2].
    """
    if rate == 0.0:
        if abs(drive) <= breakaway:
            return 0.0
        return (drive - math.copysign(friction, drive)) / inertia * step
    free = rate + drive / inertia * step
    loss = friction / inertia * step
    if abs(free) <= loss:
        return 0.0
    slowed = free - math.copysign(loss, rate)
    if slowed * rate < 0.0 and abs(drive) <= breakaway:
        return 0.0
    return slowed
