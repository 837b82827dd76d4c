"""The streaming estimator over a whole recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.estimation.constants import axes_of, rotors_of
from wind_sensors.estimation.intake import FAR_AHEAD_NS
from wind_sensors.estimation.outputs import ProcessedRecording
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.streaming import StreamingEstimator, make_estimator
from wind_sensors.station.inputs import angle_inputs
from wind_sensors.station.model import Angle
from wind_sensors.station.signals import Recording

TimeArray = npt.NDArray[np.int64]

_Feed = Callable[[int], None]


def _stretches(time: TimeArray, jump_ns: int) -> list[tuple[int, int]]:
    """Index ranges between steps back of the clock."""
    if time.size == 0:
        return []
    cuts = np.nonzero(np.diff(time) < -jump_ns)[0] + 1
    edges = [0, *(int(c) for c in cuts), int(time.size)]
    return list(pairwise(edges))


def _inputs(
    estimator: StreamingEstimator, recording: Recording
) -> list[tuple[TimeArray, _Feed]]:
    """Times of measurement of each input and what to do with its i-th message.

    A clock that drifts or stamps late does not delay its messages: live they would come when they
    were measured.
    """
    inputs: list[tuple[TimeArray, _Feed]] = []
    stamps = [p.time for p in recording.pulses.values()]
    stamps += [a.time for a in recording.angles.values()]
    zero = min((int(time.min()) for time in stamps if time.size), default=0)

    def pulses(name: str, time: list[int], turns: list[float] | None) -> _Feed:
        if turns is None:
            return lambda i: estimator.add_pulse(name, time[i])
        return lambda i: estimator.add_pulse(name, time[i], turns[i])

    def angles(name: str, time: list[int], angle: list[float]) -> _Feed:
        return lambda i: estimator.add_angle(name, time[i], angle[i])

    for name, p in recording.pulses.items():
        turns = None if p.turns is None else p.turns.tolist()
        feed = pulses(name, p.time.tolist(), turns)
        inputs.append((estimator.measured(name, p.time, zero), feed))
    for name, a in recording.angles.items():
        feed = angles(name, a.time.tolist(), a.angle.tolist())
        inputs.append((estimator.measured(name, a.time, zero), feed))
    states, moved = recording.platform, recording.platform_velocity
    if states is not None:
        times = states.time.tolist()

        def platform(i: int) -> None:
            estimator.add_platform(
                times[i], states.attitude[i], None if moved is not None else states.velocity[i],
                states.angular_rate[i], states.position[i],
            )

        inputs.append((estimator.measured("platform", states.time, zero), platform))
    if moved is not None:
        velocity = moved.velocity
        instants = moved.time.tolist()
        inputs.append(
            (
                estimator.measured("platform velocity", moved.time, zero),
                lambda i: estimator.add_platform_velocity(instants[i], velocity[i]),
            )
        )
    if recording.temperature is not None:
        warmth = recording.temperature
        inputs.append(
            (
                warmth.time,
                lambda i: estimator.add_air(int(warmth.time[i]), temperature=warmth.value[i]),
            )
        )
    if recording.pressure is not None:
        weight = recording.pressure
        inputs.append(
            (
                weight.time,
                lambda i: estimator.add_air(int(weight.time[i]), pressure=weight.value[i]),
            )
        )
    return inputs


def _in_order(
    inputs: list[tuple[TimeArray, _Feed]], jump_ns: int
) -> Iterator[tuple[_Feed, int]]:
    """Messages as they came: by time, and turn after turn where the clock jumps back."""
    parts = [_stretches(time, jump_ns) for time, _ in inputs]
    for turn in range(max((len(p) for p in parts), default=0)):
        times, which, index = [], [], []
        for k, (time, _) in enumerate(inputs):
            if turn < len(parts[k]):
                first, last = parts[k][turn]
                times.append(np.maximum.accumulate(time[first:last]))
                which.append(np.full(last - first, k))
                index.append(np.arange(first, last))
        order = np.argsort(np.concatenate(times), kind="stable")
        sources = np.concatenate(which)[order].tolist()
        places = np.concatenate(index)[order].tolist()
        for k, i in zip(sources, places, strict=True):
            yield inputs[k][1], i


def _must_tell_a_vector(recording: Recording) -> None:
    """Refuse a recording in which speed or direction was never measured.

    Raises:
        UserError: No rotor, no vane or no elevation was ever heard of.
    """
    station = recording.station
    axes = axes_of(station)
    topics = {r.name: r.pulses.topic for r in rotors_of(station)}
    for angle in station.instruments:
        if isinstance(angle, Angle):
            topics |= {name: source.topic for name, source in angle_inputs(angle).items()}
    heard = {name for name, p in recording.pulses.items() if p.time.size}
    heard |= {name for name, a in recording.angles.items() if a.time.size}
    for names, what in (
        ([r.name for r in rotors_of(station)], "speed"),
        ([axis.name for axis in axes if axis.azimuth < 0], "direction"),
        ([axis.name for axis in axes if axis.azimuth >= 0], "elevation"),
    ):
        if names and not heard.intersection(names):
            named = ", ".join(f"'{name}' ({topics[name]})" for name in names)
            said = [
                note for note in recording.notes for name in names if note.startswith(topics[name])
            ]
            raise UserError(
                f"nothing usable was heard of {named}, so the wind's {what} is not known.",
                recording.name,
                " ".join(
                    ["Check the instrument, the recorder and the topic in the station file."]
                    + [f"Reading said: {note}" for note in dict.fromkeys(said)]
                ),
            )


def _must_follow_one_another(recording: Recording) -> None:
    """Refuse signals of which most would be taken for implausible stamps.

    Raises:
        UserError: More than half of the instants come later than `FAR_AHEAD_NS` after the one
            before.
    """
    stamps = [p.time for p in recording.pulses.values()]
    stamps += [a.time for a in recording.angles.values()]
    step = np.diff(np.unique(np.concatenate(stamps)))
    apart = int(np.count_nonzero(step > FAR_AHEAD_NS))
    if apart > 0.5 * step.size:
        raise UserError(
            f"{apart} of {step.size + 1} stamps come more than {FAR_AHEAD_NS * 1e-9:g} s after the "
            f"one before (usually {np.median(step) * 1e-9:g} s); the filter needs pulses or "
            "samples.",
            recording.name,
            "If the messages are means, state `recording: {averaging_time: SECONDS}` in the "
            "station file; `wind diagnose` compares means.",
        )


def process(
    recording: Recording,
    settings: EstimatorSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> ProcessedRecording:
    """Run a streaming estimator over a recording.

    Args:
        recording: Station and signals.
        settings: Method, rates, windows; None: the defaults.
        progress: Called now and then with the share that is done, 0 to 1.

    Returns:
        All estimates, windows and the health at the end.

    Raises:
        UserError: The station lacks a rotor or a vane, the recording has no signals of them, or
            they are means and no samples.
    """
    chosen = settings if settings is not None else EstimatorSettings()
    estimator = make_estimator(recording.station, chosen)
    inputs = _inputs(estimator, recording)
    total = sum(int(time.size) for time, _ in inputs)
    if total == 0:
        raise UserError("The recording has no signals of its station.", recording.name)
    _must_tell_a_vector(recording)
    _must_follow_one_another(recording)
    for done, (feed, index) in enumerate(_in_order(inputs, round(chosen.jump_time * 1e9))):
        feed(index)
        if done % 4096 == 0 and progress is not None:
            progress(done / total)
    estimator.flush()
    found = estimator.take_estimate_arrays()
    windows = estimator.take_windows()
    if progress is not None:
        progress(1.0)
    return ProcessedRecording(
        recording=recording,
        method=chosen.method,
        time=found.time,
        velocity=found.velocity,
        covariance=found.covariance,
        apparent=found.apparent,
        apparent_covariance=found.apparent_covariance,
        to_earth=found.to_earth,
        windows=tuple(windows),
        health=tuple(estimator.health(whole=True)),
    )
