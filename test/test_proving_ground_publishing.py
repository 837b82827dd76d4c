"""The page says what the files of numbers say, and nothing that was typed by hand."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from proving_ground.minimum_sizes import MINIMUM_SIZES
from proving_ground.publishing.blocks import blocks
from proving_ground.publishing.page import filled, publish
from proving_ground.scoring import oracle
from proving_ground.scoring.card import read_card, write_card
from proving_ground.scoring.oracle import oracle_lines, read_shares, shares, write_shares
from proving_ground.scoring.outcome import Judged, judge
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.errors import UserError

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = """# Proof
<!-- numbers: rates -->
what stood here before
<!-- end -->
kept
<!-- numbers: oracle -->
<!-- end -->
<!-- numbers: versions -->
<!-- end -->
"""


def case(name: str, truth: Sequence[str], said: Sequence[str], removed: float = 0.9) -> Judged:
    stratum = "single" if truth else "healthy"
    causes = [{"effect": effect, "size_factor": 3.0} for effect in truth]
    findings = [
        {"effect": effect, "parameters": {}, "proof": {"excess_removed": removed}}
        for effect in said
    ]
    diagnosis = {"verdict": "named" if said else "none", "findings": findings}
    run = {"seconds": 3.0, "processor": 5.0, "memory": 100.0}
    answer = {"stratum": stratum, "kind": "A", "causes": causes}
    return judge(name, answer, diagnosis, run)


def scored(folder: Path, version: str, cases: Sequence[Judged]) -> Path:
    about: Mapping[str, Any] = {"version": version, "commitment": f"of {version}"}
    write_card(folder, cases, dict(about))
    return folder


def test_the_published_page_holds_the_published_numbers() -> None:
    text = (DOCS / "proof.md").read_text(encoding="utf-8")
    assert filled(text, blocks(DOCS / "proof"), "proof.md") == text


def test_a_card_is_read_as_it_was_written(tmp_path: Path) -> None:
    cases = [case("a", ["icing"], ["icing"]), case("b", [], ["vane_offset"]), case("c", [], [])]
    card = read_card(scored(tmp_path / "score", "one", cases) / "score.json")
    assert list(card.judged) == cases
    assert card.rates[0].hits == 1 and card.rates[0].total == 2
    with pytest.raises(UserError, match="no score card"):
        read_card(tmp_path / "nothing.json")


def test_a_new_version_takes_the_page_and_the_old_one_is_kept(tmp_path: Path) -> None:
    page = tmp_path / "proof.md"
    page.write_text(PAGE)
    publish(page, [scored(tmp_path / "one", "one", [case("a", [], ["icing"])])])
    before = page.read_text()
    assert "| a name in a healthy recording | 100.0 % (1/1) |" in before
    assert "what stood here before" not in before and "\nkept\n" in before
    assert "Not measured yet." in before
    drawn = publish(page, [scored(tmp_path / "two", "two", [case("a", [], [])] * 2)])
    after = page.read_text()
    assert "| a name in a healthy recording | 0.0 % (0/2) |" in after
    assert "| what | one | two | newest 2 together | promised |" in after
    # One of three: Clopper and Pearson's interval from tables.
    row = "| a name in a healthy recording | 100 % (1/1) | 0 % (0/2) | 33 % (1/3), 1 to 91 % |"
    assert row in after
    assert all(path.stat().st_size for path in drawn)
    publish(page, [])
    assert page.read_text() == after


def test_how_large_an_effect_must_be_is_told_from_several_sets_together(tmp_path: Path) -> None:
    page = tmp_path / "proof.md"
    page.write_text("<!-- numbers: doses -->\n<!-- end -->\n")
    turned = case("a", ["vane_offset"], ["vane_offset"])
    small = [replace(turned, size=1.0, outcome="none", verdict="none", named=())] * 2
    publish(page, [scored(tmp_path / "one", "one", small)])
    assert "vane_offset" not in page.read_text()
    drawn = publish(page, [scored(tmp_path / "two", "two", [turned] * 2)])
    (row,) = re.findall(r"\| vane_offset \| (\S+) .*\| 4 \|", page.read_text())
    assert 1.0 < float(row) < 3.0
    assert [path.name for path in drawn][-1] == "proof_doses.png"


def test_a_page_that_asks_for_what_nobody_counts_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="asks for luck"):
        filled("<!-- numbers: luck -->\n<!-- end -->", {"rates": ""}, "page")
    with pytest.raises(UserError, match="no page"):
        publish(tmp_path / "none.md", [])
    (tmp_path / "page.md").write_text(PAGE)
    with pytest.raises(UserError, match="no numbers"):
        publish(tmp_path / "page.md", [tmp_path])


def test_everything_but_the_truth_can_be_taken_out_of_the_catalogue() -> None:
    assert set(MINIMUM_SIZES) == set(catalogue())


def test_the_oracle_fits_the_truth_alone_and_weighs_what_was_said_against_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: dict[str, list[str]] = {}

    def diagnose_with(
        folder: Path, name: str, station: str, timeout: float, *, options: list[str], kind: str
    ) -> None:
        told[name] = options
        target = folder / kind / name
        target.mkdir(parents=True)
        finding = {"effect": "icing", "proof": {"excess_removed": 0.8}}
        (target / "diagnosis.json").write_text(json.dumps({"findings": [finding]}))

    monkeypatch.setattr(oracle, "run_one", diagnose_with)
    cases = [
        case("good", ["icing"], ["icing"], 0.8),
        case("other", ["icing"], ["vane_offset"], 0.2),
        case("missed", ["icing"], []),
        case("healthy", [], []),
    ]
    entries = {j.name: {"healthy": "station-1"} for j in cases}
    (tmp_path / "manifest.json").write_text(json.dumps({"recordings": entries}))
    found = shares(tmp_path, cases)
    assert {s.name: s.share for s in found} == pytest.approx(
        {"good": 1.0, "other": 0.25, "missed": 0.0}
    )
    assert "vane_offset" in told["good"] and "icing" not in told["good"]
    assert read_shares(write_shares(tmp_path, found)) == found
    assert "in 1 of 1 " in oracle_lines(found)[0] and "in 1 of 3 " in oracle_lines(found)[1]
