"""How healthy recordings resist effects that they do not have: a check of the comparison itself.

    OPENBLAS_NUM_THREADS=1 python benchmarks/healthy_resistance.py FOLDER [FOLDER ...]

Each folder holds the healthy recordings of one station. Each of them is compared with the station
as the others teach it, without and with each effect in `TIMES` its smallest size: the cost in the
noise of the healthy station, and twice the negative log-likelihood in the noise that the effect
itself leaves, should both rise. Where healthy days would rather have an effect, the simulation or
the comparison is wrong, and no threshold mends it.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.signatures import Template
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.recordings import read_recording

WORKERS = 2
TIMES = 3.0


def main() -> None:
    """Print one table per station: of each effect the median and the least rise."""
    folders = [Path(name) for name in sys.argv[1:]]
    if not folders:
        print(__doc__)
        return
    for folder in folders:
        recordings = sorted(folder.glob("healthy-*"))
        if len(recordings) < 2:
            print(f"{folder}: fewer than two recordings called healthy-*.")
            continue
        print(f"\n{folder}: rise over {len(recordings)} recordings, median (least)\n")
        print("| effect | in the healthy noise | in its own noise |")
        print("|---|---|---|")
        rises: dict[str, list[tuple[float, float]]] = defaultdict(list)
        for one in recordings:
            others = [read_recording(other) for other in recordings if other != one]
            for effect, rise in _rises(one, learn(others, workers=WORKERS)):
                rises[effect].append(rise)
        for effect, found in sorted(rises.items(), key=lambda item: min(item[1])[1]):
            usual, least = np.median(found, axis=0), np.min(found, axis=0)
            print(
                f"| {effect} | {usual[0]:.0f} ({least[0]:.0f}) | {usual[1]:.0f} ({least[1]:.0f}) |"
            )


def _rises(folder: Path, baseline: Baseline) -> list[tuple[str, tuple[float, float]]]:
    """Rise of the cost and of the deviance by each effect in one recording."""
    recording = read_recording(folder)
    known = baseline.for_station(recording.station)
    comparison = prepare(recording, known.station, known.place)
    searcher = searcher_of(comparison, known, catalogue(), {}, WORKERS)
    found = []
    for template in searcher.bank.templates:
        rise = _rise(searcher, template) if template.number == 0 else None
        if rise is not None:
            found.append((f"{template.effect.name} ({template.instrument})", rise))
    return found


def _rise(searcher: Searcher, template: Template) -> tuple[float, float] | None:
    effect = template.effect
    size = effect.relative_size(template.values)
    if size <= 0.0 or effect.legible:
        return None
    values = effect.scaled(template.values, TIMES / size)
    term = Term(effect, template.instrument, values)
    simulated = searcher.comparison.possible(planted(searcher.station, [term]))
    if simulated is None:
        return None
    healthy = searcher.bank.without
    before, after = searcher.whitener(healthy), searcher.whitener(simulated)
    cost = [float(np.sum(before.of(seen) ** 2)) for seen in (healthy, simulated)]
    return cost[1] - cost[0], after.deviance(simulated) - before.deviance(healthy)


if __name__ == "__main__":
    main()
