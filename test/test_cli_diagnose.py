"""What `wind diagnose` says on the screen."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console
from test_diagnosis_latent import boat
from test_diagnosis_sizes_for_people import finding

from wind_sensors.cli.diagnose import catalogue_without
from wind_sensors.cli.other_references import print_outcome
from wind_sensors.diagnosis.latent.diagnose import diagnose_latent
from wind_sensors.diagnosis.proving.findings import Estimate
from wind_sensors.diagnosis.proving.proof import Proof
from wind_sensors.errors import UserError


def test_findings_read_as_on_the_page_and_what_is_not_claimed_is_counted() -> None:
    outcome = diagnose_latent(boat(20))
    wake = replace(
        finding("wake_shadow", bearing_from=Estimate(0.0, -2.0, 2.0, "deg")),
        proof=Proof(2.61, 2.25, 1.93, 0.565, 0.42, 0.65, None),
    )
    assert outcome.declined
    text = io.StringIO()
    print_outcome(Console(file=text, width=80), replace(outcome, findings=(wake,)))
    told = " ".join(text.getvalue().split())
    assert "wind from 0 deg from the bow (358 to 2)" in told
    assert "held out: it removes 56 % (42 to 65 %) of the excess misfit" in told
    assert "floor 1.93" in told
    assert f"{len(outcome.declined)} things were seen and not claimed: report.html" in told
    assert outcome.declined[0][:40] not in told


def test_a_misspelt_effect_is_guessed() -> None:
    with pytest.raises(UserError, match=r"Did you mean wake_shadow\?"):
        catalogue_without(["wakeshadow"])
    with pytest.raises(UserError, match="The effects are "):
        catalogue_without(["qqq"])
