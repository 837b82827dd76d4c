"""Every golden value, computed by the library from its inputs.

The file is named by WIND_CHECK_VALUES; its values were obtained from defining integrals, root
problems and integrated equations, not from the closed forms used here. The function is found by
the identifier; an identifier without a function fails. Without the file `test_independent_values`
checks a value or more of each family.
"""

from __future__ import annotations

import ast
import json
import math
import operator
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.instruments import (
    bivane,
    cup,
    cup_vane,
    filtered_turbulence,
    friction_propeller,
    periodic,
    propeller,
    propeller_array,
    propeller_turbulence,
    propeller_vane,
    pulses,
    rotor_family,
    schrenk,
    speed_bias,
    vane,
    vane_variance,
)
from wind_sensors.turbulence import inertial_range, isotropic, surface_layer, von_karman
from wind_sensors.turbulence.quadrature import integrate_over_wavenumbers

PATH = Path(
    os.environ.get(
        "WIND_CHECK_VALUES",
        Path(__file__).resolve().parents[1] / ".." / "shared" / "check_values.json",
    )
)
Inputs = dict[str, Any]


def read_entries(path: Path) -> list[dict[str, Any]]:
    """The file's entries; an angular response given `as above` is that of the entry before."""
    entries: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["values"]
    known: dict[str, str] = {}
    for entry in entries:
        family = entry["id"].split(".")[0]
        response = entry["inputs"].get("f")
        if response == "as above":
            entry["inputs"]["f"] = known[family]
        elif response is not None:
            known[family] = response
    return entries


# A file that was named must be there; only the default may be absent.
ABSENT = not PATH.exists() and "WIND_CHECK_VALUES" not in os.environ
ENTRIES = [{"id": "absent"}] if ABSENT else read_entries(PATH)


# Expressions of angular responses, as the file writes them.

_FUNCTIONS = {"cos": np.cos, "sin": np.sin, "sqrt": np.sqrt, "abs": np.abs, "exp": np.exp}
_OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def expression(text: str) -> Callable[[Any], Any]:
    """Function of theta from a text such as `sqrt(cos(0.98 theta))`, remarks ignored."""
    formula = re.split(r"\s\((?=[a-z ,]*(?:test|not|from)\b)", text.strip())[0].strip()
    if formula in _FUNCTIONS:
        formula += "(theta)"
    # Products are written without a sign: `0.98 theta`, `cos(theta)(1-...)`.
    formula = re.sub(r"(\d|\))\s*(?=theta|cos|sin|sqrt|\()", r"\1*", formula).replace("^", "**")
    tree = ast.parse(formula, mode="eval").body

    def evaluate(node: ast.expr, theta: Any) -> Any:
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name):
            return {"theta": theta, "pi": math.pi}[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -evaluate(node.operand, theta)
        if isinstance(node, ast.BinOp):
            left, right = evaluate(node.left, theta), evaluate(node.right, theta)
            return _OPERATORS[type(node.op)](left, right)
        assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name), formula
        return _FUNCTIONS[node.func.id](evaluate(node.args[0], theta))

    return lambda theta: evaluate(tree, np.asarray(theta, dtype=float))


def friction_rotor(i: Inputs) -> friction_propeller.FrictionPropeller:
    g = expression(str(i["g/g0"])) if "g/g0" in i else friction_propeller.torque_slope_ratio
    return friction_propeller.FrictionPropeller(
        calibration_distance=i.get("P", 1.0),
        response_length=i.get("L", 1.0),
        stall_speed=i.get("Us", 0.0),
        f=expression(str(i.get("f", "cos"))),
        g=g,
    )


def k94_cup(i: Inputs) -> cup.CupConstants:
    return cup.CupConstants(
        calibration_distance=i.get("ell", 1.0),
        distance_constant=i.get("ell0", 1.0),
        second_length=i.get("Lambda", 0.0),
        mu1=i.get("mu1", 0.0),
        mu2=i.get("mu2", 0.0),
    )


def coefficient(name: str) -> Callable[[Inputs], float]:
    def handler(i: Inputs) -> float:
        c = k94_cup(i)
        return float(getattr(rotor_family.second_order_coefficients(c.a4, c.mu1, c.mu2), name))

    return handler


def share(ratio: float) -> float:
    """a4 from Lambda/l."""
    return rotor_family.torque_share(1.0, ratio)


def wave(text: Any) -> None:
    assert text is None or text == "A U sin(kUt)", text


def cup_gust(i: Inputs) -> float:
    """Periodic gust along u, v or w on a K94 cup."""
    wave(i.get("v"))
    wave(i.get("w"))
    wave(i.get("u"))
    amplitude, a4 = i["A"], share(i["Lambda/ell"])
    mu1, mu2 = i.get("mu1", 0.0), i.get("mu2", 0.0)

    def forcing(theta: Any) -> Any:
        gust = amplitude * np.sin(theta)
        if "v" in i:
            return np.hypot(1.0, gust)
        return 1.0 + mu1 * gust if "w" in i else 1.0 + gust

    def lift(theta: Any) -> Any:
        return 0.5 * mu2 * (amplitude * np.sin(theta)) ** 2 if "w" in i else 0.0 * theta

    return periodic.periodic_rate(forcing, a4, i["k*ell0"], lift).mean


def sinusoid(i: Inputs) -> periodic.PeriodicRate:
    return PT.sinusoidal_rate(
        i["A=du/U"], 2.0 * math.pi * i["L"] / i["wavelength"], i["Us"] / i["Ubar"]
    )


def constants(i: Inputs) -> tuple[float, surface_layer.VarianceRatios]:
    """Coefficient of K94 (73) and variance ratios: K94's unless inputs name others."""
    v2, w2 = i.get("v2/ust2", 2.68), i.get("w2/ust2", 1.46)
    coefficient = vane_variance.neutral_loss_coefficient(
        i.get("alpha1_kappa43", surface_layer.ALPHA1_KAPPA43),
        i.get("kappa", surface_layer.VON_KARMAN_CONSTANT),
        v2,
    )
    return coefficient, surface_layer.VarianceRatios(u=0.0, v=v2, w=w2)


def uf_from_10(i: Inputs, identifier: str) -> float:
    """Both roots reproduce the rate and the acceleration; the identifier says which was meant."""
    rotor = friction_rotor(i)
    roots = friction_propeller.invert_axial(
        rotor.calibration_distance * i["omega"],
        rotor.calibration_distance * i["omegadot"],
        math.radians(i["theta_deg"]),
        rotor,
    )
    flipped = "flip" in identifier
    assert bool(roots.ambiguous) or not flipped
    return float(roots.other if flipped else roots.value)


def array_reading(axis: int) -> Callable[[Inputs], float]:
    def handler(i: Inputs) -> float:
        rotor = friction_rotor(i)
        return float(
            propeller_array.steady_readings(propeller_array.orthogonal_axes(), rotor, i["U"])[axis]
        )

    return handler


def recovered_speed(i: Inputs) -> float:
    estimate = propeller_array.solve(
        propeller_array.orthogonal_axes(), friction_rotor(i), i["readings"]
    )
    assert estimate.converged.all()
    return float(np.linalg.norm(estimate.velocity))


def run(i: Inputs) -> cup_vane.VectorWindRun:
    return cup_vane.vector_wind_run(i["phi"], i["T"], i["ell"], i.get("pulses_per_rev", 1.0))


def variance_85(i: Inputs) -> float:
    if "half_width" in i:
        return cup_vane.variance_85_of_uniform(i["half_width"])
    if "sigma" in i:
        return cup_vane.variance_85_of_normal(i["sigma"])
    return cup_vane.direction_variance(i["phi"])


def variance_log(i: Inputs) -> float:
    return cup_vane.direction_variance_logarithmic(variance_85(i))


def intervals(i: Inputs) -> pulses.MeanSpeed:
    return pulses.mean_speed(i["dt"], i["ell"], i.get("pulses_per_rev", 1.0))


def bias_100(i: Inputs) -> float:
    ratios = surface_layer.VarianceRatios(u=0.0, v=i["v2/ust2"], w=i["w2/ust2"])
    return speed_bias.neutral_bias(
        i["ell0"],
        i["z"],
        i["z0"],
        ratios,
        i["a4"],
        i.get("mu1", 0.0),
        i["mu2"],
        i.get("alpha", 1.7),
        i.get("kappa", 0.4),
    ).total


def vane_geometry(i: Inputs) -> vane.VaneDynamics:
    return vane.dynamics_from_geometry(i["rho"], i["r"], i["A"], i["K"], i["I"])


def schrenk_rotor(i: Inputs) -> schrenk.SchrenkRotor:
    return schrenk.SchrenkRotor(i["r"], i["Kplus"], i["Kminus"])


def moments(i: Inputs) -> vane_variance.VaneMoments:
    return vane_variance.von_karman_moments(i["q*l_v"], i["zeta"])


def propvane_von_karman(i: Inputs) -> float:
    return propeller_vane.von_karman_bias(
        i["q*l_v"],
        i["zeta"],
        i["a/l_v"],
        i["mu2"],
        math.sqrt(i["sigma_v^2/U^2"]),
        math.sqrt(i["sigma_w^2/U^2"]),
    ).total


def surface_delta(i: Inputs) -> float:
    return propeller_vane.surface_layer_delta(
        i["zeta"],
        i["a"] / i["l_v"],
        i["mu2"],
        i["l_v"],
        i["z"],
        i["z/z0"],
        i["z/L"],
        i.get("alpha1_kappa43", surface_layer.ALPHA1_KAPPA43),
    )


def vector_run(i: Inputs) -> float:
    length, intensity = i["q*ell0"], i["sigma/U"]
    return cup_vane.vector_run_bias(
        (length, length, length),
        i["q*l_v"],
        i["zeta"],
        (intensity, intensity, intensity),
        i["a4"],
        i.get("mu1", 0.0),
        i["mu2"],
    ).total


def sampling(i: Inputs) -> float:
    return bivane.reduced_sampling(i["L"], i["V"], i["Dt"])


def bivane_w(i: Inputs) -> float:
    angles = [i["beta_m1"], i["beta_0"], i["beta_p1"]]
    return float(bivane.reduce_samples(angles, i["V0"], i["Dt"], i["L"], i["zeta"])[1])


def propvane_gust(i: Inputs) -> float:
    wave(i["v"])
    return propeller_vane.rate_in_lateral_gusts(
        i["A"], i["k*l_v"], i["zeta"], i["a/l_v"], i["mu2"], i["ell0/l_v"]
    ).mean


def damped_energy(_: Inputs) -> float:
    return integrate_over_wavenumbers(lambda k: von_karman.energy_spectrum(k, 1.0, 1.0), 1.0, 1.0)


def diabatic(i: Inputs) -> float:
    return speed_bias.diabatic_longitudinal_bias(
        i["ell0"],
        i["z"],
        i["z/z0"],
        i["z/L"],
        i["a4"],
        i.get("mu1", 0.0),
        i.get("alpha1_kappa43", 0.165),
    )


def exponential_correlation(i: Inputs) -> float:
    return float(filtered_turbulence.exponential_loss(i["ell0/Lint"]))


FP = friction_propeller
PT = propeller_turbulence
VK = von_karman
SL = surface_layer

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "turb.B_half_third": lambda i: VK.BETA_HALF_THIRD,
    "turb.Lq": lambda i: isotropic.integral_length(
        float(VK.longitudinal_spectrum(0.0, 1.0, 1.0)), 1.0
    ),
    "turb.DL_over_s2": lambda i: VK.longitudinal_structure_function(i["qr"], 1.0, 1.0),
    "turb.DT_over_s2": lambda i: VK.transverse_structure_function(i["qr"], 1.0, 1.0),
    "turb.RL_over_s2": lambda i: VK.longitudinal_correlation(i["qr"], 1.0, 1.0),
    "turb.RT_over_s2": lambda i: VK.transverse_correlation(i["qr"], 1.0, 1.0),
    "turb.DL_inertial_coeff": lambda i: inertial_range.LONGITUDINAL_STRUCTURE_COEFFICIENT,
    "turb.DT_inertial_coeff": lambda i: inertial_range.TRANSVERSE_STRUCTURE_COEFFICIENT,
    "turb.qFL_over_s2": lambda i: VK.longitudinal_spectrum(i["k/q"], 1.0, 1.0),
    "turb.qFT_over_s2": lambda i: VK.transverse_spectrum(i["k/q"], 1.0, 1.0),
    "turb.qE_over_s2": lambda i: VK.energy_spectrum(i["k/q"], 1.0, 1.0),
    "turb.int_E": damped_energy,
    "turb.peak_kFL": lambda i: VK.PEAK_WAVENUMBER_RATIO,
    "turb.alpha1_from_alpha1": lambda i: inertial_range.one_sided_longitudinal_constant(i["alpha"]),
    "cup.phi_L": lambda i: filtered_turbulence.longitudinal_loss(i["q*ell0"]),
    "cup.phi_T": lambda i: filtered_turbulence.transverse_loss(i["q*ell0"]),
    "cup.filtered_variance": lambda i: speed_bias.filtered_variance_ratio(i["q*ell0"]),
    "cup.inertial_u_coeff": lambda i: speed_bias.INERTIAL_COEFFICIENT,
    "cup.inertial_w_coeff": lambda i: speed_bias.INERTIAL_VERTICAL_COEFFICIENT,
    "cup.u_coeff_alpha1": lambda i: speed_bias.INERTIAL_COEFFICIENT_ALPHA1,
    "cup.coeff_102": lambda i: speed_bias.neutral_longitudinal_coefficient(
        i.get("alpha", 1.7), i.get("kappa", 0.4), i.get("sigma_u/ustar", 2.39)
    ),
    "cup.bias_104": lambda i: (
        speed_bias.isotropic_bias(i["q*ell0"], i["sigma/U"], i["a4"], i["mu1"], i["mu2"]).total
    ),
    "cup.bias_100": bias_100,
    "cup.F_example": lambda i: cup.angular_acceleration(i["s"], i["h"], i["w"], k94_cup(i)),
    **{
        f"cup.{name}": coefficient(name)
        for name in ("a1", "a2", "a3", "a4", "a5", "a6", "a7", "a8", "a_vv")
    },
    "cup.factor_riso": lambda i: cup.calibration_factor(i["ell"], i["r"]),
    "cup.angular_response_K94": lambda i: cup.steady_response(
        math.radians(i["theta_deg"]), k94_cup(i)
    ),
    "cup.angular_response_K14": lambda i: cup.angular_response(
        math.radians(i["theta_deg"]), i["mu1"], i["mu2"]
    ),
    "cup.angular_response_K14_second_order": lambda i: cup.angular_response(
        math.radians(i["theta_deg"]), i["mu1"], i["mu2"], second_order=True
    ),
    "cup.step_linear": lambda i: cup.step_response(i["t/tau0"]),
    "cup.step_nonlinear": lambda i: rotor_family.response_to_constant_wind(
        i["x/ell0"], i["y0=ell*s(0)/h"], share(i["Lambda/ell"])
    ),
    "cup.distance_63pct_from_rest": lambda i: rotor_family.wind_run_to_fraction(
        -math.expm1(-1.0), 0.0, share(i["Lambda/ell"])
    ),
    "cup.gain": lambda i: cup.gain(i["k*ell0"]),
    "cup.phase": lambda i: cup.phase(i["k*ell0"]),
    "cup.gust_mean": cup_gust,
    "cup.gust_mean_u": cup_gust,
    "cup.gust_mean_v": cup_gust,
    "cup.gust_mean_w": cup_gust,
    "cup.u_bias_exponential_corr": exponential_correlation,
    "cup.u_bias_diabatic": diabatic,
    "cup.schrenk.factor": lambda i: schrenk_rotor(i).factor,
    "cup.schrenk.ell0": lambda i: schrenk_rotor(i).distance_constant,
    "cup.schrenk.a4": lambda i: schrenk_rotor(i).a4,
    "cup.schrenk.Lambda_over_ell": lambda i: (
        schrenk_rotor(i).second_length / schrenk_rotor(i).calibration_distance
    ),
    "cup.ell0_from_inertia": lambda i: cup.distance_constant_from_inertia(
        i["I"], i["rho"], i["C"], i["A"], i["r"], i["ell"], i["Lambda"]
    ),
    "pulse.ell_from_B0": lambda i: (
        pulses.FrequencyCalibration(0.0, i["B0"], i["n"]).calibration_distance
    ),
    "pulse.U_harmonic": lambda i: intervals(i).count_mean,
    "pulse.U_arithmetic": lambda i: intervals(i).arithmetic_mean,
    "pulse.ratio_exact": lambda i: intervals(i).ratio,
    "pulse.lognormal_ratio": lambda i: pulses.lognormal_mean_ratio(i["std_of_ln_Ui"]),
    "vane.step": lambda i: vane.step_response(i["omega0*t"], i["zeta"]),
    "vane.overshoot": lambda i: vane.overshoot(i["zeta"]),
    "vane.gain": lambda i: vane.gain(i["omega/omega0"], i["zeta"]),
    "vane.phase": lambda i: vane.phase(i["omega/omega0"], i["zeta"]),
    "vane.g": lambda i: vane_variance.g_integral(i["zeta"]),
    "vane.h": lambda i: vane_variance.h_integral(i["zeta"]),
    "vane.Delta": lambda i: vane_variance.loss_integral(i["zeta"]),
    "vane.g_beta": lambda i: vane_variance.g_integral(i["zeta"], i["beta"]),
    "vane.h_beta": lambda i: vane_variance.h_integral(i["zeta"], i["beta"]),
    "vane.Delta_beta": lambda i: vane_variance.loss_integral(i["zeta"], i["beta"]),
    "vane.zeta0": lambda i: vane_variance.damping_without_loss(i["beta"]),
    "vane.s_cross": lambda i: vane_variance.crossing(i["beta"]),
    "vane.D_beta": lambda i: vane_variance.recovered_fraction(i["beta"]),
    "vane.coeff_73": lambda i: constants(i)[0],
    "vane.relative_loss": lambda i: vane_variance.neutral_relative_loss(
        i["zeta"], i["l_v"], i["z"], constants(i)[0]
    ),
    "vane.variance_ratio_vonKarman": lambda i: moments(i).direction,
    "vane.vphi_vonKarman": lambda i: moments(i).lateral,
    "vane.phidot2_vonKarman": lambda i: moments(i).turning,
    "vane.omega0_from_geometry": lambda i: vane.natural_frequency(
        i["U"], vane_geometry(i).distance_constant
    ),
    "vane.zeta_from_geometry": lambda i: vane_geometry(i).damping_ratio,
    "vane.B_arm": lambda i: vane.arm_coefficient(i["K"]),
    "vane.slow_pole_length": lambda i: vane.slow_pole_length_ratio(i["zeta"]),
    "prop.K94.angular_response": lambda i: propeller.steady_response(
        math.radians(i["theta_deg"]), i["mu2"]
    ),
    "prop.K94.critical_angle": lambda i: math.degrees(propeller.critical_angle(i["mu2"])),
    "prop.K94.step": lambda i: rotor_family.response_to_constant_wind(i["x/ell0"], i["y0"], 0.0),
    "prop.K94.gust_mean": lambda i: (
        periodic.periodic_rate(lambda theta: 1.0 + i["A"] * np.sin(theta), 0.0, i["k*ell0"]).mean
    ),
    "prop.J80.axial": lambda i: FP.steady_axial(i["U"], i["Us"]),
    "prop.J80.Us_for_14pct_at_1ms": lambda i: FP.stall_speed_from_excess(i["U"], i["U/(P omega)"]),
    "prop.J80.oblique_ratio": lambda i: FP.oblique_ratio(
        i["U"], math.radians(i["theta_deg"]), friction_rotor(i)
    ),
    "prop.J80.stall_angle": lambda i: math.degrees(FP.stall_angle(i["U"], friction_rotor(i))),
    "prop.J80.recovery": lambda i: FP.recovery(
        i["t"], i["P*omega0"], i["U"], math.radians(i["theta_deg"]), friction_rotor(i)
    ),
    "prop.J80.time_constant": lambda i: FP.relaxation_time(
        i["U"], math.radians(i["theta_deg"]), friction_rotor(i)
    ),
    "prop.J80.sin_mean": lambda i: i["Ubar"] * sinusoid(i).mean,
    "prop.J80.sin_amp1": lambda i: abs(sinusoid(i).first_harmonic()) / i["A=du/U"],
    "prop.J80.sin_phase1": lambda i: np.angle(sinusoid(i).first_harmonic()),
    "prop.J80.sin_max": lambda i: (sinusoid(i).maximum() - 1.0) / i["A=du/U"],
    "prop.J80.variance_vonKarman": lambda i: PT.variance_von_karman(i["q*L"], i["Us/Ubar"]),
    "prop.J80.overspeed_vonKarman": lambda i: PT.mean_excess_von_karman(i["q*L"], i["Us/Ubar"]),
    "prop.J80.Leff_ratio": lambda i: PT.effective_length_ratio(i["I"], i["b"], i["c*h"]),
    "prop.J80.omegadot": lambda i: FP.angular_acceleration(
        i["omega"], i["U"], math.radians(i["theta_deg"]), friction_rotor(i)
    ),
    "prop.J80.Uf_from_10": uf_from_10,
    "array.reading_x": array_reading(0),
    "array.reading_y": array_reading(1),
    "array.reading_z": array_reading(2),
    "array.recovered_speed": recovered_speed,
    "array.uncorrected_speed": lambda i: np.linalg.norm(
        propeller_array.uncorrected_velocity(propeller_array.orthogonal_axes(), i["readings"])
    ),
    "propvane.delta_vonKarman": propvane_von_karman,
    "propvane.coeff114_const": lambda i: propeller_vane.neutral_constant(i["mu2"], constants(i)[1]),
    "propvane.coeff116": lambda i: propeller_vane.neutral_slope(
        i["zeta"], i["a"] / i["l_v"], i["mu2"], constants(i)[0]
    ),
    "propvane.delta_over_half_v2": lambda i: propeller_vane.neutral_relative_bias(
        i["zeta"],
        i["a"] / i["l_v"],
        i["mu2"],
        i["l_v"],
        i["z"],
        constants(i)[1],
        constants(i)[0],
    ),
    "propvane.delta_pv": surface_delta,
    "propvane.gust_mean_v": propvane_gust,
    "surf.psi_m": lambda i: SL.profile_correction(i["z/L"]),
    "surf.phi_m": lambda i: SL.wind_shear_function(i["z/L"]),
    "surf.phi_eps": lambda i: SL.dissipation_function(i["z/L"]),
    "surf.chi_pv": lambda i: SL.surface_layer_bias_function(
        i["z/z0"], i["z/L"], i.get("alpha1_kappa43", 0.165)
    ),
    "cupvane.U": lambda i: run(i).east,
    "cupvane.V": lambda i: run(i).north,
    "cupvane.speed": lambda i: run(i).speed,
    "cupvane.direction_alpha": lambda i: run(i).heading,
    "cupvane.direction_D": lambda i: cup_vane.direction_from(run(i).heading),
    "cupvane.variance_85": variance_85,
    "cupvane.variance_log": variance_log,
    "cupvane.vector_run_bias": vector_run,
    "bivane.T0": lambda i: bivane.free_period(i["L"], i["V"]),
    "bivane.l_v": lambda i: bivane.distance_constant(i["L"]),
    "bivane.W_discrete": bivane_w,
    "bivane.overall_gain": lambda i: bivane.overall_gain(i["omega/omega0"], sampling(i), i["zeta"]),
    "bivane.nyquist_gain": lambda i: bivane.nyquist_gain(sampling(i)),
    "bivane.damped_period": lambda i: bivane.damped_period(i["L"], i["V"], i["zeta"]),
}


def function_for(identifier: str) -> Callable[..., Any]:
    """Function of an identifier: the part before the first `=`, without trailing qualifiers."""
    key = identifier.split("=", maxsplit=1)[0]
    while key not in FUNCTIONS:
        if "." not in key:
            raise KeyError(f"no function is known for {identifier}")
        key = key.rsplit(".", maxsplit=1)[0]
    return FUNCTIONS[key]


def evaluate(identifier: str, inputs: Inputs) -> float:
    function = function_for(identifier)
    if function is uf_from_10:
        return float(function(inputs, identifier))
    return float(function(inputs))


def tolerance(method: str) -> float:
    """Relative tolerance: looser where the golden value is itself an integrated equation."""
    return 1e-6 if re.search(r"\bODE\b|periodic", method) else 1e-9


@pytest.mark.skipif(ABSENT, reason="the check values are not beside the repository")
@pytest.mark.parametrize("entry", ENTRIES, ids=[str(entry["id"]) for entry in ENTRIES])
def test_check_value(entry: dict[str, Any]) -> None:
    result = evaluate(entry["id"], entry["inputs"])
    assert result == pytest.approx(entry["value"], rel=tolerance(entry["method"]), abs=1e-13)


def test_unknown_identifier_is_refused() -> None:
    with pytest.raises(KeyError):
        function_for("cup.no_such_quantity.x=1")


def test_expressions_are_read_as_the_file_writes_them() -> None:
    theta = 0.7
    text = "cos(theta)*(1-0.15*sin(theta)^2) (test function, not from the seeds)"
    expected = math.cos(theta) * (1.0 - 0.15 * math.sin(theta) ** 2)
    assert float(expression(text)(theta)) == pytest.approx(expected, rel=1e-15)
    assert float(expression("sqrt(cos(0.98 theta))")(theta)) == pytest.approx(
        math.sqrt(math.cos(0.98 * theta)), rel=1e-15
    )
    assert float(expression("cos")(theta)) == math.cos(theta)


def test_the_resonance_integral_is_known_from_its_definition() -> None:
    """g_beta against plain quadrature, as a check that does not need the file."""
    zeta, slope = 0.45, 1.8

    def integrand(s: float) -> float:
        return math.pow(s, 2.0 - slope) / ((1.0 - s * s) ** 2 + 4.0 * zeta**2 * s * s)

    value = integrate.quad(integrand, 0.0, math.inf, epsabs=1e-13)[0]
    assert vane_variance.g_integral(zeta, slope) == pytest.approx(value, rel=1e-8)
