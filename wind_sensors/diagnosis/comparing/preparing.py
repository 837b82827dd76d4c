"""From a recording and its station to a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import numpy.typing as npt
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.activity import counted_segments, segments_of
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.counted_time import (
    silent_spans,
    where_reference_is,
    where_vanes_tell,
    without_repeats,
)
from wind_sensors.diagnosis.comparing.moving import in_slow_wind
from wind_sensors.diagnosis.comparing.observation import (
    SERIES_INTERVAL,
    Grid,
    angle_series,
    channels_of,
    rate_series,
)
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import without_bounces
from wind_sensors.diagnosis.comparing.reference_place import Place, delayed
from wind_sensors.diagnosis.comparing.spectra import quick_length
from wind_sensors.diagnosis.comparing.turning import slow_departure, where_vanes_follow
from wind_sensors.errors import UserError
from wind_sensors.simulation.drive import drive_from_recording
from wind_sensors.simulation.memory import DriveMemory
from wind_sensors.simulation.rotor_axes import wind_in_rotor_axes
from wind_sensors.simulation.wind_at_sensor import WindAtSensors
from wind_sensors.station.doubles import without_doubles
from wind_sensors.station.model import Propeller, Rotor, Station
from wind_sensors.station.signals import Angles, Pulses, Recording
from wind_sensors.station.silence import tells

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

SHORTEST = 60.0
"""A recording needs this much time in common with its reference [s]."""

DIRECTION_TIME = 60.0
SPEED_TIME = 10.0
"""Direction and speed are slow ones over these times [s]."""

MOST_REPEATED = 0.8
"""With more of the reference's samples repeated, too little is known of the wind."""

HARDLY_TURNS = 0.4
"""Below this share of the rate that it should have, a rotor's eddies say nothing."""


def prepare(
    recording: Recording,
    station: Station | None = None,
    place: Place | None = None,
    moving: Station | None = None,
) -> Comparison:
    """Prepare a recording for comparison.

    Args:
        recording: With a reference wind.
        station: Station to compare with; None: the recording's own.
        place: Where the reference stands; None: unknown, its wind counts as that at the sensors.
        moving: The same station, moving as it is believed to: it tells the slow speed and direction
            of the wind at the sensors, by which eddies are measured; None: `station` does.

    Raises:
        UserError: There is no reference, or too little of anything.
    """
    known = recording.station if station is None else station
    believed = known if moving is None else moving
    recording, repeated = without_repeats(without_doubles(recording))
    if repeated > MOST_REPEATED:
        raise UserError(
            f"The reference repeats the same wind in {100.0 * repeated:.0f} % of its samples.",
            recording.name,
            "Its heads are wet or iced, or its driver fills gaps; compare another recording.",
        )
    drive = drive_from_recording(recording)
    seconds = (len(drive) - 1) * drive.dt
    if seconds < SHORTEST:
        raise UserError(
            f"Only {seconds:.0f} s of reference wind: too little to compare anything.",
            recording.name,
            f"Record at least {SHORTEST:.0f} s, better 15 minutes.",
        )
    whole = int(seconds / SERIES_INTERVAL)
    number = quick_length(whole)
    grid = Grid(drive.start_ns, SERIES_INTERVAL * whole / number, number)
    channels = tuple(
        c
        for c in channels_of(known)
        if (
            c.instrument in recording.pulses
            if c.kind == "rotor_rate"
            # What says nothing would be taken to do what is expected of it.
            else tells(recording.angles.get(c.instrument))
        )
    )
    if not channels:
        raise UserError(
            "No instrument of the station has signals in the recording.",
            recording.name,
            "Check the topics in the station file with `wind info`.",
        )
    first = known.instrument(channels[0].instrument)
    felt = WindAtSensors(believed, drive).flow(first)
    if place is not None:
        drive = delayed(drive, felt.wind, place)
        felt = WindAtSensors(believed, drive).flow(first)
    flow = felt.wind
    at = np.arange(len(drive)) * drive.dt
    coming_from = np.unwrap(np.arctan2(-flow[:, 1], -flow[:, 0]))
    speed = np.hypot(flow[:, 0], flow[:, 1])

    def slowly(values: FloatArray, seconds: float) -> FloatArray:
        width = min(int(seconds / drive.dt), values.size - 1) | 1
        return np.interp(grid.centres, at, uniform_filter1d(values, width, mode="mirror"))

    # On a mount that turns the mean is that of a wind seen by a mount that does not.
    heading = cumulative_trapezoid(felt.turning[:, 2], dx=drive.dt, initial=0)
    cosine, sine = np.cos(heading), np.sin(heading)
    x = slowly(cosine * flow[:, 0] - sine * flow[:, 1], DIRECTION_TIME)
    y = slowly(sine * flow[:, 0] + cosine * flow[:, 1], DIRECTION_TIME)
    slow_direction = np.unwrap(np.arctan2(-y, -x)) - np.interp(grid.centres, at, heading)
    slow_speed = slowly(speed, SPEED_TIME)
    empty = Simulated({}, {}, {}, {}, counted_segments(grid, None))
    comparison = Comparison(
        recording=recording,
        station=known,
        drive=drive,
        grid=grid,
        channels=channels,
        direction=slow_direction,
        speed=np.maximum(slow_speed, 0.5),
        wind_from=np.interp(grid.centres, at, coming_from),
        measured=empty,
        place=place,
        memory=DriveMemory(drive),
        repeated=repeated,
        debounced=_debounced(recording),
    )
    simulated, angles = comparison.signals(believed)
    if drive.motion is not None:
        comparison = replace(comparison, moving=in_slow_wind(drive, believed, DIRECTION_TIME))
    turning = _where_rotors_turn(comparison, simulated)
    comparison = replace(
        comparison,
        expected=_expected(comparison, angles),
        across=_across(comparison, believed),
        measured=replace(empty, counted=empty.counted & turning),
    )
    answering = max(c.length for c in channels) / comparison.speed
    known_wind = where_reference_is(recording, grid, answering)
    beside = _beside_expected(comparison)
    departure = {
        name: slow_departure(angle, comparison.speed, grid) for name, angle in beside.items()
    }
    comparison = replace(comparison, departure=departure)
    followed = where_vanes_follow(beside.values(), comparison.speed, grid)
    silent = {
        c.instrument: silent_spans(recording.angles[c.instrument], grid)
        for c in channels
        if c.kind == "vane_angle"
    }
    counted = known_wind * followed * where_vanes_tell(chain(*silent.values()), grid)
    if counted.all():
        return comparison.measuring()
    seconds = float(counted.sum()) * grid.dt
    if seconds < SHORTEST:
        raise UserError(
            f"In only {seconds:.0f} s both the reference and the vanes tell something: too little "
            "to compare anything.",
            recording.name,
            f"Record at least {SHORTEST:.0f} s, better 15 minutes.",
        )
    notes = (*recording.notes, *(_in_words(name, spans) for name, spans in silent.items() if spans))
    noted = replace(comparison, recording=replace(comparison.recording, notes=notes))
    return noted.within(counted)


def _in_words(vane: str, spans: Sequence[tuple[float, float]]) -> str:
    """What is not compared because a vane says nothing, for people."""
    silent = sum(end - begin for begin, end in spans)
    begin, end = max(spans, key=lambda span: span[1] - span[0])
    return (
        f"{vane}: no readings for {silent:.0f} s, the longest time from {begin:.0f} to {end:.0f} "
        "s, so that nothing is compared then"
    )


def _debounced(recording: Recording) -> dict[str, Pulses]:
    """Pulses without bounces, of rotors whose contacts bounce."""
    found = {
        rotor.name: without_bounces(recording.pulses[rotor.name], rotor.pulses_per_revolution)
        for rotor in recording.station.instruments
        if isinstance(rotor, Rotor) and rotor.name in recording.pulses
    }
    return {name: pulses for name, pulses in found.items() if pulses is not None}


def _where_rotors_turn(
    comparison: Comparison, simulated: Mapping[str, Pulses]
) -> npt.NDArray[np.bool_]:
    """Segments in which no rotor nearly stands still that should turn, shape (segments,).

    How lively a rotor is that stops and starts again depends on how its bearing lets go.
    """
    number = segments_of(comparison.grid)
    turning = np.ones(int(number[-1]) + 1, dtype=np.bool_)
    for channel in comparison.channels:
        rotor = comparison.station.instrument(channel.instrument)
        if isinstance(rotor, Rotor):
            measured, expected = (
                np.bincount(number, np.abs(rate_series(pulses, rotor, comparison.grid)))
                for pulses in (
                    comparison.recording.pulses[channel.instrument],
                    simulated[channel.instrument],
                )
            )
            turning &= measured >= HARDLY_TURNS * expected
    return turning


def _expected(comparison: Comparison, angles: Mapping[str, Angles]) -> dict[str, FloatArray]:
    """Simulated deviation of each vane from the slow direction [rad]."""
    return {
        c.name: angle_series(angles[c.instrument], comparison.direction, comparison.grid)
        for c in comparison.channels
        if c.kind == "vane_angle"
    }


def _across(
    comparison: Comparison, believed: Station
) -> dict[str, ComplexArray]:
    """Simulated wind in each propeller's plane of rotation, relative to the slow wind, by name."""
    drive, grid = comparison.drive, comparison.grid
    winds = WindAtSensors(believed, drive, comparison.memory)
    at = np.arange(len(drive)) * drive.dt
    turned = comparison.respond(believed).angles
    out = {}
    for channel in comparison.channels:
        propeller = believed.instrument(channel.instrument)
        if not isinstance(propeller, Propeller):
            continue
        carrier = turned.get(propeller.mounted_on)
        _, across, direction = wind_in_rotor_axes(
            believed, propeller, winds, None if carrier is None else (carrier.angle, carrier.rate)
        )
        x = np.interp(grid.centres, at, across * np.cos(direction))
        y = np.interp(grid.centres, at, across * np.sin(direction))
        out[propeller.name] = np.asarray((x + 1j * y) / comparison.speed, dtype=np.complex128)
    return out


def _beside_expected(comparison: Comparison) -> dict[str, FloatArray]:
    """Measured minus simulated angle of each vane [rad], by channel name."""
    seen = comparison.observe({}, comparison.recording.angles).series
    return {
        name: series / comparison.speed - comparison.expected[name]
        for name, series in seen.items()
    }
