"""A few seconds of made-up signals, so that kernels are compiled before real ones arrive."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from wind_sensors.estimation import EstimatorSettings, make_estimator
from wind_sensors.nodes.inputs import SignalTaker
from wind_sensors.station.inputs import angle_inputs
from wind_sensors.station.model import Cup, Propeller, Station

_SECOND = 1_000_000_000
START = 1_000 * _SECOND
STEP = _SECOND // 20
"""Between two readings [ns]."""
SPEED = 5.0
"""Of the made-up wind [m/s]."""


def warm_up(station: Station, settings: EstimatorSettings) -> None:
    """Run a throwaway estimator once through everything it does.

    Without it the first real messages would wait while the kernels compile, for many seconds on
    the first run after an installation.

    Args:
        station: As the real estimator's.
        settings: As the real estimator's.

    Raises:
        UserError: The settings or the station do not suit an estimator.
    """
    estimator = make_estimator(station, settings)
    seconds = 2.0 * settings.smoother_lag + settings.reordering_window + 3.0
    for time, call in made_up_signals(station, estimator, seconds):
        call(time)
    estimator.flush()
    estimator.take_estimates()


def made_up_signals(
    station: Station, taker: SignalTaker, seconds: float
) -> list[tuple[int, Callable[[int], None]]]:
    """Signals of a steady wind of `SPEED` into the sensor's x axis.

    Args:
        station: Whose instruments speak.
        taker: Is told.
        seconds: From `START` on.

    Returns:
        Times [ns] and what to call with them, in order.
    """
    stop = START + round(seconds * _SECOND)
    calls: list[tuple[int, Callable[[int], None]]] = []

    def schedule(period: int, call: Callable[[int], None]) -> None:
        calls.extend((time, call) for time in range(START, stop, period))

    for instrument in station.instruments:
        if isinstance(instrument, (Cup, Propeller)):
            turns_per_second = SPEED / (2.0 * np.pi * instrument.calibration_distance)
            rate = turns_per_second * instrument.pulses_per_revolution
            name = instrument.name
            schedule(round(_SECOND / rate), partial(taker.add_pulse, name))
        else:
            for signal in angle_inputs(instrument):
                schedule(STEP, partial(_point_ahead, taker, signal))
    if station.platform is not None:
        upright, still = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
        schedule(STEP, lambda time: taker.add_platform(time, upright, still, still, still))
    return sorted(calls, key=lambda item: item[0])


def _point_ahead(taker: SignalTaker, signal: str, time: int) -> None:
    taker.add_angle(signal, time, 0.0)
