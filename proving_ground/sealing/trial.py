"""Diagnose every recording of a sealed set in a process that sees nothing but the recording."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.progress import track

import wind_sensors
from proving_ground.sealing.seal import HEALTHY, MANIFEST, RECORDINGS
from wind_sensors import __version__
from wind_sensors.errors import UserError
from wind_sensors.processes import ONE_THREAD

RUNS = "runs"
RUN_FILE = "run.json"
LOG_FILE = "diagnose.log"
DIAGNOSIS = "diagnosis.json"
PROGRAM_FILE = "program.json"
BASELINES = "baselines"
PROGRAM = (sys.executable, "-m", "wind_sensors.cli")
PASSED_ON = ("PATH", "HOME", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "VIRTUAL_ENV", "PYTHONPATH")


@dataclass(frozen=True)
class Run:
    """How one diagnosis went: exit status (-1: out of time), seconds on the clock and of
    processors, and peak memory [MB]."""

    status: int
    seconds: float
    processor: float
    memory: float


def fingerprint(package: Path) -> str:
    """Of a package's Python files: the same for a checkout and what was installed from it."""
    digest = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        digest.update(file.relative_to(package).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:12]


def program_version() -> dict[str, Any]:
    """What diagnoses: version, the commit of a checkout (with + where files differ from it), a
    fingerprint of its files, the day, and the processors of the machine.

    An installed program knows no commit: which one it is the fingerprint tells.
    """
    root = Path(__file__).resolve().parents[2]

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(root), *words], capture_output=True, text=True, check=False
        )
        return done.stdout.strip() if done.returncode == 0 else ""

    commit = git("rev-parse", "--short", "HEAD") if (root / ".git").exists() else ""
    changed = "+" if commit and git("status", "--porcelain", "--", "wind_sensors") else ""
    return {
        "version": f"{commit}{changed}" or __version__,
        "source": fingerprint(Path(wind_sensors.__file__).parent),
        "day": time.strftime("%Y-%m-%d", time.gmtime()),
        "processors": os.cpu_count() or 1,
    }


def read_manifest(folder: Path) -> dict[str, Any]:
    """The public part of a sealed set. Raises UserError if there is none."""
    path = folder / MANIFEST
    if not path.is_file():
        raise UserError("this is not a sealed set", str(folder), "`wind prove seal` makes one.")
    manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return manifest


def run_all(
    folder: Path,
    *,
    jobs: int = 1,
    timeout: float = 300.0,
    options: Sequence[str] = (),
    program: Sequence[str] = PROGRAM,
    results: Path | None = None,
    only: Collection[str] | None = None,
) -> int:
    """Diagnose what has not been diagnosed yet; how many diagnoses failed.

    Each station's baseline is learnt once from its healthy recordings. options are added to the
    command line of `wind diagnose`; program is what stands for `wind`. Baselines and diagnoses go
    to `results`; None: into the set itself. only: names of the recordings to diagnose; None: all.

    Raises UserError if a baseline cannot be learnt.
    """
    manifest = read_manifest(folder)
    results = results or folder
    todo = [
        (name, entry)
        for name, entry in manifest["recordings"].items()
        if not (results / RUNS / name / RUN_FILE).exists() and (only is None or name in only)
    ]
    stations = sorted({str(entry["healthy"]) for _, entry in todo})

    def learn(station: str) -> Run | None:
        return learn_baseline(folder, station, program, results)

    def one(item: tuple[str, dict[str, Any]]) -> Run:
        name, entry = item
        left_out = [w for effect in entry.get("without", []) for w in ("--without", str(effect))]
        return run_one(
            folder, name, str(entry["healthy"]), timeout, program, [*left_out, *options], results
        )

    (results / RUNS).mkdir(parents=True, exist_ok=True)
    (results / RUNS / PROGRAM_FILE).write_text(json.dumps(program_version()), encoding="utf-8")
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        list(track(pool.map(learn, stations), "learning baselines", total=len(stations)))
        runs = list(track(pool.map(one, todo), "diagnosing", total=len(todo)))
    return sum(run.status != 0 for run in runs)


def learn_baseline(
    folder: Path, station: str, program: Sequence[str] = PROGRAM, results: Path | None = None
) -> Run | None:
    """Learn what is normal for a station, in a folder that holds its healthy recordings alone;
    None where that was done before.

    Raises UserError if it fails.
    """
    target = (results or folder) / BASELINES / f"{station}.json"
    if target.exists():
        return None
    target.parent.mkdir(parents=True, exist_ok=True)
    log = target.with_suffix(".log")
    with tempfile.TemporaryDirectory(prefix="wind-prove-") as place:
        room = Path(place)
        _bring(folder / HEALTHY / station, room / "healthy")
        healthy = sorted(str(p.relative_to(room)) for p in (room / "healthy").iterdir())
        run = _supervise([*program, "baseline", *healthy, "-o", "baseline.json"], room, log, 900.0)
        if run.status or not (room / "baseline.json").exists():
            raise UserError("no baseline could be learnt", str(log), "The log says why.")
        shutil.copy(room / "baseline.json", target)
    return run


def run_one(
    folder: Path,
    name: str,
    station: str,
    timeout: float,
    program: Sequence[str] = PROGRAM,
    options: Sequence[str] = (),
    results: Path | None = None,
    kind: str = RUNS,
) -> Run:
    """Diagnose one recording in a folder of its own, with an environment of its own.

    Its baseline is among those of `results`, and there, among the runs of this kind, goes what is
    kept; None: in the set itself.
    """
    results = results or folder
    target = results / kind / name
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="wind-prove-") as place:
        room = Path(place)
        _bring(folder / RECORDINGS / name, room / "recording")
        shutil.copy(results / BASELINES / f"{station}.json", room / "baseline.json")
        command = [*program, "diagnose", "recording", "--baseline", "baseline.json"]
        run = _supervise([*command, "-o", "out", *options], room, target / LOG_FILE, timeout)
        for path in (room / "out").glob("*"):
            if path.name in (DIAGNOSIS, "report.html", "station_corrected.yaml"):
                shutil.copy(path, target / path.name)
    (target / RUN_FILE).write_text(json.dumps(asdict(run)), encoding="utf-8")
    return run


def _bring(source: Path, target: Path) -> None:
    """Copy a folder, by hard links where the file system allows."""

    def link(one: str, other: str) -> None:
        try:
            os.link(one, other)
        except OSError:
            shutil.copy2(one, other)

    shutil.copytree(source, target, copy_function=link)


def _supervise(command: Sequence[str], room: Path, log: Path, timeout: float) -> Run:
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    root = str(Path(__file__).resolve().parents[2])
    known = environment.get("PYTHONPATH", "")
    environment["PYTHONPATH"] = f"{root}{os.pathsep}{known}" if known else root
    environment.update(ONE_THREAD)
    begun = time.monotonic()
    with log.open("wb") as output:
        process = subprocess.Popen(
            command, cwd=room, env=environment, stdout=output, stderr=subprocess.STDOUT
        )
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                process.returncode = os.waitstatus_to_exitcode(status)
                break
            if time.monotonic() - begun > timeout:
                process.kill()
                _, _, usage = os.wait4(process.pid, 0)
                process.returncode = -1
                break
            time.sleep(0.02)
    return Run(
        process.returncode,
        time.monotonic() - begun,
        usage.ru_utime + usage.ru_stime,
        usage.ru_maxrss / 1024.0,
    )
