"""From scores to names: accept, compare, remove."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from wind_sensors.diagnosis.explaining.beside import Beside
from wind_sensors.diagnosis.explaining.explanation import (
    CLEARLY_BETTER,
    EQUAL_SHARE,
    Alone,
    Alternative,
    Naming,
    deviance_in_own_noise,
    empty_fit,
    judged,
    penalised_cost,
    seen_in,
)
from wind_sensors.diagnosis.explaining.fitting import ROUGHLY, Fit, covariance_of, fit
from wind_sensors.diagnosis.explaining.leading import (
    leading_alone,
)
from wind_sensors.diagnosis.explaining.moves import (
    looked_around,
    merged,
    pruned,
    simplified,
    spared,
    swapped,
)
from wind_sensors.diagnosis.explaining.onsets import with_interval
from wind_sensors.diagnosis.explaining.pairs import better_pair
from wind_sensors.diagnosis.explaining.rounds import (
    CONTENDERS,
    FirstRound,
    best_beside,
    best_single,
)
from wind_sensors.diagnosis.explaining.search import Searcher

NARROW_SHARE = 0.85
"""Effects of single instruments win over broad ones from this share of their gain on, beyond what
both explanations share, if they need fewer parameters."""

BROAD_PARAMETERS = 3
"""From so many fitted parameters on, an explanation with a broad effect is challenged."""

KNOWN_CANDIDATES = 3
"""So many that came close to the first and to the second effect are tried in their places."""


def name(
    searcher: Searcher,
    first: FirstRound,
    progress: Callable[[float], None] | None = None,
) -> Naming:
    """Find the effects that explain the recording.

    Effects are added one by one; then two simple ones may take the place of all. An effect of the
    whole station may stand in for two of single instruments. Where it needs the help of others, the
    search runs once more without such effects, and the better one counts.

    Args:
        searcher: Prepared search.
        first: Its first round.
        progress: Called with the share done.
    """
    report = progress or (lambda share: None)
    found = _named(searcher, first, report)
    report(1.0)
    return found


def _named(
    searcher: Searcher, first: FirstRound, report: Callable[[float], None]
) -> Naming:
    """The same, with one search or two.

    Args:
        searcher: Prepared search.
        first: Its first round.
        report: Called with the share done.
    """
    whitener, singles = first.whitener, first.singles
    beside: list[Beside] = []
    found = _greedy(searcher, lambda share: report(0.5 * share), first, frozenset(), beside)
    if found.fit.terms and not any(term.is_told for term in found.fit.terms):
        pair = better_pair(searcher, whitener, singles, found.fit)
        if pair is not None:
            both = pruned(searcher, pair.whitener, pair.fit)
            if len(both.terms) > 1:
                newest = [f.terms[0] for f in sorted(singles, key=penalised_cost)[:CONTENDERS]]
                settled = _settled(
                    searcher, *swapped(searcher, pair.whitener, both, newest), found.screened
                )
                return replace(settled, alone=found.alone)
    leading = found.fit
    if not leading.terms and first.led is not None:
        # Fitted to the end, it asked for more than anything of its kind may be.
        leading = first.led[0].fit
    broad = {t.effect.name for t in leading.terms if t.effect.everywhere}
    if not broad or leading.active < BROAD_PARAMETERS:
        return found
    everywhere = frozenset(n for n, e in searcher.effects.items() if e.everywhere)
    led = best_single(searcher, whitener, singles, everywhere)
    narrow = _greedy(
        searcher, lambda share: report(0.5 + 0.5 * share), replace(first, led=led), everywhere,
        beside,
    )
    if not found.fit.terms or (narrow.fit.terms and _fits_better(searcher, narrow, found)):
        return narrow
    simpler = (
        0 < narrow.fit.active < found.fit.active
        and len(narrow.fit.terms) <= len(found.fit.terms)
    )
    if not simpler:
        return found
    enough = NARROW_SHARE * _gain_beside(searcher, found, narrow)
    return narrow if _gain_beside(searcher, narrow, found) > enough else found


def named_alone(searcher: Searcher, naming: Naming) -> Naming | None:
    """The explanation by the single effect that led before a second one joined it.

    Args:
        searcher: The search.
        naming: An explanation; None comes back where it is no pair or began with none.
    """
    if naming.alone is None or len(naming.fit.terms) < 2:
        return None
    whitener = searcher.whitener(searcher.bank.without)
    single = fit(whitener, searcher.station, naming.alone.terms, searcher.bank.without)
    whitener = searcher.whitener(single.simulated)
    single = fit(whitener, searcher.station, single.terms, searcher.bank.without)
    return _settled(searcher, single, naming.alone.alternatives, naming.screened)


def named_instead(searcher: Searcher, naming: Naming, rival: Alternative) -> Naming:
    """The explanation by a rival, where the signals contradict the one that led.

    Args:
        searcher: The search.
        naming: The explanation that led.
        rival: One of those that lost against it.
    """
    others = tuple(
        replace(other, behind=other.behind - rival.behind)
        for other in naming.alternatives
        if other is not rival
    )
    known = seen_in(naming.whitener, rival.fit)
    return _settled(searcher, known, others, naming.screened)


def _greedy(
    searcher: Searcher,
    report: Callable[[float], None],
    first: FirstRound,
    excluded: frozenset[str],
    beside: list[Beside],
) -> Naming:
    """Take the effect that leads, judge the noise again, and look for one beside it.

    Args:
        searcher: The search.
        report: Called with the share done.
        first: Single effects and the one that leads.
        excluded: Names of effects that are not to be used.
        beside: What was tried beside an effect already; grows.
    """
    nothing = empty_fit(first.whitener, searcher)
    screened = tuple(
        (s.effect, s.instrument, s.gain)
        for s in searcher.scores(first.whitener, nothing.vector)[:12]
    )
    report(0.4)
    if first.led is None:
        report(1.0)
        return _settled(searcher, nothing, (), screened)
    leader, losers = first.led

    def with_another(
        known: Fit, behind: tuple[Alternative, ...], without: frozenset[str]
    ) -> tuple[Fit, tuple[Alternative, ...]]:
        for tried in beside:
            if tried.first.terms == known.terms:
                return _with_another(tried, behind, without)
        beside.append(Beside(searcher, known, first.singles))
        return _with_another(beside[-1], behind, without)

    current, alternatives = with_another(leader.fit, losers, excluded)
    report(0.8)
    if len(current.terms) == 1 and current.terms[0].key != leader.fit.terms[0].key:
        # What took the place of two may stand beside another one itself.
        current, alternatives = with_another(current, alternatives, excluded)
    report(1.0)
    alone = Alone(leader.fit.terms, losers)
    found = _settled(searcher, current, alternatives, screened)
    gone = {t.effect.name for t in current.terms} - {t.effect.name for t in found.fit.terms}
    if found.fit.terms and gone:
        # Beside what is left there may be something else in the place of what cannot be.
        again = with_another(found.fit, (), excluded | gone)
        if len(again[0].terms) > 1:
            found = _settled(searcher, *again, screened)
    return replace(found, alone=alone)


def _with_another(
    beside: Beside, losers: tuple[Alternative, ...], excluded: frozenset[str]
) -> tuple[Fit, tuple[Alternative, ...]]:
    """An effect with the best one beside it, if the two hold together, and what comes close.

    Args:
        beside: The effect, and what is tried beside it.
        losers: Single effects that lost against it.
        excluded: Names of effects that are not to be used.
    """
    searcher, first = beside.searcher, beside.first
    second = best_beside(beside, excluded)
    current = first if second is None else second[0].fit
    whitener = searcher.whitener(current.simulated)
    current = fit(whitener, searcher.station, current.terms, searcher.bank.without)
    if second is None:
        return current, losers
    newest = [
        a.fit.terms[-1] for a in (*second[1][:KNOWN_CANDIDATES], *losers[:KNOWN_CANDIDATES])
    ]
    pair = pruned(searcher, whitener, current)
    current = merged(
        searcher, whitener, pair, [first.terms, *((term,) for term in newest)], excluded
    )
    if len(current.terms) == 1:
        single = leading_alone(searcher, current, first.terms)
        if len(pair.terms) == 1 or single.terms[0].key == current.terms[0].key:
            return single, _behind(searcher, single, first, losers)
        # What would replace both does less than the first does alone.
        current = pair
    return swapped(searcher, whitener, current, newest, excluded)


def _behind(
    searcher: Searcher, single: Fit, first: Fit, losers: Sequence[Alternative]
) -> tuple[Alternative, ...]:
    """Single effects that lost against one of them that took the first one's place.

    Args:
        searcher: The search.
        single: The one that is left.
        first: The one that led.
        losers: Those behind that one.
    """
    if single.terms[0].key == first.terms[0].key:
        return tuple(losers)
    ahead = deviance_in_own_noise(searcher, first) - deviance_in_own_noise(searcher, single)
    others = [Alternative(first, 0.0), *losers]
    return tuple(
        replace(a, behind=a.behind + ahead)
        for a in others
        if len(a.fit.terms) == 1 and a.fit.terms[0].key != single.terms[0].key
    )


def _settled(
    searcher: Searcher,
    current: Fit,
    alternatives: tuple[Alternative, ...],
    screened: tuple[tuple[str, str, float], ...],
) -> Naming:
    """An explanation in the null that it leaves, with its beginnings and ends.

    Args:
        searcher: The search.
        current: The explanation.
        alternatives: Those that lost.
        screened: Best scores of the first screening.
    """
    whitener = searcher.whitener(current.simulated)
    current = looked_around(searcher, whitener, seen_in(whitener, current))
    whitener = searcher.whitener(current.simulated)
    current = simplified(searcher, whitener, seen_in(whitener, current))
    if current.terms:
        current = with_interval(searcher, current)
        whitener = searcher.whitener(current.simulated)
        current = spared(searcher, whitener, seen_in(whitener, current))
        whitener = searcher.whitener(current.simulated)
        current = seen_in(whitener, current)
    nothing = whitener.of(searcher.bank.without)
    adequate = whitener
    if current.terms:
        adequate = searcher.whitener(current.simulated, current)
        current = replace(
            current, covariance=covariance_of(adequate, searcher.station, current)
        )
    return Naming(
        current, whitener, adequate, nothing, float(nothing @ nothing) - current.cost,
        alternatives, screened,
    )


def _gain_beside(searcher: Searcher, one: Naming, other: Naming) -> float:
    """Drop of the cost by those effects of an explanation that another one does not have."""
    known = {term.key for term in other.fit.terms}
    shared = [term for term in one.fit.terms if term.key in known]
    if not shared:
        return one.gain
    without = fit(one.whitener, searcher.station, shared, searcher.bank.without, least=ROUGHLY)
    return without.cost - one.fit.cost


def _fits_better(searcher: Searcher, one: Naming, other: Naming) -> bool:
    """Whether an explanation fits clearly better than another."""
    first, second = judged(searcher, [one.fit, other.fit])
    wins = [t.key for t in first.fit.terms] == [t.key for t in one.fit.terms]
    margin = max(CLEARLY_BETTER, EQUAL_SHARE * other.gain)
    return wins and first.penalised_deviance < second.penalised_deviance - margin
