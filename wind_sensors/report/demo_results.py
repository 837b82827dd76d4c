"""What the demo has to show: the estimate against the truth, and biases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from wind_sensors.estimation.outputs import ProcessedRecording, WindowStatistics
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.report.live_agreement import Agreement
from wind_sensors.station.signals import FloatArray, TimeArray, Winds

_SETTLING_SECONDS = 20.0
"""Left out at the start, while the filter learns the turbulence [s]."""

_MEAN_TERMS = ("u", "v", "w", "vane_lag", "translation")
"""Terms that make up the bias of a count mean against the vector mean."""

_EDGES_OF_90_PERCENT = float(norm.ppf(0.95))


@dataclass(frozen=True)
class WindowComparison:
    """One averaging window; speeds in m/s, biases relative to the true vector mean's speed."""

    minutes: tuple[float, float]
    true_speed: float
    raw_speed: float
    corrected_speed: float
    uncertainty: float
    predicted_bias: float
    predicted_uncertainty: float
    found_bias: float
    true_direction_deg: float
    corrected_direction_deg: float


@dataclass(frozen=True)
class DemoResults:
    """Numbers and series of the page.

    Attributes:
        seconds: Instants since the start [s], shape (n,).
        true, naive, corrected: Horizontal wind east, north [m/s], shape (n, 2).
        deviation: Standard deviation of `corrected`, shape (n, 2).
        naive_error, corrected_error: Rms of the horizontal error vector [m/s].
        coverage: Share of errors inside the 90 % interval.
        windows: Ten-minute windows.
        terms: Predicted relative bias by term, mean over the windows.
        agreement: Live against offline; None where no live graph could run.
    """

    seconds: FloatArray
    true: FloatArray
    naive: FloatArray
    corrected: FloatArray
    deviation: FloatArray
    naive_error: float
    corrected_error: float
    coverage: float
    windows: tuple[WindowComparison, ...]
    terms: dict[str, float]
    agreement: Agreement | None


def demo_results(
    corrected: ProcessedRecording, naive: ProcessedRecording, agreement: Agreement | None
) -> DemoResults:
    """Compare estimates with the truth of their recording.

    Args:
        corrected: Result of the default method.
        naive: Result of the method `naive` on the same recording.
        agreement: From `live_agreement`.

    Raises:
        ValueError: The recording has no truth.
    """
    recording = corrected.recording
    if recording.truth is None:
        raise ValueError("the recording has no true wind")
    begin, end = recording.start, int(recording.truth.time[-1])
    inside = (corrected.time >= begin + _SETTLING_SECONDS * 1e9) & (corrected.time <= end)
    time = corrected.time[inside]
    true = _at(recording.truth, time)
    estimate = corrected.velocity[inside, :2]
    deviation = np.sqrt(np.stack([corrected.covariance[inside, k, k] for k in (0, 1)], axis=1))
    raw = np.stack([np.interp(time, naive.time, naive.velocity[:, k]) for k in (0, 1)], axis=1)
    error = estimate - true
    return DemoResults(
        seconds=np.asarray((time - begin) * 1e-9, dtype=np.float64),
        true=true,
        naive=raw,
        corrected=estimate,
        deviation=deviation,
        naive_error=_rms(raw - true),
        corrected_error=_rms(error),
        coverage=float(np.mean(np.abs(error) < _EDGES_OF_90_PERCENT * deviation)),
        windows=tuple(
            _compared(window, recording.truth, begin)
            for window in corrected.windows
            if window.complete > 0.95 and window.stop <= end
        ),
        terms=_mean_terms(corrected.windows),
        agreement=agreement,
    )


def _compared(window: WindowStatistics, truth: Winds, begin: int) -> WindowComparison:
    inside = (truth.time >= window.start) & (truth.time < window.stop)
    mean = truth.velocity[inside].mean(axis=0)
    vector_speed = float(np.hypot(mean[0], mean[1]))
    chosen = [window.bias_terms[name] for name in _MEAN_TERMS if name in window.bias_terms]
    corrected = window.vector_mean
    return WindowComparison(
        minutes=((window.start - begin) / 6e10, (window.stop - begin) / 6e10),
        true_speed=vector_speed,
        raw_speed=window.raw_scalar_mean,
        corrected_speed=float(np.hypot(corrected[0], corrected[1])),
        uncertainty=window.scalar_mean_uncertainty,
        predicted_bias=float(sum(term.value for term in chosen)),
        predicted_uncertainty=float(np.sqrt(sum(term.uncertainty**2 for term in chosen))),
        found_bias=window.raw_scalar_mean / vector_speed - 1.0,
        true_direction_deg=float(direction_from_deg(mean)),
        corrected_direction_deg=float(direction_from_deg(corrected)),
    )


def _mean_terms(windows: tuple[WindowStatistics, ...]) -> dict[str, float]:
    names = dict.fromkeys(name for window in windows for name in window.bias_terms)
    return {
        name: float(np.mean([w.bias_terms[name].value for w in windows if name in w.bias_terms]))
        for name in names
    }


def _at(winds: Winds, time: TimeArray) -> FloatArray:
    return np.stack(
        [np.interp(time - time[0], winds.time - time[0], winds.velocity[:, k]) for k in (0, 1)],
        axis=1,
    )


def _rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
