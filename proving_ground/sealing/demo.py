"""One concealed case from sealing to opening, told as it happens."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path

from rich.console import Console

from proving_ground.scoring.wording import answer_line, verdict_line
from proving_ground.sealing.cipher import new_key
from proving_ground.sealing.opening import open_answers, score
from proving_ground.sealing.seal import RECORDINGS, seal
from proving_ground.sealing.trial import DIAGNOSIS, RUNS, run_all
from wind_sensors.errors import UserError

MINUTES = 10.0
HEALTHY_COUNT = 4


def play(folder: Path, seed: int, *, force: bool = False) -> None:
    """Seal one recording of a mast with a concealed cause, diagnose it blind, open the answer.

    Raises UserError if the folder exists and `force` is not given.
    """
    if folder.exists():
        if not force:
            raise UserError("the folder exists already", str(folder), "Add --force to replace it.")
        shutil.rmtree(folder)
    say = Console().print
    begun = time.monotonic()
    key = new_key()
    say("[bold]1. Seal.[/bold] A random station, a random cause, hidden with a random key.")
    sealed = seal(
        folder,
        1,
        seed,
        key,
        minutes=MINUTES,
        healthy_count=HEALTHY_COUNT,
        kinds="A",
        strata={"large": 1},
    )
    say(f"   commitment {sealed.commitment}")
    name = next((folder / RECORDINGS).iterdir()).name
    say(f"[bold]2. Diagnose[/bold] {name} in a process that has only the recordings.")
    run_all(folder)
    diagnosis = folder / RUNS / name / DIAGNOSIS
    if not diagnosis.exists():
        raise UserError(
            "the diagnosis left no verdict", str(diagnosis.parent), "Its log says what happened."
        )
    verdict = json.loads(diagnosis.read_text(encoding="utf-8"))
    say(f"   {verdict_line(verdict)}", markup=False)
    say("[bold]3. Open[/bold] with the key, after checking the commitment.")
    answer = open_answers(folder, key)[name]
    for cause in answer["causes"]:
        say(f"   concealed: {answer_line(cause)}", markup=False)
    score(folder, key, folder / "score")
    say(f"   report: {diagnosis.with_name('report.html')}")
    say(f"   {time.monotonic() - begun:.0f} s from sealing to opening")
