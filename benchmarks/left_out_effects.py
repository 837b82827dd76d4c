"""What the diagnosis says when the true effect is not in its catalogue.

    python -m proving_ground devset -o devset
    python benchmarks/left_out_effects.py devset

Each single effect at three times its smallest size is diagnosed with that effect taken out. Right
answers are `unknown`, an ambiguous set, and `none` where the effect cannot be seen even with its
name; a single name is wrong.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import yaml

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.learning import learn
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.recordings import read_recording


def main() -> None:
    """Print one row per recording, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="development set")
    parser.add_argument("stations", nargs="*", help="of the set; none: all")
    arguments = parser.parse_args()
    answers = yaml.safe_load((arguments.folder / "answers.yaml").read_text())
    known = catalogue()
    counts: Counter[str] = Counter()
    print("| recording | left out | verdict | said |\n|---|---|---|---|")
    for station in sorted(p for p in arguments.folder.iterdir() if p.is_dir()):
        if arguments.stations and station.name not in arguments.stations:
            continue
        baseline = learn([read_recording(p) for p in sorted(station.glob("healthy-*"))])
        for folder in sorted(station.glob("*-3")):
            name = f"{station.name}/{folder.name}"
            truth = {entry["effect"] for entry in answers[name]}
            if len(truth) != 1 or not truth <= set(known):
                continue
            rest = {key: effect for key, effect in known.items() if key not in truth}
            found = diagnose(read_recording(folder), baseline, rest, with_proof=False)
            said = " + ".join(f.term.effect.name for f in found.findings)
            counts[found.verdict] += 1
            print(f"| {name} | {', '.join(truth)} | {found.verdict} | {said} |", flush=True)
    print(f"\n{sum(counts.values())} recordings: {dict(counts)}")


if __name__ == "__main__":
    main()
