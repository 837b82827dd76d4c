"""A set of causes that somebody chose, for those who work on one effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proving_ground.concealed.strangers import STRANGERS
from proving_ground.generate import Planted, healthy, with_effect
from proving_ground.minimum_sizes import MINIMUM_SIZES, applicable
from proving_ground.sealing.strata import FIRST_SCORING_STATION, Case, Plan
from proving_ground.stations import Station, random_station
from wind_sensors.errors import UserError

HOW = "Write EFFECT:SIZE[@BEGIN[-END]], several joined by +, as in icing:4@0.4+vane_offset:3."


def parse_causes(text: str) -> tuple[Planted, ...]:
    """What is concealed in one recording, from text such as `icing:4@0.4-0.9+vane_offset:3`.

    Sizes are multiples of an effect's smallest; begin and end are shares of the record; `none`
    conceals nothing. Raises UserError if it cannot be read or names no known cause.
    """
    return () if text == "none" else tuple(_one(part, text) for part in text.split("+"))


def _one(part: str, text: str) -> Planted:
    effect, _, size = part.partition(":")
    size, _, interval = size.partition("@")
    begin, _, end = interval.partition("-")
    if effect not in MINIMUM_SIZES and effect not in STRANGERS:
        raise UserError(f"no cause is called {effect!r}", f"--cause {text}", HOW)
    try:
        planted = Planted(
            effect,
            float(size),
            float(begin) if begin else None,
            float(end) if end else None,
        )
    except ValueError as error:
        raise UserError(f"{part!r} cannot be read ({error})", f"--cause {text}", HOW) from None
    within = 0.0 <= (planted.begin or 0.0) < (1.0 if planted.end is None else planted.end) <= 1.0
    if not within or not planted.size_factor > 0.0:
        raise UserError(
            f"{part!r} has no size above nought, or an interval outside of 0 to 1",
            f"--cause {text}",
            HOW,
        )
    return planted


def chosen_plan(
    causes: Sequence[str],
    rng: np.random.Generator,
    minutes: float,
    healthy_count: int,
    kinds: str,
) -> tuple[Plan, list[str]]:
    """Each of `causes` on each station of `kinds` where it can show (a kind said twice is two
    stations), with names that tell which is which.

    The stations are among those that no scoring set draws. Raises UserError if a cause cannot be
    read, or if none can show on any of the stations.
    """
    wanted = [(text, parse_causes(text)) for text in causes]
    numbers = rng.choice(FIRST_SCORING_STATION, len(kinds), replace=False)
    stations = tuple(random_station(k, int(n)) for k, n in zip(kinds, numbers, strict=True))
    size = len(stations) * (len(wanted) + healthy_count)
    seeds = iter(rng.permutation(2**20)[:size].tolist())
    well = tuple(
        tuple(healthy(station, next(seeds), minutes) for _ in range(healthy_count))
        for station in stations
    )
    cases, names = [], []
    for index, station in enumerate(stations):
        for text, planted in wanted:
            if not all(_can_show(p.effect, station) for p in planted):
                continue
            spec = with_effect(station, planted, 0.0, next(seeds), minutes)
            cases.append(Case(_stratum(planted), index, spec))
            names.append(f"{station.kind}{index + 1}-{text.replace(':', '_')}")
    if not cases:
        raise UserError(
            "none of the causes can show on these stations",
            f"--kinds {kinds}",
            "A mast does not move, and what happens within a turn shows from three slots on.",
        )
    return Plan(stations, well, tuple(cases)), names


def _can_show(effect: str, station: Station) -> bool:
    return effect in STRANGERS or effect in applicable(station.kind, station.pulses_per_revolution)


def _stratum(planted: tuple[Planted, ...]) -> str:
    """As what the score card counts them."""
    if not planted:
        return "healthy"
    if any(p.effect in STRANGERS for p in planted):
        return "unknown"
    if len(planted) > 1:
        return "pair"
    lasting = planted[0].begin is None and planted[0].end is None
    return "single" if lasting else "onset"
