"""`wind diagnose` without a measured reference: means, and platforms with a latent wind."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.text import Text

from wind_sensors.cli.baseline import read_healthy
from wind_sensors.cli.findings import print_finding
from wind_sensors.cli.screen import screen
from wind_sensors.diagnosis.latent.diagnose import diagnose_latent, is_latent
from wind_sensors.diagnosis.means.diagnose import diagnose_means, is_of_means
from wind_sensors.diagnosis.means.healthy import learn_means
from wind_sensors.diagnosis.outcome import Outcome, with_silent
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.reading import read_series
from wind_sensors.report.outcome_files import write_outcome
from wind_sensors.report.removed import removed_text
from wind_sensors.report.sizes import sizes_of
from wind_sensors.station.model import Rotor
from wind_sensors.station.signals import Recording, Series
from wind_sensors.station.silence import silent_instruments

DEVIATION = "_deviation"
"""A rotor's topic with this behind it holds the standard deviations of its means."""


def other_reference(recording: Recording) -> bool:
    """Whether a recording has another reference than a measured wind."""
    return is_of_means(recording) or is_latent(recording)


def deviations_of(path: str, recording: Recording) -> Mapping[str, Series]:
    """Standard deviations of the rotors' speeds, where the bag has them."""
    found = {}
    for instrument in recording.station.instruments:
        if isinstance(instrument, Rotor):
            try:
                found[instrument.name] = read_series(path, instrument.pulses.topic + DEVIATION)
            except UserError:
                continue
    return found


def diagnose_otherwise(
    options: argparse.Namespace, recording: Recording, progress: Progress
) -> int:
    """Diagnose with what there is, write, and say so; 0 whatever the verdict.

    Raises:
        UserError: The recording does not suffice, or a baseline of another kind is given, or a
            catalogue that cannot be used.
    """
    if options.baseline is not None:
        raise UserError(
            "a baseline file is for recordings with a measured reference.",
            str(options.baseline),
            "Give the healthy recordings with --healthy.",
        )
    if options.without:
        raise UserError(
            "effects can be taken out of the catalogue only where a reference wind was measured.",
            "--without",
            "Leave it out for this recording.",
        )
    report = _reporter(progress)
    if is_of_means(recording):
        outcome = _of_means(options, recording, report)
    else:
        outcome = diagnose_latent(recording, report)
    outcome = with_silent(outcome, silent_instruments(recording, recording.station))
    with refused_in_words(options.output):
        written = write_outcome(options.output, outcome)
    progress.stop()
    print_outcome(screen(), outcome)
    for path in written:
        print(f"wrote {path}")
    return 0


def _reporter(progress: Progress) -> Callable[[str, float], None]:
    tasks: dict[str, TaskID] = {}

    def report(phase: str, share: float) -> None:
        if phase not in tasks:
            tasks[phase] = progress.add_task(phase, total=1.0)
        progress.update(tasks[phase], completed=share)

    return report


def _of_means(
    options: argparse.Namespace, recording: Recording, report: Callable[[str, float], None]
) -> Outcome:
    known = read_healthy(
        options.healthy, options.station, options.recording, recording.station
    )
    healthy = [
        (one, deviations_of(path, one)) for path, one in zip(options.healthy, known, strict=True)
    ]
    deviations = deviations_of(options.recording, recording)
    return diagnose_means(recording, deviations, learn_means(healthy), report)


def print_outcome(console: Console, outcome: Outcome) -> None:
    """Verdict and findings for people."""
    console.print(Text.assemble((outcome.recording, "bold"), f": {outcome.verdict}"))
    for f in outcome.findings:
        # When a sensor stood still is what its place says.
        told = f.term.effect.name != "stuck_sensor"
        sizes = sizes_of(f, outcome.station, outcome.start) if told else []
        removed = "" if f.proof is None else removed_text(f.proof)
        print_finding(console, f, sizes, f.located.region.label, removed)
    if outcome.left_over:
        console.print(f"left over: {outcome.left_over}")
    if outcome.declined:
        count = len(outcome.declined)
        what = "1 thing was" if count == 1 else f"{count} things were"
        console.print(f"{what} seen and not claimed: report.html says what, and why")
    if not outcome.calibrated:
        console.print("null not calibrated: give --healthy recordings of the same station")
