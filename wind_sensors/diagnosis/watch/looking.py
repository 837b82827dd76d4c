"""A look at the last minutes as a whole: the diagnosis, without its proof."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.proving.remainder import REMAINDER_SCORES
from wind_sensors.diagnosis.regions import Found
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.diagnosis.watch.believing import Rival, believed
from wind_sensors.diagnosis.watch.finding import Located
from wind_sensors.diagnosis.watch.naming import Candidate
from wind_sensors.errors import UserError
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

_SECOND = 1_000_000_000

_UNKNOWN_STRENGTH = 30.0
"""Strength of a mismatch without a name that just counts as structure."""

_MOST_LEFT = 0.35
"""Share of the mismatch that effects may leave and still be told as candidates."""


@dataclass(frozen=True)
class Look:
    """What the diagnosis says about a few minutes.

    Attributes:
        start, stop: Of those minutes [ns].
        strength: Misfit that the mismatch accounts for, in squares of white differences; 0 when
            nothing was found.
        onset: Its estimated beginning [ns].
        end: Its end, if that lies within [ns].
        located: Where it is.
        candidates: Best first; none when no effect of the catalogue explains it.
    """

    start: int
    stop: int
    strength: float = 0.0
    onset: int = 0
    end: int | None = None
    located: Located | None = None
    candidates: tuple[Candidate, ...] = ()


def look(recording: Recording, baseline: Baseline) -> Look:
    """Diagnose the last minutes.

    Args:
        recording: Of them, with a reference.
        baseline: From healthy recordings.
    """
    # A recording of a station that changes counts its time from the beginning of the session.
    start = recording.start if recording.reference is None else int(recording.reference.time[0])
    nothing = Look(start, recording.stop)
    try:
        diagnosis = diagnose(recording, baseline, with_proof=False)
    except UserError:
        return nothing
    if diagnosis.verdict == "unknown":
        found = max(diagnosis.unexplained.regions, key=_beyond)
        where = _located(diagnosis, found, ALWAYS)
        doubtful = _doubtful(diagnosis)
        strength = diagnosis.naming.gain if doubtful else _UNKNOWN_STRENGTH * _beyond(found)
        return Look(start, recording.stop, strength, start, None, where, doubtful)
    if diagnosis.verdict not in {"named", "ambiguous"}:
        return nothing
    terms = diagnosis.naming.fit.terms
    leader = diagnosis.findings[0]
    begins = [recording.start + round(t.interval[0] * _SECOND) for t in terms]
    ends = [t.interval[1] for t in terms]
    over = [recording.start + round(e * _SECOND) for e in ends if e is not None]
    return Look(
        start=start,
        stop=recording.stop,
        strength=diagnosis.naming.gain,
        onset=max(min(begins), start),
        end=max(over) if len(over) == len(terms) else None,
        located=_located(diagnosis, leader.located, leader.term.interval),
        candidates=_candidates(diagnosis),
    )


def _beyond(found: Found) -> float:
    """Score of a region relative to that from which it counts as structure."""
    return found.score / REMAINDER_SCORES[found.region.kind]


def _doubtful(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    """Effects that explain most of what is there, but leave too much for a name: half believed."""
    if not diagnosis.naming.fit.terms or diagnosis.unexplained.share > _MOST_LEFT:
        return ()
    return tuple(replace(c, weight=0.5 * c.weight) for c in _candidates(diagnosis))


def _candidates(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    naming = diagnosis.naming
    terms = naming.fit.terms
    explained = 1.0 - diagnosis.unexplained.share
    if len(terms) > 1:
        # Effects that act together do not compete.
        return tuple(_candidate(t, 1.0 / len(terms), explained, naming.gain) for t in terms)
    rivals = [Rival(terms[0], 0.0)]
    known = {terms[0].key}
    for alternative in naming.alternatives:
        rival = alternative.fit.terms[-1]
        if rival.key not in known and len(alternative.fit.terms) == 1:
            known.add(rival.key)
            rivals.append(Rival(rival, max(alternative.behind, 0.0)))
    return tuple(
        _candidate(
            rival.term,
            weight,
            explained * max(1.0 - rival.behind / naming.gain, 0.0),
            naming.gain - rival.behind,
        )
        for rival, weight in believed(rivals, naming.gain)
    )


def _candidate(term: Term, weight: float, explained: float, gain: float) -> Candidate:
    return Candidate(
        effect=term.effect.name,
        instrument=term.instrument,
        weight=weight,
        explained=explained,
        gain=gain,
        size=term.relative_size,
        values={p.name: term.values[p.name] for p in term.effect.parameters},
        units={p.name: p.unit for p in term.effect.parameters},
    )


def _located(
    diagnosis: Diagnosis, found: Found, interval: tuple[float, float | None]
) -> Located:
    """The channel of a region, with what it shows while the effect holds."""
    comparison = diagnosis.comparison
    channel = found.region.channel
    trust = diagnosis.naming.whitener.trust
    since = comparison.drive.elapsed + comparison.grid.centres
    inside = since >= interval[0]
    if interval[1] is not None:
        inside &= since < interval[1]
    if not inside.any():
        inside[:] = True
    residual = comparison.residual_series(diagnosis.simulated, trust)[channel][inside]
    speed = comparison.speed[inside]
    is_vane = channel.endswith("vane_angle")
    scale = float(np.degrees(1.0 / np.mean(speed))) if is_vane else 1.0
    # The lowest coefficients hold the noise of a mean.
    noise = float(trust[channel].deviation[0]) / np.sqrt(residual.size)
    total = max(float(diagnosis.naming.nothing @ diagnosis.naming.nothing), 1e-9)
    bearing = np.degrees(np.pi / 2.0 - comparison.wind_from[inside])
    low, high = np.quantile(bearing, (0.05, 0.95))
    slow, fast = np.quantile(speed, (0.05, 0.95))
    return Located(
        channel=channel,
        mean=scale * float(np.mean(residual)),
        deviation=scale * noise,
        excess=scale * float(np.sqrt(np.mean(residual**2))),
        unit="deg" if is_vane else "m/s",
        share=min(found.score / total, 1.0),
        speed=(float(slow), float(fast)),
        direction_from=(float(low) % 360.0, float(high) % 360.0),
    )
