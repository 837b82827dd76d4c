"""Statistics over averaging windows, streaming: raw wind run against the estimated wind."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.array_run import ArrayRunCounter
from wind_sensors.estimation.bias_terms import (
    WindowTurbulence,
    array_terms,
    predicted_terms,
    vane_loss,
)
from wind_sensors.estimation.constants import is_array, measures_vertical
from wind_sensors.estimation.core import Estimates, SmallScales
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.outputs import BiasTerm, WindowStatistics
from wind_sensors.estimation.presence import Presence
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.site import has_wakes, site_covariance
from wind_sensors.estimation.wind_run import RunCounter, RunSums, Windows
from wind_sensors.instruments.cup_vane import direction_variance_logarithmic
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

_CORRECTION_UNCERTAINTY = 0.25
"""Relative standard uncertainty of the correction as a whole: a4, angular response, levels."""
_CALIBRATION_UNCERTAINTY = 0.002
"""Relative, of a calibration laboratory."""
_WIDEST = math.pi**2 / 3.0
"""Variance of a direction of which nothing is known [rad^2]."""
_CORRELATION_TIME = 1.0
"""Errors of estimates further apart are independent [s]."""
_LEAST_MEASURED = 0.5
"""Of a window of which less was measured no statistics are told."""
_NO_NUMBER = math.nan


@dataclass
class _Sums:
    """Sums over the estimates of a window."""

    count: int = 0
    velocity: FloatArray = field(default_factory=lambda: np.zeros(3))
    products: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    own: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    mount: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    speed: float = 0.0
    pointing: FloatArray = field(default_factory=lambda: np.zeros(2))
    along: float = 0.0
    across: float = 0.0
    blocks: int = 0
    turning: int = 0
    unfollowed: FloatArray = field(default_factory=lambda: np.zeros(3))


class WindowAccumulator:
    """Collects blocks and estimates into windows that follow one another.

    Args:
        station: The station.
        settings: `window` and `output_rate` matter.
    """

    def __init__(self, station: Station, settings: EstimatorSettings) -> None:
        self._station = station
        self._settings = settings
        self._length = round(settings.window * 1e9)
        self._counter: RunCounter | ArrayRunCounter | None = None
        self._vertical_is_measured = measures_vertical(station)
        self._start = self._end = 0
        self._last = 0
        self._number = 0
        self._sums = _Sums()

    def take(
        self,
        block: Block,
        estimates: Estimates,
        small: SmallScales | None,
        presence: Presence,
        until: int,
    ) -> list[WindowStatistics]:
        """Add a block and the estimates that became final with it; windows that are complete.

        Args:
            block: The block.
            estimates: Those that are told.
            small: Small scales of the turbulence.
            presence: Tells how much of a window was measured.
            until: No estimate before this time will follow [ns].
        """
        if self._counter is None:
            kind = ArrayRunCounter if is_array(self._station) else RunCounter
            grid = self._grid(block.start)
            self._counter = kind(
                self._station, block.start, Windows(grid, self._length), self._settings.use_air
            )
            self._start, self._end = block.start, grid + self._length
            self._number = 0
        self._counter.take(block)
        self._last = block.stop
        return self._add(estimates, small, presence, until)

    def _grid(self, start: int) -> int:
        """Where the window begins that holds a start [ns]: after a pause as if there was none."""
        if self._end == 0 or start < self._last:
            return start
        return start - (start - self._end) % self._length

    def finish(
        self, estimates: Estimates, small: SmallScales | None, presence: Presence
    ) -> list[WindowStatistics]:
        """The remaining estimates and the last, shorter window; the next block starts anew.

        Its windows are those that would have followed; the first begins with it and is shorter.
        Where it is earlier, as after a clock that was set back, they count from its start.
        """
        out = self._add(estimates, small, presence, 0)
        if self._sums.count:
            out += self._close(min(self._last, self._end), presence)
        self._counter = None
        self._sums = _Sums()
        return out

    def _add(
        self, estimates: Estimates, small: SmallScales | None, presence: Presence, until: int
    ) -> list[WindowStatistics]:
        out: list[WindowStatistics] = []
        first = 0
        time = estimates.time
        while first < time.size:
            end = self._end
            stop = int(np.searchsorted(time, end))
            if stop > first:
                self._accumulate(estimates, slice(first, stop), small)
            if stop < time.size:
                out += self._close(end, presence)
            first = stop
        while until >= self._end:
            out += self._close(self._end, presence)
        return out

    def _accumulate(self, estimates: Estimates, part: slice, small: SmallScales | None) -> None:
        s = self._sums
        v = estimates.velocity[part]
        p = estimates.covariance[part]
        h = np.hypot(v[:, 0], v[:, 1])
        safe = np.maximum(h, 0.2)
        east, north = v[:, 0] / safe, v[:, 1] / safe
        across = north**2 * p[:, 0, 0] + east**2 * p[:, 1, 1] - 2 * east * north * p[:, 0, 1]
        s.count += v.shape[0]
        s.velocity += v.sum(axis=0)
        s.products += np.einsum("ni,nj->ij", v, v)
        s.covariance += p.sum(axis=0)
        own = estimates.apparent_covariance[part]
        turn = estimates.to_earth[part]
        if has_wakes(self._station):
            # An error in a wake's depth stays while the wind stays in the wake.
            own = own - site_covariance(self._station, estimates.apparent[part])
        own = turn @ own @ turn.transpose(0, 2, 1)
        s.own += own.sum(axis=0)
        s.mount += (p - own).sum(axis=0)
        s.speed += float(np.sum(h + 0.5 * across / safe))
        s.pointing += (east.sum(), north.sum())
        told = estimates.unfollowed[part]
        told = told[np.isfinite(told[:, 0])]
        s.turning += told.shape[0]
        s.unfollowed += (told[:, 0].sum(), told[:, 1].sum(), (told[:, 0] * told[:, 1]).sum())
        s.unfollowed[2] += told[:, 2].sum()
        if small is not None:
            s.along += small.along
            s.across += small.across
            s.blocks += 1

    def _close(self, stop: int, presence: Presence) -> list[WindowStatistics]:
        """Statistics of the current window; the next one begins at `stop`."""
        assert self._counter is not None
        s, run, start = self._sums, self._counter.window(self._number), self._start
        self._start = stop
        if stop == self._end:
            self._end += self._length
        self._number += 1
        self._sums = _Sums()
        if s.count == 0:
            return []
        share = presence.share(start, stop)
        rotor, vane = self._counter.rotor.name, self._counter.vane
        counted = presence.share(start, stop, rotor, "" if vane is None else vane.name)
        found = self._statistics(s, run, start, stop, counted >= _LEAST_MEASURED)
        found = replace(found, complete=min(found.complete, share))
        return [found if found.complete >= _LEAST_MEASURED else _without_numbers(found)]

    def _statistics(
        self, s: _Sums, run: RunSums, start: int, stop: int, is_counted: bool
    ) -> WindowStatistics:
        assert self._counter is not None
        duration = max((stop - start) * 1e-9, 1e-9)
        rotor, vane = self._counter.rotor, self._counter.vane
        length = rotor.calibration_distance
        mean = s.velocity / s.count
        speed = s.speed / s.count
        wind_run, raw_speed = self._raw(run, duration)
        if not is_counted:
            # What another rotor or vane told is no error of this one.
            wind_run, raw_speed = mean[:2], speed
        bias = np.append(wind_run - mean[:2], 0.0)
        fluctuation = s.products / s.count - np.outer(mean, mean) + s.covariance / s.count
        direction = math.atan2(mean[1], mean[0])
        turn = np.array(
            [
                [math.cos(direction), math.sin(direction), 0.0],
                [-math.sin(direction), math.cos(direction), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        turbulence = np.sqrt(np.maximum(np.diag(turn @ fluctuation @ turn.T), 0.0))
        blocks = max(s.blocks, 1)
        vector_speed = float(np.hypot(mean[0], mean[1]))
        state = WindowTurbulence(
            speed, vector_speed, float(fluctuation[2, 2]), self._vertical_is_measured,
            SmallScales(s.along / blocks, s.across / blocks), _unfollowed(s),
        )
        arithmetic = 0.0
        if run.turns and run.interval_turned > 0.0:
            mean_rate = run.interval_turned / run.interval_time
            offset = run.offsets / max(run.readings, 1) / length
            arithmetic = (run.rates / run.turns + offset) / (mean_rate + offset) - 1.0
        if vane is None:
            seen, loss = 1.0 - float(np.sum(np.square(s.pointing / s.count))), 0.0
            terms = array_terms(state, float(np.hypot(wind_run[0], wind_run[1])))
        else:
            # Without a run of wind no direction has a weight.
            seen = _NO_NUMBER
            if run.turned > 0.0:
                seen = 1.0 - float(np.sum(np.square(run.directions))) / run.turned**2
            loss = vane_loss(vane, state) / max(speed, 0.1) ** 2
            terms = predicted_terms(rotor, vane, state, arithmetic)
        removed = speed * sum(
            abs(terms[name].value) for name in ("u", "w", "vane_lag", "translation")
        )
        change = max(
            float(np.hypot(bias[0], bias[1])), removed,
            abs(raw_speed - speed) if self._station.platform is None else 0.0,
        )
        covariance, bias_covariance = self._uncertainty(s, speed, change, duration)
        vertical = (terms["w"].uncertainty * speed) ** 2 * np.outer(turn[0], turn[0])
        covariance, bias_covariance = covariance + vertical, bias_covariance + vertical
        spread = seen if math.isnan(seen) else _WIDEST
        if seen < 1.0:
            spread = min(direction_variance_logarithmic(seen), _WIDEST)
        across_direction = np.array([-math.sin(direction), math.cos(direction), 0.0])
        across_variance = float(across_direction @ covariance @ across_direction)
        # Rounding may leave less than nothing; `max` keeps a nan that comes first.
        seen = max(seen, 0.0)
        independent = max(duration / _CORRELATION_TIME / 10.0, 1.0)
        found = WindowStatistics(
            start=start,
            stop=stop,
            complete=min(s.count / (duration * self._settings.output_rate), 1.0),
            wind_run_mean=wind_run,
            vector_mean=mean,
            vector_mean_covariance=covariance,
            bias=bias,
            bias_covariance=bias_covariance,
            raw_scalar_mean=raw_speed,
            scalar_mean=speed,
            scalar_mean_uncertainty=math.sqrt(float(turn[0] @ covariance @ turn[0])),
            direction=direction,
            direction_uncertainty=math.sqrt(across_variance) / max(vector_speed, 0.1),
            direction_variance=seen,
            corrected_direction_variance=max(spread + loss, 0.0),
            direction_variance_uncertainty=math.hypot(
                _CORRECTION_UNCERTAINTY * loss, spread * math.sqrt(2.0 / independent)
            ),
            turbulence=turbulence,
            bias_terms=terms,
            instrument=rotor.name,
        )
        return found if is_counted else _without_count(found)

    def _raw(self, run: RunSums, duration: float) -> tuple[FloatArray, float]:
        """Vector mean by wind run (K94 (83)) and count mean [m/s], by the calibration.

        Of an array, which counts no speed, the size of the vector stands for the second.
        """
        assert self._counter is not None
        length = self._counter.rotor.calibration_distance
        readings = max(run.readings, 1)
        moving = 1.0 if run.edges else 0.0
        vector = length * run.directions / duration + moving * run.time_directions / readings
        told = length * run.turned / duration + moving * run.offsets / readings
        if self._counter.vane is None:
            told = float(np.hypot(vector[0], vector[1]))
        return vector + run.carried / readings, told

    def _uncertainty(
        self, s: _Sums, speed: float, change: float, duration: float
    ) -> tuple[FloatArray, FloatArray]:
        """Covariances of the corrected vector mean and of the correction [m^2/s^2].

        The instruments' own errors average out over the window, those of the mount's attitude and
        velocity, of the calibration and of the correction do not.

        Args:
            s: Sums of the window.
            speed: Scalar mean [m/s].
            change: Size of the correction, made or called for by the turbulence [m/s].
            duration: [s].
        """
        total = s.covariance / s.count
        averaged = s.own / s.count * min(_CORRELATION_TIME / duration, 1.0)
        correction = _CORRECTION_UNCERTAINTY * change
        bias_covariance = np.diag([correction**2, correction**2, 0.0])
        mean_covariance = averaged + s.mount / s.count
        mean_covariance += np.eye(3) * ((_CALIBRATION_UNCERTAINTY * speed) ** 2 + correction**2)
        if not self._vertical_is_measured:
            mean_covariance[2, 2] = total[2, 2]
        return mean_covariance, bias_covariance


def _unfollowed(s: _Sums) -> float:
    """(<A'^2> - <y' A'>)/<A> of a window [m/s]; nan where no method told it."""
    if s.turning == 0 or s.unfollowed[0] <= 0.0:
        return _NO_NUMBER
    forcing, lag, product = s.unfollowed / s.turning
    return float((product - forcing * lag) / forcing)


def _without_count(window: WindowStatistics) -> WindowStatistics:
    """A window in which the rotor whose run is counted, or its vane, did not measure."""
    terms = window.bias_terms.items()
    return replace(
        window,
        wind_run_mean=np.full(2, _NO_NUMBER),
        bias=np.full(3, _NO_NUMBER),
        bias_covariance=np.full((3, 3), _NO_NUMBER),
        raw_scalar_mean=_NO_NUMBER,
        direction_variance=_NO_NUMBER,
        corrected_direction_variance=_NO_NUMBER,
        direction_variance_uncertainty=_NO_NUMBER,
        bias_terms={name: BiasTerm(_NO_NUMBER, _NO_NUMBER, t.relative_to) for name, t in terms},
    )


def _without_numbers(window: WindowStatistics) -> WindowStatistics:
    """A window of which too little was measured."""
    return replace(
        _without_count(window),
        vector_mean=np.full(3, _NO_NUMBER),
        vector_mean_covariance=np.full((3, 3), _NO_NUMBER),
        scalar_mean=_NO_NUMBER,
        scalar_mean_uncertainty=_NO_NUMBER,
        direction=_NO_NUMBER,
        direction_uncertainty=_NO_NUMBER,
        turbulence=np.full(3, _NO_NUMBER),
    )
