"""Sealing hides, commits, isolates and opens; scoring counts what it should."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from proving_ground.generate import RecordingSpec
from proving_ground.minimum_sizes import MINIMUM_SIZES
from proving_ground.scoring.again import chance, changes, lines
from proving_ground.scoring.card import is_failure
from proving_ground.scoring.dose import dose_response
from proving_ground.scoring.figures import confusion
from proving_ground.scoring.intervals import covered
from proving_ground.scoring.outcome import Judged, judge
from proving_ground.scoring.rates import clopper_pearson, promised_rates
from proving_ground.sealing.cipher import commitment, decrypt, encrypt, new_key
from proving_ground.sealing.opening import judge_all, judge_said, open_answers, score
from proving_ground.sealing.seal import ANSWERS, MANIFEST, RECORDINGS, Sealed, seal
from proving_ground.sealing.strata import SHARES, SIZES, counts, make_plan
from proving_ground.sealing.trial import fingerprint, run_all
from wind_sensors.errors import UserError

KEY = bytes(range(32))
SPY = """
import json, os, pathlib, sys
target = pathlib.Path(sys.argv[sys.argv.index("-o") + 1])
if sys.argv[1] == "baseline":
    target.write_text("{}")
    sys.exit(0)
target.mkdir()
seen = sorted(str(p) for p in pathlib.Path(".").rglob("*"))
said = {"cwd": os.getcwd(), "seen": seen, "environment": dict(os.environ), "told": sys.argv}
print(json.dumps(said))
verdict = {"verdict": "named", "findings": [{"effect": "vane_offset", "parameters": {}}]}
(target / "diagnosis.json").write_text(json.dumps(verdict))
"""


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Sealed:
    folder = tmp_path_factory.mktemp("sealed") / "set"
    return seal(
        folder,
        2,
        3,
        KEY,
        minutes=0.4,
        healthy_count=1,
        kinds="A",
        strata={"healthy": 1, "single": 1},
    )


def judged(
    truth: tuple[str, ...] = (),
    verdict: str = "none",
    findings: Sequence[Mapping[str, object]] = (),
    size: float = 3.0,
    stratum: str = "single",
    without: Sequence[str] = (),
) -> Judged:
    causes = [{"effect": effect, "size_factor": size} for effect in truth]
    answer = {"stratum": stratum, "kind": "A", "causes": causes, "without": list(without)}
    diagnosis = {"verdict": verdict, "findings": list(findings)}
    return judge("x", answer, diagnosis, {"seconds": 3.0, "processor": 5.0, "memory": 100.0})


def test_a_sealed_text_opens_with_its_key_and_with_no_other() -> None:
    plain = b"bearing_friction" * 100
    hidden = encrypt(KEY, plain)
    assert decrypt(KEY, hidden) == plain
    assert plain[:16] not in hidden
    with pytest.raises(UserError, match="does not open"):
        decrypt(new_key(), hidden)


def test_a_changed_text_does_not_open() -> None:
    hidden = bytearray(encrypt(KEY, b"none"))
    hidden[18] ^= 1
    with pytest.raises(UserError):
        decrypt(KEY, bytes(hidden))


def test_a_sealed_set_tells_nothing_but_its_commitment(sealed: Sealed) -> None:
    answers = open_answers(sealed.folder, KEY)
    causes = [c["effect"] for a in answers.values() for c in a["causes"]]
    assert len(causes) == 1
    for path in sealed.folder.rglob("*"):
        assert causes[0] not in path.name
        if path.suffix in (".json", ".yaml", ".sealed"):
            assert causes[0].encode() not in path.read_bytes()
    assert json.loads((sealed.folder / MANIFEST).read_text())["commitment"] == sealed.commitment


def test_answers_swapped_after_sealing_are_refused(sealed: Sealed, tmp_path: Path) -> None:
    other = {"salt": "0", "answers": {}}
    (tmp_path / MANIFEST).write_text((sealed.folder / MANIFEST).read_text())
    (tmp_path / ANSWERS).write_bytes(encrypt(KEY, json.dumps(other).encode()))
    with pytest.raises(UserError, match="committed"):
        open_answers(tmp_path, KEY)
    assert commitment(b"a") != commitment(b"b")


def test_the_diagnosing_process_sees_the_recording_and_nothing_else(
    sealed: Sealed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spy = tmp_path / "spy.py"
    spy.write_text(SPY)
    monkeypatch.setenv("PROVE_SECRET", KEY.hex())
    assert run_all(sealed.folder, program=(sys.executable, str(spy))) == 0
    names = [p.name for p in (sealed.folder / RECORDINGS).iterdir()]
    for name in names:
        log = (sealed.folder / "runs" / name / "diagnose.log").read_text()
        spied = json.loads(log)
        assert KEY.hex() not in log
        assert str(sealed.folder) not in log
        assert not [p for p in spied["seen"] if "answers" in p or "manifest" in p or name in p]
        assert "recording/recording.yaml" in spied["seen"]
    results = judge_all(sealed.folder, open_answers(sealed.folder, KEY))
    healthy = next(j for j in results if j.stratum == "healthy")
    assert healthy.outcome == "wrong name"


def test_another_program_answers_beside_the_first(sealed: Sealed, tmp_path: Path) -> None:
    spy = tmp_path / "spy.py"
    spy.write_text(SPY.replace("vane_offset", "icing"))
    (name, *_) = sorted(p.name for p in (sealed.folder / RECORDINGS).iterdir())
    program = (sys.executable, str(spy))
    assert run_all(sealed.folder, program=program, results=tmp_path / "new", only=[name]) == 0
    (now,) = judge_said(tmp_path / "new", open_answers(sealed.folder, KEY))
    assert (now.name, now.named) == (name, ("icing",))
    earlier = judge_said(sealed.folder, open_answers(sealed.folder, KEY))
    assert all(j.named == ("vane_offset",) for j in earlier)


def test_a_fingerprint_tells_programs_apart_wherever_they_lie(tmp_path: Path) -> None:
    for place, line in (("checkout", "a = 1"), ("installed", "a = 1"), ("later", "a = 2")):
        (tmp_path / place / "room").mkdir(parents=True)
        (tmp_path / place / "room" / "part.py").write_text(line)
    (tmp_path / "installed" / "room" / "part.cpython-311.pyc").write_bytes(b"compiled")
    checkout, installed, later = (
        fingerprint(tmp_path / p) for p in ("checkout", "installed", "later")
    )
    assert checkout == installed
    assert checkout != later
    (tmp_path / "later" / "room" / "part.py").rename(tmp_path / "later" / "room" / "other.py")
    assert fingerprint(tmp_path / "later") != later


def test_only_what_is_answered_differently_is_compared() -> None:
    vane = [{"effect": "vane_offset"}]
    right, silent = judged(("vane_offset",), "named", vane), judged(("vane_offset",))
    assert changes([right], [right]) == []
    (change,) = changes([silent], [right])
    assert (change.before.verdict, change.after.verdict) == ("none", "named")
    # Five gained and none lost: 2 / 2^5.
    assert chance([change] * 5) == pytest.approx(1 / 16)
    assert chance([]) == 1.0
    page = "\n".join(lines([silent], [right]))
    assert "| none (failure) | vane_offset |" in page
    assert "| failures, of 1 | 1 | 0 |" in page


def test_answers_stay_shut_until_all_is_said(sealed: Sealed, tmp_path: Path) -> None:
    copy = tmp_path / "set"
    shutil.copytree(sealed.folder, copy, ignore=shutil.ignore_patterns("runs"))
    with pytest.raises(UserError, match="2 recordings have not been diagnosed"):
        score(copy, KEY, tmp_path / "score")
    assert score(copy, KEY, tmp_path / "score", partial=True)[0].total == 0


def test_opening_writes_a_card_that_lists_the_failures(sealed: Sealed, tmp_path: Path) -> None:
    rates = score(sealed.folder, KEY, tmp_path / "score")
    page = (tmp_path / "score" / "score.md").read_text()
    missing = [j for j in judge_all(sealed.folder, open_answers(sealed.folder, KEY))]
    assert all(j.name in page for j in missing if j.stratum == "healthy")
    assert next(r for r in rates if "healthy" in r.title).total == 1
    with pytest.raises(UserError, match="already"):
        score(sealed.folder, KEY, tmp_path / "score")


@pytest.mark.parametrize("total", [1, 7, 60, 333])
def test_strata_add_up(total: int) -> None:
    assert sum(counts(total).values()) == total
    assert set(counts(total)) == set(SHARES)


def test_single_effects_come_at_every_size_and_every_effect_before_any_again() -> None:
    plan = make_plan(0, np.random.default_rng(1), 1.0, 1, "AB", {"single": 60})
    planted = [c.spec.planted[0] for c in plan.cases]
    assert all(
        p.size_factor in {min(size, MINIMUM_SIZES[p.effect].most) for size in SIZES}
        for p in planted
    )
    count = {p.effect: 0 for p in planted}
    for each in planted:
        count[each.effect] += 1
    assert max(count.values()) - min(count.values()) <= 1
    seeds = [s.seed for s in all_specs(plan.healthy)] + [c.spec.seed for c in plan.cases]
    assert len(set(seeds)) == len(seeds)


def test_an_effect_taken_out_is_told_of_decoys_as_often_and_of_no_pair_that_hides() -> None:
    strata = {"withheld": 8, "healthy": 6, "single": 10, "pair": 40}
    plan = make_plan(0, np.random.default_rng(4), 1.0, 1, "ABC", strata)
    withheld = [c for c in plan.cases if c.stratum == "withheld"]
    decoys = [c for c in plan.cases if c.without and c.stratum != "withheld"]
    assert len(withheld) == len(decoys) == 8
    assert all(c.without == c.planted for c in withheld)
    assert not any(set(c.without) & set(c.planted) for c in decoys)
    told = [c.without[0] for c in [*withheld, *decoys]]
    assert set(told) <= set(MINIMUM_SIZES)
    assert not any("sensor_swap" in c.planted for c in plan.cases if c.stratum == "pair")


def test_no_pair_holds_an_effect_that_the_other_leaves_nothing_to_act_on() -> None:
    plan = make_plan(0, np.random.default_rng(7), 1.0, 1, "B", {"pair": 600})
    pairs = [set(c.planted) for c in plan.cases]
    dead_logs = [pair for pair in pairs if "platform_velocity" in pair]
    assert dead_logs
    assert not any(pair & {"platform_velocity_scale", "frame_error"} for pair in dead_logs)
    assert all(len(pair) == 2 for pair in pairs)


def test_the_manifest_tells_what_to_leave_out_and_the_diagnosis_is_told(tmp_path: Path) -> None:
    spy = tmp_path / "spy.py"
    spy.write_text(SPY)
    strata = {"withheld": 1, "healthy": 1}
    folder = tmp_path / "set"
    seal(folder, 2, 5, KEY, minutes=0.4, healthy_count=1, kinds="A", strata=strata)
    entries = json.loads((folder / MANIFEST).read_text())["recordings"]
    assert run_all(folder, program=(sys.executable, str(spy))) == 0
    for name, entry in entries.items():
        told = json.loads((folder / "runs" / name / "diagnose.log").read_text())["told"]
        assert told[told.index("--without") + 1] == entry["without"][0]
    (case,) = [j for j in judge_all(folder, open_answers(folder, KEY)) if j.stranger]
    assert case.without == (case.stranger,)


def all_specs(groups: tuple[tuple[RecordingSpec, ...], ...]) -> list[RecordingSpec]:
    return [spec for group in groups for spec in group]


def test_clopper_pearson_matches_published_values() -> None:
    assert clopper_pearson(0, 10) == pytest.approx((0.0, 0.3085), abs=1e-4)
    assert clopper_pearson(8, 10) == pytest.approx((0.4439, 0.9748), abs=1e-4)


def test_outcomes() -> None:
    one = ({"effect": "vane_offset"},)
    assert judged(("vane_offset",), "named", one).outcome == "exact"
    assert judged(("vane_inertia",), "named", one).outcome == "wrong name"
    pair = ({"effect": "vane_offset", "set": 1}, {"effect": "axis_tilt", "set": 1})
    assert judged(("axis_tilt",), "ambiguous", pair).outcome == "ambiguous with the truth"
    assert judged(("axis_tilt",), "ambiguous", pair).set_size == 2.0
    assert judged(("icing",), "ambiguous", pair).outcome == "wrong set"
    assert judged(("vane_offset", "icing"), "named", one).outcome == "partly"
    assert judged(("unknown",), "named", one, stratum="unknown").outcome == "wrong name"
    assert judged((), "none", stratum="healthy").outcome == "none"


def test_a_name_for_an_effect_taken_out_is_wrong_and_owning_up_is_right() -> None:
    title = "an effect taken out of the catalogue: unknown, or alternatives without a claim"
    one = ({"effect": "axis_tilt"},)
    pair = ({"effect": "axis_tilt", "set": 1}, {"effect": "icing", "set": 1})
    for verdict, findings, right in (
        ("unknown", (), 1), ("ambiguous", pair, 1), ("named", one, 0), ("none", (), 0),
    ):
        case = judged(("vane_offset",), verdict, findings, 3.0, "withheld", ("vane_offset",))
        rates = {r.title: r for r in promised_rates([case])}
        assert (rates[title].hits, rates[title].total) == (right, 1)
        assert is_failure(case) is not bool(right)
        assert rates["a confident wrong name, all recordings"].hits == (verdict == "named")
        assert rates["the exact effect, single, three times the minimum or more"].total == 0
        assert confusion([case])[0] == ["taken out"]


def test_a_recording_that_is_refused_is_no_crash() -> None:
    answer = {"stratum": "too_little", "kind": "A", "causes": []}
    run = {"seconds": 1.0, "processor": 1.0, "memory": 1.0}
    assert judge("x", answer, None, {**run, "status": 2}).outcome == "refused"
    assert judge("x", answer, None, {**run, "status": 1}).outcome == "failed"
    assert judge("x", answer, None, None).outcome == "failed"


def test_rates_count_the_cases_they_speak_of() -> None:
    cases = [
        judged((), "none", stratum="healthy"),
        judged((), "named", ({"effect": "icing"},), stratum="healthy"),
        judged(("vane_offset",), "named", ({"effect": "vane_offset"},)),
        judged(("vane_offset",), "none", size=1.0),
        judged(("unknown",), "unknown", stratum="unknown"),
    ]
    rates = {r.title: r for r in promised_rates(cases)}
    assert (rates["a name in a healthy recording"].hits, 2) == (1, 2)
    exact = rates["the exact effect, single, three times the minimum or more"]
    assert (exact.hits, exact.total) == (1, 1)
    wrong = rates["a confident wrong name, all recordings"]
    assert (wrong.hits, wrong.total) == (1, 5)
    rows, columns, table = confusion(cases)
    assert table.sum() == len(cases)
    assert table[rows.index("none"), columns.index("icing")] == 1


def test_coverage_compares_what_means_the_same() -> None:
    cause = {"effect": "vane_offset", "offset_deg": -3.0}
    given = {"offset": {"value": -3.1, "low": -3.4, "high": -2.9}}
    diagnosis = {"findings": [{"effect": "vane_offset", "parameters": given}]}
    (found,) = covered([cause], diagnosis)
    assert found.holds
    assert not covered([{"effect": "wake_shadow", "depth": 0.1}], diagnosis)


def test_the_dose_curve_finds_the_size_found_in_half() -> None:
    rng = np.random.default_rng(2)
    cases = []
    for size in np.tile(SIZES, 60):
        found = rng.random() < 1.0 / (1.0 + (2.0 / size) ** 4)
        findings = ({"effect": "vane_offset"},) if found else ()
        verdict = "named" if found else "none"
        cases.append(judged(("vane_offset",), verdict, findings, size=float(size)))
    dose = dose_response("all", cases)
    assert dose is not None
    assert dose.half == pytest.approx(2.0, rel=0.15)
    assert dose.ninety == pytest.approx(2.0 * 9.0**0.25, rel=0.25)


def test_no_single_effect_is_larger_than_an_instrument_in_use_can_have() -> None:
    plan = make_plan(300, np.random.default_rng(8), 1.0, 1, strata={"single": 300})
    sizes: dict[str, set[float]] = {}
    for case in plan.cases:
        for planted in case.spec.planted:
            sizes.setdefault(planted.effect, set()).add(planted.size_factor)
    assert max(sizes["axis_tilt"]) == 7.5
    assert max(sizes["wake_shadow"]) == 12.0
    assert all(size <= MINIMUM_SIZES[name].most for name, of in sizes.items() for size in of)
