"""The second-order bias formulas against the compiled equations of motion in turbulence."""

from __future__ import annotations

import pytest

from wind_sensors.instruments import rotor_family
from wind_sensors.instruments.dynamics.rotor import CUP_EQUIVALENT, CUP_KRISTENSEN_1994
from wind_sensors.report import monte_carlo
from wind_sensors.report.monte_carlo import run_monte_carlo
from wind_sensors.report.monte_carlo_cases import Case, rotor, standard_cases


def test_two_cups_at_three_intensities() -> None:
    share = rotor_family.torque_share(1.0, 0.3)
    cases = [
        Case(name, intensity, parameters)
        for name, parameters in (
            ("a4 = 1", rotor(CUP_EQUIVALENT, 1.0)),
            ("Lambda/l = 0.3, mu", rotor(CUP_KRISTENSEN_1994, share, 0.1, 0.8)),
        )
        for intensity in (0.05, 0.1, 0.2)
    ]
    rows = run_monte_carlo(pairs=24, seed=7, cases=cases)
    for row in rows:
        assert row.passed, row
        # The simulation's own mean agrees with the band formula as far as it is known.
        assert abs(row.simulation - row.formula) < 4.0 * row.simulation_error + row.allowed
        # Overspeeding is large against what is left: the comparison could have failed.
        assert row.formula > 10.0 * row.allowed
    assert [row.case for row in rows] == [case.name for case in cases]


def test_a_wrong_formula_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the cross term of u and w the correlated case must fall outside."""
    case = next(c for c in standard_cases() if c.correlation != 0.0)
    assert run_monte_carlo(pairs=12, cases=[case])[0].passed
    realised = monte_carlo._realised

    def without_cross_term(amplitudes: monte_carlo.ComplexArray) -> monte_carlo.FloatArray:
        moments = realised(amplitudes)
        moments[0, 2] = 0.0
        return moments

    monkeypatch.setattr(monte_carlo, "_realised", without_cross_term)
    assert not run_monte_carlo(pairs=12, cases=[case])[0].passed


def test_propellers_and_vanes_in_a_short_run() -> None:
    cases = [c for c in standard_cases() if "prop" in c.name or "vector" in c.name]
    rows = run_monte_carlo(pairs=6, seed=3, cases=cases)
    assert all(row.passed for row in rows), [row for row in rows if not row.passed]
    axial = [row for row in rows if row.case.startswith("K94")]
    # No overspeeding at all: exact, not merely to second order.
    assert all(abs(row.simulation) < 2e-4 for row in axial)


def test_the_same_seed_gives_the_same_table() -> None:
    case = standard_cases()[0]
    first = run_monte_carlo(pairs=2, seed=5, cases=[case])
    second = run_monte_carlo(pairs=2, seed=5, cases=[case])
    assert first == second
    assert "inside" in monte_carlo.table_markdown(first)


@pytest.mark.slow
def test_the_whole_table() -> None:
    rows = run_monte_carlo(pairs=200, seed=1)
    assert all(row.passed for row in rows), [row for row in rows if not row.passed]
