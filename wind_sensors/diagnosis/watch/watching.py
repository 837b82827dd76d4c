"""The running comparison: signals in, located mismatches out, block after block."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.comparison import Comparison, prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.learning import default_baseline
from wind_sensors.diagnosis.signatures import signature_bank, templates_of
from wind_sensors.diagnosis.watch.confirming import confirmed
from wind_sensors.diagnosis.watch.direct import Oddity, oddities
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
from wind_sensors.diagnosis.watch.store import GRID_STEP, SignalStore
from wind_sensors.errors import UserError
from wind_sensors.estimation import EstimatorSettings, make_estimator
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.streaming import StreamingEstimator
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

REMEMBERED = 40
"""Blocks of evidence kept since an onset."""

WHOLE = 4
"""Newest blocks kept whole, for trying candidates."""

DRIFT_SPAN = 450_000_000_000
"""A drifting clock is taken to have run for so long before a block [ns]."""

RECONSIDERED = 4
"""The candidates of a lasting mismatch are weighed anew every so many blocks."""

SETTLING = 2
"""Blocks after the learning in which the session's standing amplitudes still settle."""

_SECOND = 1_000_000_000
_LEAST_SEEN = 0.6
_JUMP = 5 * _SECOND
_LEARN_BELOW = 0.35
_OVER_BELOW = 0.5


class Watch:
    """Compares a station's signals with their simulation as they arrive.

    Driven by stamps alone; memory does not grow. Signals go in by the `add_` methods of an
    estimator, and `add_wind` for a reference.

    Args:
        station: The station.
        settings: How to watch.
        baseline: From `wind baseline`; None: normal is learnt from the first blocks, so that only
            what changes after them is found.

    Attributes:
        station: The healthy station that is simulated.
        blocks: Compared so far.
        skipped: Blocks that had too little wind or no signals.
        skipped_for: Why the last of them was left out.
        finding: The present mismatch, None while there is none.
        past: The last mismatches that are over.

    Raises:
        UserError: The settings do not fit the station.
    """

    def __init__(
        self, station: Station, settings: WatchSettings, baseline: Baseline | None = None
    ) -> None:
        known = {i.name for i in station.instruments}
        unknown = [n for n in settings.driving if n not in known]
        if unknown:
            raise UserError(
                f"the station has no instrument '{unknown[0]}'.",
                "driving",
                f"It has {', '.join(sorted(known))}.",
            )
        self.settings = settings
        self._baseline = default_baseline(station) if baseline is None else baseline
        self.station = self._baseline.station if self._baseline.calibrated else station
        missing = [c for c in default_baseline(station).channels if c not in
                   self._baseline.channels]  # fmt: skip
        if missing:
            raise UserError(
                f"the baseline knows nothing of {missing[0]}.",
                "baseline",
                "Make one from recordings of this station: `wind baseline HEALTHY... -o FILE`.",
            )
        self._estimator = self._driving_estimator()
        self._effects = catalogue()
        self._store = SignalStore()
        self._registry = Registry()
        self._normal = Normal(self._baseline, series=settings.drive != "estimate")
        self._learning = Learning()
        self._usual = UsualMisfit()
        blocks_per_day = 86400.0 / settings.block
        self._test = SequentialTest(
            settings.false_alarms_per_day, blocks_per_day, bounded=self.calibrated
        )
        self._evidence: deque[Evidence] = deque(maxlen=REMEMBERED)
        self._whole: deque[Snapshot] = deque(maxlen=WHOLE)
        self._session: int | None = None
        self._begin = 0
        self._latest_wind = 0
        self._heard: set[str] = set()
        self.blocks = 0
        self.skipped = 0
        self.skipped_for = ""
        self.finding: Finding | None = None
        self.past: deque[Finding] = deque(maxlen=5)

    def _driving_estimator(self) -> StreamingEstimator | None:
        if self.settings.drive == "reference":
            return None
        station = self.station
        if self.settings.driving:
            kept = [i for i in station.instruments if i.name in self.settings.driving]
            station = station.model_copy(update={"instruments": tuple(kept)})
        return make_estimator(station, EstimatorSettings())

    @property
    def calibrated(self) -> bool:
        """Whether a baseline from healthy recordings stands behind the comparison."""
        return self._baseline.calibrated

    @property
    def learnt(self) -> bool:
        """Whether normal is known."""
        return self.blocks >= self._needed

    @property
    def _needed(self) -> int:
        """With a baseline only the noise of this day has to be learnt."""
        return min(4, self.settings.learning) if self.calibrated else self.settings.learning

    @property
    def alarm_level(self) -> float:
        """Largest test statistic relative to its threshold; 1 is an alarm."""
        return self._test.largest

    @property
    def latest_wind(self) -> int:
        """Stamp of the newest driving wind [ns], 0 before the first."""
        return self._latest_wind

    def estimate_health(self) -> list[HealthItem]:
        """What the driving estimator says about itself; empty with a reference."""
        if self._estimator is None:
            return []
        return [i for i in self._estimator.health() if i.name.split()[-1] in ("edges", "estimate")]

    def add_pulse(self, name: str, time_ns: int, turns: float | None = None) -> None:
        """An edge of a rotor [ns], with its turns so far where the source tells."""
        self._store.add_pulse(name, time_ns, turns)
        if self._estimator is not None and self._drives(name):
            self._estimator.add_pulse(name, time_ns, turns)
            self._take_estimates()

    def add_angle(self, name: str, time_ns: int, angle: float) -> None:
        """A reading of a vane [rad]; what is not a number is left out."""
        if not np.isfinite(angle):
            return
        self._store.add_angle(name, time_ns, angle)
        if self._estimator is not None and self._drives(name):
            self._estimator.add_angle(name, time_ns, angle)
            self._take_estimates()

    def add_platform(
        self,
        time_ns: int,
        attitude_xyzw: npt.ArrayLike,
        velocity: npt.ArrayLike,
        angular_rate: npt.ArrayLike,
        position: npt.ArrayLike,
    ) -> None:
        """State of the carrier, as in `PlatformStates`."""
        parts = (attitude_xyzw, velocity, angular_rate, position)
        state = np.concatenate([np.asarray(p, dtype=np.float64) for p in parts])
        if np.isfinite(state).all():
            self._store.add_platform(time_ns, state.tolist())
        if self._estimator is not None:
            self._estimator.add_platform(time_ns, *parts)
            self._take_estimates()

    def add_air(
        self, time_ns: int, temperature: float | None = None, pressure: float | None = None
    ) -> None:
        """Air temperature [deg C], pressure [Pa], or both."""
        if temperature is not None and np.isfinite(temperature):
            self._store.add_temperature(time_ns, temperature)
        if pressure is not None and np.isfinite(pressure):
            self._store.add_pressure(time_ns, pressure)
        if self._estimator is not None:
            self._estimator.add_air(time_ns, temperature, pressure)

    def add_wind(self, time_ns: int, velocity: npt.ArrayLike) -> None:
        """Wind of the reference: east, north, up [m/s]; ignored unless it drives."""
        if self._estimator is None:
            self._driven(time_ns, np.asarray(velocity, dtype=np.float64))

    def _drives(self, name: str) -> bool:
        owner = name.partition("/")[0]
        return not self.settings.driving or owner in self.settings.driving

    def _take_estimates(self) -> None:
        assert self._estimator is not None
        for estimate in self._estimator.take_estimates():
            self._driven(estimate.time, estimate.velocity)

    def _driven(self, time: int, velocity: FloatArray) -> None:
        block = round(self.settings.block * _SECOND)
        lead = round(self.settings.lead_in * _SECOND)
        wait = round(self.settings.wait * _SECOND)
        if self._session is None or time < self._latest_wind - _JUMP:
            self._start_at(time)
        elif time > self._latest_wind + block:
            # After a long silence the next block begins with what comes.
            self._begin = time + lead
        self._latest_wind = max(self._latest_wind, time)
        self._store.add_wind(time, velocity.tolist())
        while time >= self._begin + block + wait:
            self._compare(self._begin, self._begin + block, lead)
            self._begin += block
            self._store.forget_before(self._begin - lead - 2 * _SECOND)

    def _start_at(self, time: int) -> None:
        """First wind, or a clock that was set back: what was learnt stays."""
        if self._session is not None:
            self._store.clear()
        self._session = time
        self._latest_wind = time
        lead = round(self.settings.lead_in * _SECOND)
        # On the reference's own instants, so that no interpolation is needed.
        self._begin = time + lead // GRID_STEP * GRID_STEP

    def _skip(self, reason: str) -> None:
        self.skipped += 1
        self.skipped_for = reason

    def _prepared(self, start: int, stop: int, lead: int) -> Comparison | None:
        assert self._session is not None
        session = self._session
        if not self.station.changes:
            session = max(session, start - DRIFT_SPAN)
        recording = self._store.recording(
            self.station, session, start - lead, stop, self.settings.driving
        )
        if recording is None or recording.reference is None:
            self._skip("no wind to compare with")
            return None
        expected = (stop - start) / GRID_STEP
        if recording.reference.time.size < _LEAST_SEEN * expected:
            self._skip("too little wind to compare with")
            return None
        try:
            comparison = prepare(recording, self.station)
        except UserError as problem:
            self._skip(str(problem))
            return None
        after = comparison.grid.start + comparison.grid.centres * _SECOND >= start
        return comparison.within(after.astype(np.float64))

    def _silent(self, comparison: Comparison, start: int, stop: int) -> list[Oddity]:
        """Vanes that were heard before and are not any more."""
        found = []
        for name in comparison.recording.angles:
            self._heard.add(name)
        for name in self._heard - set(comparison.recording.angles):
            text = f"{name} delivers no readings"
            found.append(Oddity("stuck_sensor", name, start, stop, text))
        return found

    def _compare(self, start: int, stop: int, lead: int) -> None:
        comparison = self._prepared(start, stop, lead)
        if comparison is None:
            return
        number = self.blocks
        templates = templates_of(comparison, self.station, self._effects)
        try:
            bank = signature_bank(comparison, self.station, templates)
        except ValueError:
            self._skip("the simulated rotor runs away")
            return
        places = self._registry.places_of(templates)
        size = len(self._registry.templates)
        self._test.resize(size)
        trust = self._normal.trust(comparison, bank.without)
        signatures = bank.whitened(comparison, trust)
        raw = comparison.vector(bank.without, trust)
        standing = self._standing()[places] @ signatures
        residual = raw - standing
        odd = self._silent(comparison, start, stop)
        odd += oddities(
            comparison, bank.without, self.station, *comparison.signals(self.station), start, stop
        )
        gram = signatures @ signatures.T
        evidence = Evidence(
            number=number,
            start=start,
            stop=stop,
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
        tested = evidence.seen if self.calibrated else signatures @ raw
        departure, precision = departures(
            self._registry, evidence, tested, {o.instrument for o in odd}
        )
        learning = not self.learnt
        if not learning:
            self._test.add(number, departure, precision)
            self._evidence.append(evidence)
            self._whole.append(Snapshot(number, comparison, trust, standing, bank.without))
        if not odd and (learning or self._test.largest < _LEARN_BELOW):
            self._normal.learn(comparison, bank.without, residual)
            self._usual.learn(evidence.channels)
        if not odd:
            self._test.learn(departure, precision)
            if number < self._needed + SETTLING:
                self._test.settle(departure, precision)
        if learning and not self.calibrated and not odd:
            self._learning.add(places, gram, signatures @ raw, size)
        self.blocks += 1
        self._judge(number, stop, odd, departure, precision)

    def _standing(self) -> FloatArray:
        if self.calibrated:
            return standing_amplitudes(self._baseline, self._registry)
        if not self.learnt:
            return np.zeros(len(self._registry.templates))
        return self._learning.amplitudes(self._registry)

    def _judge(
        self,
        number: int,
        stop: int,
        odd: Sequence[Oddity],
        departure: FloatArray,
        precision: FloatArray,
    ) -> None:
        if odd:
            first = min(odd, key=lambda o: o.start)
            known = self.finding
            onset = first.start if known is None else min(first.start, known.onset)
            detected = stop if known is None else known.detected
            self.finding = Finding.of_oddity(first, onset, detected, stop)
            return
        onset_block = self._test.onset()
        if onset_block is None:
            over = self.finding is not None and (
                self.finding.certain or self._test.largest < _OVER_BELOW
            )
            if over:
                self._end(stop - self._block_ns)
            return
        since = [e for e in self._evidence if e.number >= onset_block]
        whole = [s for s in self._whole if s.number >= onset_block]
        if len(whole) > 2 and whole[0].number == onset_block:
            # The change happened somewhere within this one.
            del whole[0]
        if not since or not whole:
            return
        known = self.finding
        if known is not None and not known.certain and number % RECONSIDERED:
            named = known.candidates
        else:
            named = tuple(candidates(self._registry, self.station, since, whole))
        if (known is None or known.certain) and not confirmed(since, named, self._usual):
            # A difference that is real but small becomes normal.
            self._test.settle(departure, precision)
            if known is not None:
                self._end(stop - self._block_ns)
            return
        where: Located = located(since, self._usual)
        onset = since[0].start if known is None else min(known.onset, since[0].start)
        self.finding = Finding(
            onset=onset,
            detected=stop if known is None else known.detected,
            latest=stop,
            located=where,
            candidates=named,
            blocks=len(since),
        )

    def _end(self, time: int) -> None:
        """The present mismatch is over."""
        if self.finding is not None:
            self.past.append(replace(self.finding, ended=time))
            self.finding = None

    @property
    def _block_ns(self) -> int:
        return round(self.settings.block * _SECOND)
