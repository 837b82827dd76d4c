"""The running comparison: signals in, located mismatches out, block after block."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Executor

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import default_baseline
from wind_sensors.diagnosis.watch.blocks import Block, Judge
from wind_sensors.diagnosis.watch.by_looks import LooksJudge
from wind_sensors.diagnosis.watch.by_sums import SumsJudge
from wind_sensors.diagnosis.watch.direct import Oddity, oddities
from wind_sensors.diagnosis.watch.finding import Finding
from wind_sensors.diagnosis.watch.settings import WatchSettings
from wind_sensors.diagnosis.watch.store import GRID_STEP, SignalStore
from wind_sensors.errors import UserError
from wind_sensors.estimation import EstimatorSettings, make_estimator
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.streaming import StreamingEstimator
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

DRIFT_SPAN = 450_000_000_000
"""A drifting clock is taken to have run for so long before a block [ns]."""

_SECOND = 1_000_000_000
_LEAST_SEEN = 0.6
_JUMP = 5 * _SECOND


class Watch:
    """Compares a station's signals with their simulation as they arrive.

    Driven by stamps alone; memory does not grow. Signals go in by the `add_` methods of an
    estimator, and `add_wind` for a reference.

    Args:
        station: The station.
        settings: How to watch.
        baseline: From `wind baseline`; None: normal is learnt from the first blocks, so that only
            what changes after them is found.
        executor: Where the diagnosis of the last minutes may take its seconds; None: signals wait.

    Attributes:
        station: The healthy station that is simulated.
        blocks: Compared so far.
        skipped: Blocks that had too little wind or no signals.
        skipped_for: Why the last of them was left out.

    Raises:
        UserError: The settings do not fit the station.
    """

    def __init__(
        self,
        station: Station,
        settings: WatchSettings,
        baseline: Baseline | None = None,
        executor: Executor | None = None,
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
        known_normal = default_baseline(station) if baseline is None else baseline
        self._baseline = known_normal.for_station(station)
        self._stated = station
        self.station = self._baseline.station
        missing = [c for c in default_baseline(station).channels if c not in
                   self._baseline.channels]
        if missing:
            raise UserError(
                f"the baseline knows nothing of {missing[0]}.",
                "baseline",
                "Make one from recordings of this station: `wind baseline HEALTHY... -o FILE`.",
            )
        self._estimator = self._driving_estimator()
        self._store = SignalStore()
        self._judge: Judge
        if self.looks:
            block = round(settings.block * _SECOND)
            self._judge = LooksJudge(self._baseline, self._last_minutes, block, executor)
        else:
            self._judge = SumsJudge(self.station, settings, self._baseline)
        self._session: int | None = None
        self._begin = 0
        self._latest_wind = 0
        self._latest_signal = 0
        self._heard: set[str] = set()
        self.blocks = 0
        self.skipped = 0
        self.skipped_for = ""

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
    def looks(self) -> bool:
        """Whether the last minutes are diagnosed as a whole; else sums over blocks decide."""
        return self.calibrated and self.settings.drive == "reference"

    @property
    def learnt(self) -> bool:
        """Whether normal is known."""
        return self._judge.learnt

    @property
    def finding(self) -> Finding | None:
        """The present mismatch, None while there is none."""
        return self._judge.told.finding

    @property
    def past(self) -> deque[Finding]:
        """The last mismatches that are over."""
        return self._judge.told.past

    @property
    def alarm_level(self) -> float:
        """How near an alarm is; 1 is one."""
        return self._judge.level

    @property
    def latest_wind(self) -> int:
        """Stamp of the newest driving wind [ns], 0 before the first."""
        return self._latest_wind

    @property
    def lag(self) -> float:
        """How far the driving wind is behind the station's signals [s]; 0 before it was heard."""
        if self._latest_wind == 0:
            return 0.0
        return max((self._latest_signal - self._latest_wind) / _SECOND, 0.0)

    def estimate_health(self) -> list[HealthItem]:
        """What the driving estimator says about itself; empty with a reference."""
        if self._estimator is None:
            return []
        return [i for i in self._estimator.health() if i.name.split()[-1] in ("edges", "estimate")]

    def add_pulse(self, name: str, time_ns: int, turns: float | None = None) -> None:
        """An edge of a rotor [ns], with its turns so far where the source tells."""
        self._latest_signal = time_ns
        self._store.add_pulse(name, time_ns, turns)
        if self._estimator is not None and self._drives(name):
            self._estimator.add_pulse(name, time_ns, turns)
            self._take_estimates()

    def add_angle(self, name: str, time_ns: int, angle: float) -> None:
        """A reading of a vane [rad]; what is not a number is left out."""
        if not np.isfinite(angle):
            return
        self._latest_signal = time_ns
        self._store.add_angle(name, time_ns, angle)
        if self._estimator is not None and self._drives(name):
            self._estimator.add_angle(name, time_ns, angle)
            self._take_estimates()

    def add_platform(
        self,
        time_ns: int,
        attitude_xyzw: npt.ArrayLike,
        velocity: npt.ArrayLike | None,
        angular_rate: npt.ArrayLike,
        position: npt.ArrayLike,
    ) -> None:
        """State of the carrier as in `PlatformStates`; without velocity where it comes apart."""
        platform = self.station.platform
        if velocity is not None and platform is not None and platform.moves_apart:
            self.add_platform_velocity(time_ns, velocity)
            velocity = None
        told = np.zeros(3) if velocity is None else velocity
        parts = (attitude_xyzw, told, angular_rate, position)
        state = np.concatenate([np.asarray(p, dtype=np.float64) for p in parts])
        if np.isfinite(state).all():
            self._store.add_platform(time_ns, state.tolist())
        if self._estimator is not None:
            self._estimator.add_platform(time_ns, attitude_xyzw, velocity, angular_rate, position)
            self._take_estimates()

    def add_platform_velocity(self, time_ns: int, velocity: npt.ArrayLike) -> None:
        """Velocity of the carrier where it comes apart from the attitude [m/s]."""
        vector = np.asarray(velocity, dtype=np.float64)
        if np.isfinite(vector).all():
            self._store.add_platform_velocity(time_ns, vector.tolist())
        if self._estimator is not None:
            self._estimator.add_platform_velocity(time_ns, vector)
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
            self._judge.restart()
        self._latest_wind = max(self._latest_wind, time)
        self._store.add_wind(time, velocity.tolist())
        self._judge.poll()
        while time >= self._begin + block + wait:
            self._compare(self._begin, self._begin + block, lead)
            self._begin += block
            self._store.forget_before(self._begin - self._judge.span - lead - 2 * _SECOND)

    def _start_at(self, time: int) -> None:
        """First wind, or a clock that was set back: what was learnt stays."""
        if self._session is not None:
            self._store.clear()
            self._judge.restart()
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
        if recording.reference.time.size < _LEAST_SEEN * (stop - start) / GRID_STEP:
            self._skip("too little wind to compare with")
            return None
        place = self._baseline.place if self.settings.drive == "reference" else None
        try:
            comparison = prepare(recording, self.station, place)
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

    def _last_minutes(self, start: int, stop: int) -> Recording | None:
        start = max(start, self._store.complete_since)
        session = start
        if self._stated.changes and self._session is not None:
            session = self._session
        return self._store.recording(self._stated, session, start, stop, gridded=False)

    def _compare(self, start: int, stop: int, lead: int) -> None:
        comparison = self._prepared(start, stop, lead)
        if comparison is None:
            return
        try:
            pulses, angles = comparison.signals(self.station)
        except (ValueError, UserError):
            self._skip("the simulated rotor runs away")
            return
        expected = comparison.observe(pulses, angles)
        odd = self._silent(comparison, start, stop)
        odd += oddities(comparison, expected, self.station, pulses, angles, start, stop)
        if self._judge.judge(Block(self.blocks, start, stop, comparison, odd)):
            self.blocks += 1
        else:
            self._skip("the simulated rotor runs away")
