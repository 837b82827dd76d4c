"""Where instruments differ from their certificates, found on healthy days."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect, with_effect
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.whitening import trust_of, unstanding
from wind_sensors.station.model import Angle, Propeller, Rotor, Station

STANDING_TOLERANCES = (
    ("calibration_drift", "gain", 0.01),
    ("calibration_offset", "offset", 0.05),
    ("vane_offset", "offset", 1.0),
)
"""What commissioning may correct: effect, parameter, tolerance of the certificate."""

PROPELLER_TOLERANCES = (("rotor_inertia", "inertia_factor", 0.3),)
"""And of propellers: a certificate's distance constant is that of a release from rest, in which
their blades begin stalled. In the gusts that they turn in they may answer within half of it."""


def commissioned(
    comparisons: Sequence[Comparison], station: Station, baseline: Baseline
) -> Station:
    """The station with the gains, offsets, mounting angles and inertia of its healthy days.

    Args:
        comparisons: Of the healthy days.
        station: As it is described, or as it was commissioned before.
        baseline: What is normal so far, for the noise.
    """
    effects = catalogue()
    terms: list[tuple[Effect, str, str, float]] = []
    for kind, tolerances in (
        (Rotor | Angle, STANDING_TOLERANCES),
        (Propeller, PROPELLER_TOLERANCES),
    ):
        for effect_name, parameter, tolerance in tolerances:
            effect = effects[effect_name]
            terms.extend(
                (effect, entry.name, parameter, tolerance)
                for entry in station.instruments
                if isinstance(entry, kind) and effect.applies(entry, station)
            )
    current = station
    for _ in range(2):
        normal = np.eye(len(terms))
        right = np.zeros(len(terms))
        for comparison in comparisons:
            without = comparison.simulate(current)
            trust = trust_of(comparison, without, baseline)
            whitener = unstanding(comparison, trust)
            nothing = whitener.of(without)
            size = sum(v.size for v in without.cosine.values())
            columns = []
            for effect, name, parameter, tolerance in terms:
                healthy = effect.parameters[0].healthy or 0.0
                values = {parameter: healthy + tolerance}
                planted = with_effect(current, effect, name, values)
                only = comparison.affected(current, name)
                moved = whitener.of(comparison.simulate(planted, only, without))
                columns.append((nothing - moved)[:size])
            g = np.array(columns)
            # Recordings differ by more than their noise: each counts as one witness whose
            # standing scatter is a third of the tolerance.
            inner = np.linalg.inv(np.linalg.inv(g @ g.T + 1e-6 * np.eye(len(terms)))
                                  + np.eye(len(terms)) / 9.0)
            estimate = np.linalg.solve(g @ g.T + 1e-6 * np.eye(len(terms)), g @ nothing[:size])
            normal += inner
            right += inner @ estimate
        amplitudes = np.linalg.solve(normal, right)
        for (effect, name, parameter, tolerance), amplitude in zip(
            terms, amplitudes, strict=True
        ):
            healthy = effect.parameters[0].healthy or 0.0
            change = tolerance * float(amplitude)
            # Factors stay positive.
            values = {parameter: float(np.exp(change)) if healthy == 1.0 else healthy + change}
            current = with_effect(current, effect, name, values)
    return current
