"""Signatures: the simulation with an effect minus the simulation without it."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison, Trust
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects.definition import (
    PLATFORM,
    STATION,
    Effect,
    entry_of,
    touched,
    with_effect,
)
from wind_sensors.simulation.drive import Drive
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

_SECTOR_SHARE = 0.01

LARGER = (4.0, -4.0)
"""Multiples of an effect's template that are screened as well. Where a rotor gives few pulses in a
turn, what a small effect changes is mostly on which side of a bin's border an edge falls."""


@dataclass(frozen=True)
class Template:
    """An effect of one instrument at one set of values.

    Attributes:
        effect: The effect.
        instrument: Name of the instrument, or `platform`.
        number: Which of the effect's templates.
        values: Parameters.
        multiple: Of the effect's template.
    """

    effect: Effect
    instrument: str
    number: int
    values: Mapping[str, float]
    multiple: float = 1.0

    @property
    def key(self) -> str:
        """Identifier in a baseline."""
        return f"{self.effect.name}|{self.instrument}|{self.number}"

    @property
    def smallest_standing(self) -> float:
        """Least standing size in units of the template; a bank of templates shares it."""
        size = max(self.effect.relative_size(self.values), 0.5)
        crowd = max(1.0, len(self.effect.templates) / 4.0)
        return float(self.effect.standing / size / np.sqrt(crowd))

    @property
    def standing_in_calm(self) -> float:
        """Standing size, in units of the template, in winds of which nothing is known."""
        size = max(self.effect.relative_size(self.values), 0.5)
        return self.effect.standing_in_calm / size

    def planted(self, station: Station) -> Station:
        """The station with the effect."""
        return with_effect(station, self.effect, self.instrument, self.values)


def entries(station: Station) -> Iterator[str]:
    """Names of everything in a station that can have an effect."""
    yield STATION
    for instrument in station.instruments:
        yield instrument.name
    if station.platform is not None:
        yield PLATFORM


def _visited(comparison: Comparison, effect: Effect, values: Mapping[str, float]) -> bool:
    """Whether the wind ever comes from where a directional template acts."""
    if not effect.sector:
        return True
    away = np.angle(np.exp(1j * (comparison.wind_from - np.radians(values[effect.sector]))))
    return bool(np.mean(np.abs(away) < np.radians(values["width"])) > _SECTOR_SHARE)


def templates_of(
    comparison: Comparison, station: Station, effects: Mapping[str, Effect]
) -> list[Template]:
    """All templates that a recording of the station could show."""
    compared = {c.instrument for c in comparison.channels} | {PLATFORM, STATION}
    out: list[Template] = []
    for name in entries(station):
        if name not in compared:
            continue
        for effect in effects.values():
            if name == STATION and not (effect.everywhere or effect.shared):
                continue
            if effect.everywhere and name != STATION:
                continue
            if not any(
                effect.applies(entry_of(station, one), station)
                for one in touched(station, effect, name)
            ):
                continue
            out.extend(
                Template(effect, name, number, values)
                for number, values in enumerate(effect.templates)
                if _visited(comparison, effect, values)
            )
    return out


def _larger_templates(templates: Iterable[Template], drive: Drive) -> list[Template]:
    """Larger sizes of the effects that have one template and whose bounds allow them.

    Not of delays: what a boat's sway or a gust shows four times as late is another signal. Where
    only products of an effect's values are seen, with those from which its fits start: at rest an
    imbalance of the template's size shows less than the lean that it needs.

    Args:
        templates: Of the catalogue.
        drive: What drives the recording.
    """
    out = []
    for template in templates:
        effect = template.effect
        if effect.is_tied(drive):
            departures = {name: LARGER[0] * value for name, value in template.values.items()}
            values = effect.begun(departures, drive)
            out.append(replace(template, values=values, multiple=LARGER[0]))
            continue
        if len(effect.templates) > 1 or effect.entrance == "clock":
            continue
        for multiple in LARGER:
            values = effect.scaled(template.values, multiple)
            undone = effect.scaled(values, 1.0 / multiple)
            if all(np.isclose(undone[name], value) for name, value in template.values.items()):
                out.append(replace(template, values=values, multiple=multiple))
    return out


_TASK: list[tuple[Callable[[Any], Any], Sequence[Any]]] = []
"""What forked processes work on: the innermost call's function and items."""


def _run(index: int) -> Any:
    function, items = _TASK[-1]
    return function(items[index])


def in_parallel(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    workers: int,
    progress: Callable[[float], None] | None = None,
    work: Callable[[Any], float] | None = None,
) -> list[Any]:
    """Map over items in forked processes; the function and the items need no pickling.

    Args:
        function: Called with each item; its results are pickled.
        items: Arguments.
        workers: Number of processes; 1 stays in this one, as does what is called in one of them.
        progress: Called with the share done.
        work: About how long an item takes, in any unit. The longest begin first, so that no
            process is left waiting for one that began last.
    """
    out: list[Any] = []
    alone = workers < 2 or len(items) < 2 or multiprocessing.current_process().daemon
    if alone or "fork" not in multiprocessing.get_all_start_methods():
        results: Iterable[Any] = map(function, items)
        for result in results:
            out.append(result)
            if progress:
                progress(len(out) / len(items))
        return out
    order = list(range(len(items)))
    if work is not None:
        order.sort(key=lambda index: -work(items[index]))
    _TASK.append((function, items))
    try:
        # Ctrl-C goes to all of them: only this process answers, by ending the others.
        ignore = (signal.SIGINT, signal.SIG_IGN)
        with multiprocessing.get_context("fork").Pool(workers, signal.signal, ignore) as pool:
            for result in pool.imap(_run, order):
                out.append(result)
                if progress:
                    progress(len(out) / len(items))
    finally:
        _TASK.pop()
    return [result for _, result in sorted(zip(order, out, strict=True), key=itemgetter(0))]


@dataclass(frozen=True)
class SignatureBank:
    """Simulations of all templates in one recording's wind.

    Attributes:
        templates: What was planted.
        without: The simulation without any.
        with_each: The simulations with each, in the order of `templates`.
    """

    templates: list[Template]
    without: Simulated
    with_each: list[Simulated]
    _changes: dict[tuple[Channel, ...], FloatArray] = field(
        default_factory=dict, repr=False, compare=False
    )

    def whitened(self, comparison: Comparison, trust: Mapping[str, Trust]) -> FloatArray:
        """Noise-whitened signatures, one a row."""
        return comparison.whitened_changes(self._changed(comparison.channels), trust)

    def _changed(self, channels: tuple[Channel, ...]) -> FloatArray:
        """What each template changes in all coefficients and statistics, one a row."""
        if channels not in self._changes:
            healthy = self.without.flat(channels)
            self._changes[channels] = np.array(
                [np.nan_to_num(each.flat(channels) - healthy) for each in self.with_each]
            )
        return self._changes[channels]


def signature_bank(
    comparison: Comparison,
    station: Station,
    templates: list[Template],
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> SignatureBank:
    """Simulate every template that can be in a recording's wind."""
    bank = SignatureBank([], comparison.simulate(station), [])
    return _with_more(bank, comparison, station, templates, workers, progress)


def with_larger(
    bank: SignatureBank, comparison: Comparison, station: Station, workers: int = 1
) -> SignatureBank:
    """A bank with larger sizes of its effects, as far as they can be simulated."""
    return _with_more(
        bank, comparison, station, _larger_templates(bank.templates, comparison.drive), workers
    )


def _with_more(
    bank: SignatureBank,
    comparison: Comparison,
    station: Station,
    templates: list[Template],
    workers: int,
    progress: Callable[[float], None] | None = None,
) -> SignatureBank:
    """A bank with those of some templates that can be: with which no rotor runs away."""

    def tried(template: Template) -> Simulated | None:
        only = comparison.affected(station, template.instrument)
        return comparison.possible(template.planted(station), only)

    parts = in_parallel(tried, templates, workers, progress)
    possible = [
        (template, bank.without.with_others(part))
        for template, part in zip(templates, parts, strict=True)
        if part is not None
    ]
    return SignatureBank(
        [*bank.templates, *(template for template, _ in possible)],
        bank.without,
        [*bank.with_each, *(simulated for _, simulated in possible)],
    )
