"""The bias formulas against the nonlinear equations of motion in synthetic turbulence.

Lengths are in units of the distance constant (of the rotor, or of the vane where there is one),
speeds in units of the mean wind, biases in units of the turbulence intensity squared. Every
realisation is a periodic record of random modes below a band limit that the integration resolves;
it is run together with its mirror image, so that odd orders cancel. The formula is also evaluated
with the realised modes: simulation minus that is free of most of the sampling noise, and what is
left must be of fourth order, a bound times I^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments import vane
from wind_sensors.instruments.dynamics.rotor import (
    PROPELLER_JACKSON,
    PROPELLER_KRISTENSEN_1994,
    RotorParameters,
)
from wind_sensors.instruments.dynamics.rotor_record import integrate_cup
from wind_sensors.instruments.dynamics.vane import VaneParameters, integrate_propeller_vane
from wind_sensors.instruments.propeller_vane import bias_weight, relative_wind
from wind_sensors.report.monte_carlo_cases import Case, standard_cases
from wind_sensors.turbulence import von_karman
from wind_sensors.turbulence.modes import draw_modes, modal_variances, sum_modes

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

SAMPLES = 2**15
SPACING = 0.0125
"""Grid step; the record is 410 distance constants long."""
BAND_LIMIT = 15.7
"""Largest wavenumber of the synthetic turbulence."""
SPIN_UP = 1600
"""Samples run before the period that counts."""


@dataclass(frozen=True)
class Row:
    """Result of one case; all numbers in units of I^2 (or of sigma_u^2 for a variance).

    Attributes:
        case: Name.
        intensity: I [1].
        simulation: Mean over the realisations, with its standard error.
        formula: Second-order formula over the same band of wavenumbers.
        difference: Simulation minus formula with the realised modes, with its standard error.
        allowed: Fourth-order remainder plus three standard errors of the difference.
    """

    case: str
    intensity: float
    simulation: float
    simulation_error: float
    formula: float
    difference: float
    difference_error: float
    allowed: float

    @property
    def passed(self) -> bool:
        """Whether the difference lies within what is allowed."""
        return abs(self.difference) <= self.allowed


def run_monte_carlo(
    pairs: int = 200,
    seed: int = 1,
    cases: Sequence[Case] | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[Row]:
    """Simulate every case and compare it with its formula.

    Args:
        pairs: Realisations, each with its mirror image.
        seed: The same seed gives the same table.
        cases: What to run; the standard table if not given.
        progress: Called with the name of each case before it starts.
    """
    rows = []
    for case in standard_cases() if cases is None else cases:
        if progress is not None:
            progress(f"{case.name}, I = {case.intensity}")
        rows.append(_run_case(case, pairs, seed))
    return rows


def _run_case(case: Case, pairs: int, seed: int) -> Row:
    wavenumber, variances = _modes(case)
    scale = case.intensity**2
    simulated, conditional = np.empty(pairs), np.empty(pairs)
    for index, amplitudes in enumerate(_realisations(case, variances, pairs, seed)):
        both = [_simulate(case, sign * amplitudes) for sign in (1.0, -1.0)]
        simulated[index] = 0.5 * (both[0] + both[1]) / scale
        conditional[index] = _formula(case, wavenumber, _realised(amplitudes)) / scale
    difference = simulated - conditional
    expected = np.zeros((3, 3, wavenumber.size))
    expected[np.arange(3), np.arange(3)] = variances
    expected[0, 2] = expected[2, 0] = case.correlation * np.sqrt(variances[0] * variances[2])
    root = math.sqrt(pairs)
    error = float(np.std(difference, ddof=1)) / root
    return Row(
        case=case.name,
        intensity=case.intensity,
        simulation=float(np.mean(simulated)),
        simulation_error=float(np.std(simulated, ddof=1)) / root,
        formula=_formula(case, wavenumber, expected) / scale,
        difference=float(np.mean(difference)),
        difference_error=error,
        allowed=case.remainder * scale + 3.0 * error,
    )


def _modes(case: Case) -> tuple[FloatArray, FloatArray]:
    """Wavenumbers from zero to the band limit and the variance of each mode, shape (3, J)."""
    spacing = 2.0 * math.pi / (SAMPLES * SPACING)
    wavenumber = spacing * np.arange(math.floor(BAND_LIMIT / spacing) + 1, dtype=np.float64)
    longitudinal = von_karman.longitudinal_spectrum(wavenumber, 1.0, case.q)
    transverse = von_karman.transverse_spectrum(wavenumber, 1.0, case.q)
    vertical = transverse if case.correlation == 0.0 else longitudinal
    variances = modal_variances(np.stack([longitudinal, transverse, vertical]), spacing)
    variances[:, 0] = 0.0
    switched = np.array(case.present, dtype=np.float64)[:, None]
    return wavenumber, variances * switched * case.intensity**2


def _realisations(
    case: Case, variances: FloatArray, pairs: int, seed: int
) -> Iterator[ComplexArray]:
    generator = np.random.Generator(np.random.PCG64(seed))
    for _ in range(pairs):
        amplitudes = draw_modes(generator, variances)
        if case.correlation != 0.0:
            own = math.sqrt(1.0 - case.correlation**2)
            amplitudes[2] = case.correlation * amplitudes[0] + own * amplitudes[2]
        yield amplitudes


def _realised(amplitudes: ComplexArray) -> FloatArray:
    """Variances and co-spectra of the realised modes, shape (3, 3, J)."""
    return np.asarray(0.5 * np.real(amplitudes[:, None, :] * np.conj(amplitudes[None, :, :])))


def _simulate(case: Case, amplitudes: ComplexArray) -> float:
    """Relative bias (or variance) of one realisation."""
    u, v, w = sum_modes(amplitudes, SAMPLES)
    if case.instrument == "rotor":
        if case.rotor.form in {PROPELLER_JACKSON, PROPELLER_KRISTENSEN_1994}:
            rate = _rotor_rate(case.rotor, 1.0 + u, np.hypot(v, w))
        else:
            rate = _rotor_rate(case.rotor, w, np.hypot(1.0 + u, v))
        if case.variance:
            return float(np.var(rate))
        return float(np.mean(rate)) - _steady(case)
    if case.instrument == "nonlinear":
        return _nonlinear_vane(case, u, v, w) - 1.0
    angle, turn = _linear_vane(case, amplitudes[1])
    if case.instrument == "vector":
        rate = _rotor_rate(case.rotor, w, np.hypot(1.0 + u, v))
        return math.hypot(np.mean(rate * np.cos(angle)), np.mean(rate * np.sin(angle))) - 1.0
    axial, lateral = relative_wind(1.0 + u, v, angle, turn, case.arm)
    return float(np.mean(_rotor_rate(case.rotor, axial, np.hypot(lateral, w)))) - 1.0


def _rotor_rate(
    parameters: RotorParameters, axial: FloatArray, transverse: FloatArray
) -> FloatArray:
    """y over one period of the record, after a spin-up in the period's last part."""
    wind = np.zeros((SAMPLES + SPIN_UP, 3))
    wind[:, 0] = _with_spin_up(transverse)
    wind[:, 2] = _with_spin_up(axial)
    constant = np.ones(SAMPLES + SPIN_UP)
    rate, _ = integrate_cup(parameters, wind, constant, 0.0 * constant, SPACING, -1.0, 0.0)
    return rate[SPIN_UP:]


def _linear_vane(case: Case, lateral: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Angle and turning rate of a linear vane, exactly, mode by mode."""
    spacing = 2.0 * math.pi / (SAMPLES * SPACING)
    wavenumber = spacing * np.arange(lateral.size)
    response = vane.transfer_function(wavenumber * case.vane_length, case.damping_ratio)
    modes = response * lateral
    return sum_modes(modes, SAMPLES), sum_modes(1j * wavenumber * modes, SAMPLES)


def _nonlinear_vane(case: Case, u: FloatArray, v: FloatArray, w: FloatArray) -> float:
    """Mean rate of a propeller on the vane's full equation; the mean wind goes along -x."""
    wind = np.stack([-_with_spin_up(1.0 + u), -_with_spin_up(v), _with_spin_up(w)], axis=1)
    count = SAMPLES + SPIN_UP
    parameters = VaneParameters(case.vane_length, case.damping_ratio, 1.0, 1.0, 0.0, 0.0, 0.0)
    motion = integrate_propeller_vane(
        case.rotor,
        parameters,
        case.arm,
        wind,
        np.zeros(count),
        np.zeros((count, 2)),
        np.ones(count),
        np.zeros(count),
        SPACING,
        np.array([-1.0, 0.0, math.nan, 0.0]),
    )
    return float(np.mean(motion[SPIN_UP:, 0]))


def _with_spin_up(record: FloatArray) -> FloatArray:
    return np.concatenate([record[-SPIN_UP:], record])


def _steady(case: Case) -> float:
    """Rate in the mean wind alone: 1, or 1 - U_s^2 with friction."""
    return 1.0 - case.rotor.friction


def _formula(case: Case, wavenumber: FloatArray, moments: FloatArray) -> float:
    """Second-order bias (or variance) for given modal variances and co-spectra, shape (3, 3, J)."""
    p = case.rotor
    x2 = wavenumber**2
    lost = x2 / (1.0 + x2)
    u2, v2, w2, uw = moments[0, 0], moments[1, 1], moments[2, 2], moments[0, 2]
    friction = p.friction
    if case.variance:
        return float(np.sum((1.0 + friction) ** 2 * u2 / (1.0 + x2)))
    if case.instrument in {"linear", "nonlinear"}:
        weight = bias_weight(
            wavenumber * case.vane_length,
            case.damping_ratio,
            case.arm / case.vane_length,
            p.mu2,
        )
        return float(np.sum(p.a4 * lost * u2 + weight * v2 + 0.5 * p.mu2 * w2))
    if p.form == PROPELLER_JACKSON:
        return float(np.sum((x2 - friction) / (1.0 + x2) * u2))
    filtered = u2 + p.mu1**2 * w2 + 2.0 * p.mu1 * uw
    lateral = 0.5 * v2
    if p.form == PROPELLER_KRISTENSEN_1994:
        lateral = 0.5 * p.mu2 * v2
    if case.instrument == "vector":
        response = np.abs(vane.transfer_function(wavenumber * case.vane_length, case.damping_ratio))
        lateral = 0.5 * v2 * (1.0 - response**2)
    return float(np.sum(p.a4 * lost * filtered + lateral + 0.5 * p.mu2 * w2))


def table_markdown(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    head = (
        "| case | I | simulation | formula | simulation - formula, same modes | allowed | |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    return head + "".join(
        f"| {row.case} | {row.intensity:g} "
        f"| {row.simulation:.4f} ± {row.simulation_error:.4f} | {row.formula:.4f} "
        f"| {row.difference:+.5f} ± {row.difference_error:.5f} | {row.allowed:.5f} "
        f"| {'inside' if row.passed else 'OUTSIDE'} |\n"
        for row in rows
    )
