"""The instruments and turbulences of the Monte Carlo table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wind_sensors.instruments import rotor_family
from wind_sensors.instruments.dynamics.rotor import (
    CUP_EQUIVALENT,
    CUP_KRISTENSEN_1994,
    PROPELLER_JACKSON,
    PROPELLER_KRISTENSEN_1994,
    RotorParameters,
)

ROTOR_REMAINDER = 0.6
"""Fourth-order remainder allowed for rotors, in units of I^2 (largest seen: 0.38)."""
VANE_REMAINDER = 2.0
"""The same for propeller-vanes (largest seen: 1.1) and for the vector run."""
VARIANCE_REMAINDER = 1.0
"""The same for a variance in units of sigma_u^2 (largest seen: 0.65, in proportion to I^2)."""
STEEP_RESPONSE_REMAINDER = 1.0
"""The same for K14's angular response where it is far from flat (largest seen: 0.63)."""


@dataclass(frozen=True)
class Case:
    """One instrument in one turbulence.

    Attributes:
        name: For people.
        intensity: I = sigma/U of every component that is present [1].
        rotor: Constants of the rotor.
        q: Wavenumber of the von Karman spectra, in units of 1/l0 or 1/l_v.
        present: Which of u, v, w fluctuate.
        correlation: <uw>/(sigma_u sigma_w); w then has the spectrum of u.
        damping_ratio: Of the vane, if there is one.
        vane_length: l_v in the unit of length.
        arm: Distance of the propeller from the vane's axis.
        instrument: "rotor", "vector" (cup and vane), "linear" (propeller on a linear vane) or
            "nonlinear" (propeller on the vane's full equation).
        variance: Judge the variance of the rate over sigma_u^2 instead of the bias of the mean.
        remainder: Fourth-order remainder allowed, in units of I^2.
    """

    name: str
    intensity: float
    rotor: RotorParameters
    q: float = 0.5
    present: tuple[bool, bool, bool] = (True, True, True)
    correlation: float = 0.0
    damping_ratio: float = 0.0
    vane_length: float = 1.0
    arm: float = 0.0
    instrument: str = "rotor"
    variance: bool = False
    remainder: float = ROTOR_REMAINDER


def rotor(
    form: int, a4: float, mu1: float = 0.0, mu2: float = 0.0, stall_speed: float = 0.0
) -> RotorParameters:
    """A healthy rotor with unit distance constant and unit calibration distance."""
    return RotorParameters(
        form=form,
        calibration_distance=1.0,
        starting_speed=0.0,
        distance_constant=1.0,
        a4=a4,
        mu1=mu1,
        mu2=mu2,
        angular_response=np.cos(np.radians(np.arange(181.0))),
        calibration_gain=1.0,
        calibration_offset=0.0,
        friction=stall_speed**2,
        friction_temperature_coefficient=0.0,
        reference_temperature=0.0,
        inertia_factor=1.0,
        torque_harmonic=0.0,
        torque_harmonic_phase=0.0,
        breakaway=1.0,
    )


def standard_cases() -> tuple[Case, ...]:
    """The cases of the table: every kind of bias formula, three intensities where it matters."""
    axial = (True, False, False)
    plain = rotor(CUP_EQUIVALENT, 1.0)
    cases = [Case("cup a4 = 1", i, plain) for i in (0.05, 0.1, 0.2)]
    third = rotor_family.torque_share(1.0, 0.3)
    cases += [
        Case("cup Lambda/l = 0.3", i, rotor(CUP_KRISTENSEN_1994, third)) for i in (0.05, 0.1, 0.2)
    ]
    cases += [
        Case("cup Lambda/l = 1, mu2 = 1", 0.1, rotor(CUP_KRISTENSEN_1994, 0.5, 0.0, 1.0)),
        Case(
            "cup Lambda/l = 0.3, mu1 = 0.1, mu2 = 0.8",
            0.1,
            rotor(CUP_KRISTENSEN_1994, third, 0.1, 0.8),
        ),
        Case("cup a4 = 1, mu1 = 0.3, mu2 = -0.5", 0.1, rotor(CUP_KRISTENSEN_1994, 1.0, 0.3, -0.5)),
        Case(
            "the same, angular response of K14",
            0.1,
            rotor(CUP_EQUIVALENT, 1.0, 0.3, -0.5),
            remainder=STEEP_RESPONSE_REMAINDER,
        ),
        Case(
            "cup, u and w correlated (-0.4), mu1 = 0.2",
            0.05,
            rotor(CUP_EQUIVALENT, 1.0, 0.2),
            present=(True, False, True),
            correlation=-0.4,
        ),
    ]
    cases += [
        Case("K94 propeller, axial", i, rotor(PROPELLER_KRISTENSEN_1994, 0.0), present=axial)
        for i in (0.05, 0.2)
    ]
    stalled = rotor(PROPELLER_JACKSON, 1.0, stall_speed=0.3)
    cases += [
        Case("J80 propeller, axial", 0.1, rotor(PROPELLER_JACKSON, 1.0), present=axial),
        Case("J80 propeller, U_s/U = 0.3", 0.05, stalled, present=axial),
    ]
    cases += [
        Case(
            "J80 propeller, U_s/U = 0.3, variance",
            i,
            stalled,
            present=axial,
            variance=True,
            remainder=VARIANCE_REMAINDER,
        )
        for i in (0.05, 0.1)
    ]
    gill = rotor(PROPELLER_KRISTENSEN_1994, 0.0, 0.0, -0.7)
    carried = rotor(PROPELLER_KRISTENSEN_1994, 1.0, 0.0, -0.7)

    def carried_case(name: str, i: float, blades: RotorParameters, kind: str) -> Case:
        return Case(
            name,
            i,
            blades,
            q=0.3,
            damping_ratio=0.6,
            arm=0.35,
            instrument=kind,
            remainder=VANE_REMAINDER,
        )

    cases += [
        carried_case("propeller-vane, linear vane", 0.05, gill, "linear"),
        carried_case("propeller-vane, linear vane", 0.1, gill, "linear"),
        carried_case("propeller-vane, nonlinear vane", 0.05, gill, "nonlinear"),
        carried_case("propeller-vane, a4 = 1 rotor", 0.05, carried, "linear"),
        Case(
            "cup and vane, vector run",
            0.05,
            rotor(CUP_KRISTENSEN_1994, third, 0.0, 0.8),
            q=0.3,
            damping_ratio=0.6,
            instrument="vector",
            remainder=VANE_REMAINDER,
        ),
    ]
    return tuple(cases)
