"""Check the commitment and bring answers and diagnoses together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from proving_ground.scoring.card import write_card
from proving_ground.scoring.outcome import Judged, judge
from proving_ground.scoring.rates import Rate
from proving_ground.sealing.cipher import commitment, decrypt
from proving_ground.sealing.seal import ANSWERS
from proving_ground.sealing.trial import DIAGNOSIS, PROGRAM_FILE, RUN_FILE, RUNS, read_manifest
from wind_sensors.errors import UserError


def open_answers(folder: Path, key: bytes) -> dict[str, Any]:
    """The answers of a sealed set, after checking them against the commitment."""
    answers: dict[str, Any] = open_sealed(folder, key)["answers"]
    return answers


def open_sealed(folder: Path, key: bytes) -> dict[str, Any]:
    """All that was sealed: the answers and how the set was drawn.

    Raises UserError if the key is wrong or the answers are not those committed to.
    """
    promised = str(read_manifest(folder)["commitment"])
    plain = decrypt(key, (folder / ANSWERS).read_bytes())
    if commitment(plain) != promised:
        raise UserError(
            "the answers are not those that were committed to",
            str(folder / ANSWERS),
            "Somebody changed the manifest or the answers after sealing.",
        )
    found: dict[str, Any] = json.loads(plain)
    return found


def judge_all(results: Path, answers: dict[str, Any]) -> list[Judged]:
    """Every recording's outcome, in the order of the answers; results: where the runs are."""
    return [
        judge(
            name,
            answer,
            _load(results / RUNS / name / DIAGNOSIS),
            _load(results / RUNS / name / RUN_FILE),
        )
        for name, answer in answers.items()
    ]


def judge_said(results: Path, answers: dict[str, Any]) -> list[Judged]:
    """The outcomes of those recordings alone that were diagnosed."""
    said = {n: a for n, a in answers.items() if (results / RUNS / n / RUN_FILE).is_file()}
    return judge_all(results, said)


def _load(path: Path) -> dict[str, Any] | None:
    if not path.is_file():
        return None
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def about_set(folder: Path, sealed: dict[str, Any]) -> dict[str, Any]:
    """What a set is and what diagnosed it, for the head of a page."""
    answers, drawing = sealed["answers"], sealed["drawing"]
    return {
        **(_load(folder / RUNS / PROGRAM_FILE) or {}),
        "commitment": read_manifest(folder)["commitment"],
        "seed": drawing["seed"],
        "sealed": len(answers),
        "stations": len({a["station"] for a in answers.values()}),
        "minutes": drawing["minutes"],
        "healthy recordings of each station": drawing["healthy_count"],
    }


def check_all_said(folder: Path) -> None:
    """Raises UserError if a recording of a sealed set was not diagnosed yet."""
    names = read_manifest(folder)["recordings"]
    missing = sum(not (folder / RUNS / name / RUN_FILE).is_file() for name in names)
    if missing:
        raise UserError(
            f"{missing} recordings have not been diagnosed yet",
            str(folder),
            "`wind prove run` goes on where it stopped; `open --partial` scores what there is.",
        )


def score(
    folder: Path, key: bytes, output: Path, *, force: bool = False, partial: bool = False
) -> list[Rate]:
    """Open a sealed set and write its score card, of what was diagnosed alone where `partial`.

    Raises UserError if the output exists and `force` is not given, or if something was not
    diagnosed yet and `partial` is not given: answers must not be seen before all is said.
    """
    if output.exists() and not force:
        raise UserError("there is a score already", str(output), "Add --force to replace it.")
    if not partial:
        check_all_said(folder)
    sealed = open_sealed(folder, key)
    answers = sealed["answers"]
    judged = judge_said(folder, answers)
    about = {
        **about_set(folder, sealed),
        "not diagnosed": len(answers) - len(judged),
        "peak memory [MB]": round(max((j.memory for j in judged), default=0.0)),
    }
    rates = write_card(output, judged, about)
    (output / "answers.json").write_text(json.dumps(answers, indent=1), encoding="utf-8")
    return rates
