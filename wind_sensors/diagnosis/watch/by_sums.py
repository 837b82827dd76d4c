"""Judging by sums: a sequential test of every signature, block after block.

For watches that must learn on the way what is normal.
"""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.signatures import signature_bank, templates_of
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.whitening import in_series
from wind_sensors.diagnosis.watch.blocks import Block, Told
from wind_sensors.diagnosis.watch.confirming import confirmed
from wind_sensors.diagnosis.watch.evidence import (
    Evidence,
    Learning,
    Registry,
    Snapshot,
    channel_excess,
    departures,
    standing_amplitudes,
)
from wind_sensors.diagnosis.watch.finding import Finding, Located, UsualMisfit, located
from wind_sensors.diagnosis.watch.naming import candidates, limited
from wind_sensors.diagnosis.watch.normal import Normal
from wind_sensors.diagnosis.watch.sequential import SequentialTest
from wind_sensors.diagnosis.watch.settings import WatchSettings
from wind_sensors.errors import UserError
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

REMEMBERED = 40
"""Blocks of evidence kept since an onset."""

WHOLE = 4
"""Newest blocks kept whole, for trying candidates."""

RECONSIDERED = 4
"""The candidates of a lasting mismatch are weighed anew every so many blocks."""

SETTLING = 2
"""Blocks after the learning in which the session's standing amplitudes still settle."""

_LEARN_BELOW = 0.35
_OVER_BELOW = 0.5
_NOISE_BLOCKS = 4


class SumsJudge:
    """Cumulative sums over signatures, with noise that is learnt as blocks pass.

    Args:
        station: The healthy station.
        settings: Of the watch.
        baseline: From healthy recordings, or of tolerances.

    Attributes:
        told: What was told.
    """

    def __init__(self, station: Station, settings: WatchSettings, baseline: Baseline) -> None:
        self.told = Told()
        self._station = station
        self._baseline = baseline
        self._effects = catalogue()
        self._registry = Registry()
        self._normal = Normal(baseline, series=settings.drive != "estimate")
        self._learning = Learning()
        self._usual = UsualMisfit()
        # With a baseline only the noise of this day has to be learnt.
        self._needed = (
            min(_NOISE_BLOCKS, settings.learning) if baseline.calibrated else settings.learning
        )
        self._blocks = 0
        blocks_per_day = 86400.0 / settings.block
        self._test = SequentialTest(
            settings.false_alarms_per_day, blocks_per_day, bounded=baseline.calibrated
        )
        self._evidence: deque[Evidence] = deque(maxlen=REMEMBERED)
        self._whole: deque[Snapshot] = deque(maxlen=WHOLE)

    @property
    def learnt(self) -> bool:
        """Whether normal is known."""
        return self._blocks >= self._needed

    @property
    def level(self) -> float:
        """Largest sum relative to its threshold."""
        return self._test.largest

    @property
    def span(self) -> int:
        """Blocks are judged one by one."""
        return 0

    def poll(self) -> None:
        """Nothing is worked out elsewhere."""

    def restart(self) -> None:
        """What was learnt stays."""

    def judge(self, block: Block) -> bool:
        """Take a block in."""
        comparison, odd, number = block.comparison, block.odd, block.number
        templates = templates_of(comparison, self._station, self._effects)
        try:
            bank = signature_bank(comparison, self._station, templates)
        except (ValueError, UserError):
            return False
        places = self._registry.places_of(bank.templates)
        size = len(self._registry.templates)
        self._test.resize(size)
        trust = self._normal.trust(comparison, bank.without)
        signatures = bank.whitened(comparison, trust)
        raw = comparison.vector(bank.without, trust)
        standing = self._standing()[places] @ signatures
        if self._baseline.calibrated:
            standing = in_series(comparison, standing)
        residual = raw - standing
        gram = signatures @ signatures.T
        evidence = Evidence(
            number=number,
            start=block.start,
            stop=block.stop,
            places=places,
            gram=gram,
            seen=signatures @ residual,
            chi_square=limited(residual),
            count=residual.size,
            channels=channel_excess(comparison, trust, residual),
            speed=float(np.mean(comparison.speed)),
            direction=float(np.angle(np.mean(np.exp(1j * comparison.wind_from)))),
        )
        # Without a baseline the test compares with the session's own beginning, before anything
        # is taken off.
        tested = evidence.seen if self._baseline.calibrated else signatures @ raw
        departure, precision = departures(
            self._registry, evidence, tested, {o.instrument for o in odd}
        )
        learning = not self.learnt
        if not learning:
            self._test.add(number, departure, precision)
            self._evidence.append(evidence)
            self._whole.append(Snapshot(number, comparison, trust, standing, bank.without))
        # The first blocks of a change are not yet an alarm, and not normal any more.
        quiet = self._test.largest < _LEARN_BELOW and not self._test.leapt
        if not odd and (learning or quiet):
            self._normal.learn(comparison, bank.without, residual)
            self._usual.learn(evidence.channels)
        if not odd:
            self._test.learn(departure, precision)
            if self._blocks < self._needed + SETTLING:
                self._test.settle(departure, precision)
        if learning and not self._baseline.calibrated and not odd:
            self._learning.add(places, gram, signatures @ raw, size)
        self._blocks += 1
        self._decide(block, departure, precision)
        return True

    def _standing(self) -> FloatArray:
        if self._baseline.calibrated:
            return standing_amplitudes(self._baseline, self._registry)
        if not self.learnt:
            return np.zeros(len(self._registry.templates))
        return self._learning.amplitudes(self._registry)

    def _decide(self, block: Block, departure: FloatArray, precision: FloatArray) -> None:
        told = self.told
        if block.odd:
            told.tell_oddity(block.odd, block.stop)
            return
        onset_block = self._test.onset()
        known = told.finding
        if onset_block is None:
            if known is not None and (known.certain or self._test.largest < _OVER_BELOW):
                told.end(block.start)
            return
        since = [e for e in self._evidence if e.number >= onset_block]
        whole = [s for s in self._whole if s.number >= onset_block]
        if len(whole) > 2 and whole[0].number == onset_block:
            # The change happened somewhere within this one.
            del whole[0]
        if not since or not whole:
            return
        if known is not None and not known.certain and block.number % RECONSIDERED:
            named = known.candidates
        else:
            named = tuple(candidates(self._registry, self._station, since, whole))
        if (known is None or known.certain) and not confirmed(since, named, self._usual):
            # A difference that is real but small becomes normal.
            self._test.settle(departure, precision)
            told.end(block.start)
            return
        where: Located = located(since, self._usual, named)
        told.finding = Finding(
            onset=since[0].start if known is None else min(known.onset, since[0].start),
            detected=block.stop if known is None else known.detected,
            latest=block.stop,
            located=where,
            candidates=named,
            blocks=len(since),
        )
