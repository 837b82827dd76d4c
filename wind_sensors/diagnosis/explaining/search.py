"""Naming: the effects whose nonlinear fits explain the mismatch best."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from wind_sensors.diagnosis.comparing.comparison import Comparison, Trust
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.explaining.bounds import without_idle, without_run_aways
from wind_sensors.diagnosis.explaining.fitting import ROUGHLY, Fit, fit
from wind_sensors.diagnosis.explaining.guesses import BLIND_EFFECTS
from wind_sensors.diagnosis.explaining.problem import parameters_of
from wind_sensors.diagnosis.explaining.recent import Recent
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.screening import (
    JOINT_TEMPLATES,
    Score,
    group_templates,
    screen,
    starting_values,
)
from wind_sensors.diagnosis.explaining.signatures import (
    SignatureBank,
    in_parallel,
    signature_bank,
    templates_of,
    with_larger,
)
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted, reached_by
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.calibrated_range import calm_share
from wind_sensors.diagnosis.healthy.reference_lag import lag_weights, misplaced
from wind_sensors.diagnosis.healthy.whitening import (
    Whitener,
    form_signatures,
    outage_signatures,
    shared_liveliness,
    trust_of,
    whitener_of,
)
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

LEAST_GAIN = 6.0
"""Effects whose linear score stays below this are not fitted: a name needs more by far."""

LEAST_SHARE = 0.03
"""Nor those whose score stays below this share of the best."""

FIRST_ITERATIONS = 3
"""Gauss-Newton steps from each starting point of a candidate."""

LAST_ITERATIONS = 4
"""Further ones from the best of them; the best few candidates are fitted to the end."""

TIMES_DERIVED = 8
"""About so often a candidate's derivatives are taken, to tell which candidates take long."""

TRIED_STARTS = 2
"""So many of an effect's starting points are fitted, those with the least deviance."""

CLOSE_START = 0.05
"""The second only if its deviance lies within this share of the number of data of the best one's:
one farther away ends where the best one does, or worse."""

LARGER_STARTS = (2.0, 4.0)
"""Multiples of the linear estimate that are tried as well: a vane that turns round on the way makes
valleys in the cost from which a small effect does not come out."""

PENALTY_PER_PARAMETER = 3.0
"""Cost of one more parameter, in units of the squared white vector."""

PENALTY_PER_FURTHER_PARAMETER = 4.0
"""The same for the second and later parameters of an effect."""

PENALTY_PER_INTERVAL = 10.0
"""Cost of a beginning or an end inside the record."""

WHITENERS = 4
JUDGEMENTS = 32
"""So many of the nulls and of the judgements asked for last are kept: each null takes about 10 MB,
each judgement one."""


def interval_penalty(term: Term) -> float:
    """What a term pays for its beginning and end; nought where the signals tell them."""
    if term.interval == ALWAYS or term.effect.legible:
        return 0.0
    begin, end = term.interval
    return PENALTY_PER_INTERVAL * ((begin > 0.0) + (end is not None))


@dataclass
class Searcher:
    """The state of the search on one recording.

    Attributes:
        comparison: The recording.
        baseline: What is normal.
        bank: Signatures of the catalogue, of which the null lets healthy days have a little.
        probes: The same with larger sizes, for screening.
        misplaced: What the error of the reference's place changes, one standard deviation a row.
        effects: The catalogue.
        workers: Processes.
        judgements: Fits made again in the nulls that they leave, and their penalised deviance.
    """

    comparison: Comparison
    baseline: Baseline
    bank: SignatureBank
    probes: SignatureBank
    misplaced: FloatArray
    effects: Mapping[str, Effect]
    guesses: Mapping[tuple[str, str], Sequence[Term]]
    workers: int = 1
    _whiteners: Recent[Whitener] = field(
        default_factory=lambda: Recent(WHITENERS), init=False, repr=False
    )
    judgements: Recent[tuple[Fit, float]] = field(
        default_factory=lambda: Recent(JUDGEMENTS), init=False, repr=False
    )

    @property
    def station(self) -> Station:
        """The station as commissioned."""
        return self.baseline.station

    @cached_property
    def applicable(self) -> frozenset[tuple[str, str]]:
        """Effects of the catalogue, each with an instrument of this station that can have it."""
        return frozenset((t.effect.name, t.instrument) for t in self.bank.templates)

    @cached_property
    def falling_silent(self) -> Station:
        """The station with the outages that its signals tell."""
        told = chain.from_iterable(self.guesses.values())
        return planted(self.station, [term for term in told if term.effect.silences])

    def whitener(self, simulated: Simulated, named: Fit | None = None) -> Whitener:
        """The null seen from the best simulation so far.

        Args:
            simulated: Gives the noise.
            named: Effects that are taken for granted, in a form that need not be exact; None:
                there are none.
        """

        def anew() -> Whitener:
            return self._whitener(trust_of(self.comparison, simulated, self.baseline), named)

        return self._whiteners.of((simulated, named), anew)

    def _whitener(self, trust: Mapping[str, Trust], named: Fit | None) -> Whitener:
        templates = self.bank.templates
        calm = calm_share(self.comparison, self.baseline)
        standing = np.array(
            [
                max(
                    self.baseline.standing.get(t.key, 0.0),
                    t.smallest_standing,
                    calm * t.standing_in_calm,
                )
                for t in templates
            ]
        )
        means = np.array([self.baseline.means.get(t.key, 0.0) for t in templates])
        signatures = self.bank.whitened(self.comparison, trust)
        way = self.comparison.whitened_changes(self.misplaced, trust)
        lag = np.concatenate((lag_weights(self.comparison, templates) @ signatures, way))
        lively = shared_liveliness(self.comparison, trust, self.baseline.liveliness)
        further = [lag, lively, outage_signatures(self.comparison, trust, self.falling_silent)]
        if named is not None:
            further.append(
                form_signatures(self.comparison, trust, self.bank.without, named.simulated)
            )
        signatures = np.concatenate((signatures, *further))
        added = len(signatures) - len(standing)
        standing = np.concatenate((standing, np.ones(added)))
        means = np.concatenate((means, np.zeros(added)))
        return whitener_of(self.comparison, trust, signatures, standing, means)

    def white_signatures(self, whitener: Whitener) -> FloatArray:
        """Signatures of the probes in a null, one a row."""
        return whitener.through_standing(self.probes.whitened(self.comparison, whitener.trust))

    def scores(self, whitener: Whitener, vector: FloatArray) -> list[Score]:
        """Linear scores of the whole catalogue over the record, best first.

        Args:
            whitener: The null.
            vector: What is to be explained.
        """
        return screen(self.probes.templates, self.white_signatures(whitener), vector)

    def single_candidates(
        self, whitener: Whitener, vector: FloatArray, number: int, blind: bool = False
    ) -> list[list[Term]]:
        """Starting points of the most promising effects, several for each.

        Args:
            whitener: The null.
            vector: What is to be explained.
            number: Of effects.
            blind: Try those as well of which a small size shows no way.
        """
        signatures = self.white_signatures(whitener)
        scores = screen(self.probes.templates, signatures, vector)
        groups = group_templates(self.probes.templates)
        drive = self.comparison.drive
        out: list[list[Term]] = []
        worth = max(LEAST_GAIN, LEAST_SHARE * scores[0].gain) if scores else 0.0
        for score in [s for s in scores[:number] if s.gain > worth and self._may_be(s)]:
            effect = self.effects[score.effect]
            start = starting_values(score, drive)
            starts = [
                Term(effect, score.instrument, values) for values in effect.either_sign(start)
            ]
            for parameter in (p for p in effect.parameters if p.is_free(drive)):
                starts.extend(
                    Term(effect, score.instrument, {**start, parameter.name: value})
                    for value in parameter.starts
                )
            if len(effect.parameters) == 1 and not effect.parameters[0].starts:
                starts.extend(
                    Term(effect, score.instrument, effect.scaled(start, factor))
                    for factor in LARGER_STARTS
                )
            members = groups[(score.effect, score.instrument)]
            power = np.einsum("ij,ij->i", signatures[members], signatures[members])
            seen = signatures[members] @ vector
            gains = seen**2 / np.maximum(power, 1e-9)
            if len(members) > JOINT_TEMPLATES:
                order = np.argsort(-gains)[:3]
                for k in order[1:]:
                    template = self.probes.templates[members[int(k)]]
                    amplitude = float(np.clip(seen[k] / max(power[k], 1e-9), 0.3, 10.0))
                    values = effect.scaled(template.values, amplitude)
                    starts.append(Term(effect, score.instrument, values))
            out.append(starts)
        chosen = {starts[0].key for starts in out}
        for key, guesses in self.guesses.items():
            if key in chosen:
                starts = next(s for s in out if s[0].key == key)
                effect = self.effects[key[0]]
                if effect.legible or (guesses[0].held and effect.entrance != "clock"):
                    starts.clear()
                starts.extend(guesses)
            elif blind or key[0] not in BLIND_EFFECTS:
                out.append(list(guesses))
        return out

    def _may_be(self, score: Score) -> bool:
        """Whether an effect whose signals tell that it is there has been told by them."""
        return not self.effects[score.effect].legible or (
            (score.effect, score.instrument) in self.guesses
        )

    def best_fit(
        self, whitener: Whitener, current: Fit | None, starts: Sequence[Term],
        rest: Simulated | None,
    ) -> Fit:
        """Fit of known terms and one more, from the best of several starting points.

        What an effect that smooths leaves unexplained depends on its size, so that each size is
        judged in the noise that it leaves itself.
        """
        fixed = () if current is None else current.terms
        smooths = bool(starts) and starts[0].effect.smooths
        comparison = self.comparison
        ranked: list[tuple[float, int]] = []
        for k, start in enumerate(starts):
            station = planted(self.station, [*fixed, start])
            only: tuple[str, ...] = ()
            if rest is not None:
                only = tuple(sorted(reached_by(comparison, self.station, [*fixed, start])))
            simulated = comparison.possible(station, only, rest)
            if simulated is None:
                continue
            null = self.whitener(simulated) if smooths else whitener
            ranked.append((null.deviance(simulated), k))
        ranked.sort()
        if not ranked:
            ranked = [(np.inf, 0)]
        best = ranked[0][0]
        close = CLOSE_START * float(whitener.of(self.bank.without).size)
        tried = [k for deviance, k in ranked[:TRIED_STARTS] if smooths or deviance <= best + close]
        for _, k in ranked:
            # What holds for a part of the record must grow before it does better than always.
            if all(starts[k].interval != starts[other].interval for other in tried):
                tried.append(k)
        if current is not None and self.is_apart(current, starts[0]):
            fits = [self.fit_beside(whitener, current, starts[k]) for k in tried]
        else:
            fits = [
                fit(
                    whitener, self.station, [*fixed, starts[k]], rest, FIRST_ITERATIONS, current,
                    ROUGHLY,
                )
                for k in tried
            ]
        ahead = fits[0]
        if len(fits) > 1 and smooths:
            ahead = min(
                fits,
                key=lambda f: (
                    interval_penalty(f.terms[-1])
                    + self.whitener(f.simulated).deviance(f.simulated)
                ),
            )
        elif len(fits) > 1:
            ahead = min(fits, key=lambda f: f.cost + interval_penalty(f.terms[-1]))
        found = fit(
            whitener, self.station, ahead.terms, rest, LAST_ITERATIONS, ahead, ROUGHLY
        )
        tied = without_run_aways(found.terms[-1])
        tied = tied or without_idle(found, PENALTY_PER_FURTHER_PARAMETER)
        if tied is None:
            return found
        terms = [*found.terms[:-1], tied]
        return fit(whitener, self.station, terms, rest, LAST_ITERATIONS, least=ROUGHLY)

    def is_apart(self, current: Fit, start: Term) -> bool:
        """Whether a term acts on signals that those of a fit do not reach."""
        reached = reached_by(self.comparison, self.station, current.terms)
        return not reached & reached_by(self.comparison, self.station, [start])

    def fit_beside(self, whitener: Whitener, current: Fit, start: Term) -> Fit:
        """Fit of one more term on signals of its own, the others as they are.

        Fitted with it, what is drawn at random (additional pulses) would cost by chance more than
        the new term gains.
        """
        station = planted(self.station, current.terms)
        alone = fit(
            whitener, station, [start], current.simulated, FIRST_ITERATIONS, least=ROUGHLY
        )
        slopes = None
        if current.slopes is not None and alone.slopes is not None:
            slopes = np.hstack((current.slopes, alone.slopes))
        return replace(
            alone,
            terms=(*current.terms, *alone.terms),
            covariance=block_diag(current.covariance, alone.covariance),
            active=current.active + alone.active,
            slopes=slopes,
        )

    def fit_all(
        self, whitener: Whitener, current: Fit | None, candidates: Sequence[Sequence[Term]]
    ) -> list[Fit]:
        """Fits of the known terms, if there are any, with each candidate.

        Without those that the raw signals rule out.
        """
        return self.possible(self.fit_each(whitener, current, candidates))

    def fit_each(
        self, whitener: Whitener, current: Fit | None, candidates: Sequence[Sequence[Term]]
    ) -> list[Fit]:
        """The same, with those, in the order of the candidates."""
        rest = self.bank.without

        def one(starts: Sequence[Term]) -> Fit:
            return self.best_fit(whitener, current, starts, rest)

        def work(starts: Sequence[Term]) -> float:
            # Starts are tried once each; a fit takes its derivatives anew a few times.
            return len(starts) + TIMES_DERIVED * len(starts[0].effect.parameters)

        fits: list[Fit] = in_parallel(one, list(candidates), self.workers, work=work)
        return fits

    def refit_all(self, whitener: Whitener, explanations: Sequence[Sequence[Term]]) -> list[Fit]:
        """Fits of whole explanations from where they are.

        Without those that the raw signals rule out.
        """
        rest = self.bank.without
        fits: list[Fit] = in_parallel(
            lambda terms: fit(whitener, self.station, terms, rest, least=ROUGHLY),
            list(explanations),
            self.workers,
            work=lambda terms: len(parameters_of(terms)),
        )
        return self.possible(fits)

    def possible(self, fits: Sequence[Fit]) -> list[Fit]:
        """Those fits that the raw signals do not rule out."""
        return [f for f in fits if not ruled_out(self.comparison, self.station, f.terms)]


def searcher_of(
    comparison: Comparison,
    baseline: Baseline,
    effects: Mapping[str, Effect],
    guesses: Mapping[tuple[str, str], Sequence[Term]],
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Searcher:
    """Prepare a search: simulate the catalogue in the recording's wind."""
    templates = templates_of(comparison, baseline.station, effects)
    bank = signature_bank(comparison, baseline.station, templates, workers, progress)
    probes = with_larger(bank, comparison, baseline.station, workers)
    way = misplaced(comparison, baseline.station, bank.without)
    return Searcher(comparison, baseline, bank, probes, way, effects, guesses, workers)
