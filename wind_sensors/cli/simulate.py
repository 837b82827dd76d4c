"""`wind simulate`: the recording that a station would have made in a wind."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.motion.frames import velocity_from_direction, yaw_from_compass
from wind_sensors.recordings import load_station, read_recording, write_recording
from wind_sensors.recordings.raw_topics import TRUTH_TOPIC
from wind_sensors.recordings.writing import keep_inputs
from wind_sensors.simulation.run import simulate
from wind_sensors.simulation.scenario import Scenario, TransportFaults
from wind_sensors.simulation.trajectories import CARRIERS, Trajectory
from wind_sensors.simulation.transport import received
from wind_sensors.station.inputs import absolute
from wind_sensors.station.model import Input, Reference, Station
from wind_sensors.station.signals import PlatformStates, Recording, Winds
from wind_sensors.turbulence.synthesis import TurbulenceSpec, isotropic_spec, surface_layer_spec

FASTEST_RATE = 1000.0
"""Samples per second beyond which no wind sensor goes."""
LONGEST = 7.0 * 86_400.0
"""Longest simulation [s]."""
MOST_SAMPLES = 4_000_000
"""Of one simulation: a kilobyte each fills the memory of a usual machine."""

_UNITS = {"ms": 1e-3, "min": 60.0, "h": 3600.0, "s": 1.0}


def seconds(text: str) -> float:
    """A duration like `90`, `90s`, `50ms`, `15min`, `1h` in seconds."""
    number, factor = text, 1.0
    for unit, length in _UNITS.items():
        if text.endswith(unit):
            number, factor = text[: -len(unit)], length
            break
    try:
        value = float(number) * factor
    except ValueError as problem:
        raise argparse.ArgumentTypeError(
            f"'{text}' is not a duration: write it like 50ms, 90s, 15min or 1h"
        ) from problem
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"a duration must be positive, not '{text}'")
    if value > LONGEST:
        raise argparse.ArgumentTypeError(f"must be at most {LONGEST / 3600.0:g}h, not '{text}'")
    return value


def between(least: float, most: float, unit: str = "") -> Callable[[str], float]:
    """A type of argument: a number within limits.

    Args:
        least, most: Limits, both allowed.
        unit: For the message.
    """

    def number(text: str) -> float:
        try:
            value = float(text)
        except ValueError as problem:
            raise argparse.ArgumentTypeError(f"'{text}' is not a number") from problem
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(
                f"must be at least {least:g} and at most {most:g}{unit and f' {unit}'}, not {text}"
            )
        return value

    return number


def share(text: str) -> float:
    """A number from 0 to below 1."""
    try:
        value = float(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number") from problem
    if not 0.0 <= value < 1.0:
        raise argparse.ArgumentTypeError(f"must lie from 0 to below 1, not '{text}'")
    return value


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "simulate",
        help="wind to signals: write the recording a station would make",
        description="Simulate a station in a turbulent wind and write its RECORDING, with the "
        f"true wind on {TRUTH_TOPIC}, which is the reference of a station that has no other. What "
        "is wrong with the station's instruments stands in the station file. The same seed gives "
        "the same signals to the bit.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument(
        "station", metavar="STATION", help="station file, or the name of a shipped configuration"
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="folder to write")
    parser.add_argument("--force", action="store_true", help="replace OUT if it is there")
    parser.add_argument("--duration", type=seconds, default="15min", help="like 90s, 15min, 1h")
    parser.add_argument("--seed", type=int, default=0, help="of everything random, from 0")

    wind = parser.add_argument_group("wind")
    wind.add_argument(
        "--speed", type=between(0.01, 100.0, "m/s"), default=8.0, help="mean wind speed [m/s]"
    )
    wind.add_argument(
        "--direction-from", type=between(-360.0, 360.0, "deg"), default=270.0, metavar="DEG",
        help="direction the wind comes from, clockwise from north",
    )  # fmt: skip
    wind.add_argument("--intensity", type=share, default=0.12, help="turbulence intensity sigma/U")
    wind.add_argument(
        "--integral-length", type=between(0.1, 10_000.0, "m"), default=60.0, metavar="M",
        help="longitudinal integral length [m]",
    )  # fmt: skip
    wind.add_argument(
        "--surface-layer", action="store_true",
        help="anisotropic turbulence over the station's roughness at its height, instead of "
        "--intensity and --integral-length",
    )  # fmt: skip
    wind.add_argument(
        "--stability", type=between(-5.0, 2.0), default=0.0, metavar="Z/L",
        help="height over the Monin-Obukhov length, with --surface-layer",
    )  # fmt: skip
    wind.add_argument(
        "--slow-amplitude", type=between(-50.0, 50.0, "m/s"), default=0.0, metavar="M/S",
        help="amplitude of a slow change of the mean speed",
    )  # fmt: skip
    wind.add_argument(
        "--turn-amplitude", type=between(-180.0, 180.0, "deg"), default=0.0, metavar="DEG",
        help="amplitude of a slow turn of the mean direction",
    )  # fmt: skip
    wind.add_argument(
        "--slow-period", type=seconds, default="10min", help="period of both slow changes"
    )
    wind.add_argument(
        "--wind", metavar="RECORDING", help="blow this recording's reference wind instead"
    )

    carrier = parser.add_argument_group("carrier (a station with a platform)")
    carrier.add_argument("--carrier", choices=sorted(CARRIERS), help="how the platform moves")
    carrier.add_argument(
        "--platform-speed", type=between(0.0, 100.0, "m/s"), metavar="M/S", help="over ground"
    )
    carrier.add_argument(
        "--course", type=between(-360.0, 360.0, "deg"), metavar="DEG", default=90.0,
        help="clockwise from north",
    )  # fmt: skip
    carrier.add_argument(
        "--follow", metavar="RECORDING", help="move as the platform in this recording"
    )
    carrier.add_argument(
        "--exact-platform", action="store_true", help="the platform reports without noise"
    )

    air = parser.add_argument_group("air and rates")
    air.add_argument(
        "--temperature", type=between(-90.0, 60.0, "deg C"), default=15.0, help="[deg C]"
    )
    air.add_argument(
        "--temperature-amplitude", type=between(-40.0, 40.0, "K"), default=0.0,
        help="of a slow change [K]",
    )  # fmt: skip
    air.add_argument(
        "--pressure", type=between(10_000.0, 120_000.0, "Pa"), default=101_325.0, help="[Pa]"
    )
    air.add_argument(
        "--rate", type=between(0.01, FASTEST_RATE, "per second"), default=20.0,
        help="of all sampled signals [1/s]",
    )  # fmt: skip

    faults = parser.add_argument_group("faults of the transport")
    faults.add_argument("--loss", type=share, default=0.0, help="share of messages lost")
    faults.add_argument("--doubling", type=share, default=0.0, help="share that comes twice")
    faults.add_argument(
        "--jitter", type=seconds, default=None, help="largest random delay, like 50ms"
    )
    faults.add_argument("--nan", type=share, default=0.0, help="share of angles that are NaN")
    faults.add_argument(
        "--clock-jump", type=between(-LONGEST, LONGEST, "s"), nargs=2, metavar=("AT", "BY"),
        help="the stamping clock jumps by BY seconds AT seconds after the start",
    )  # fmt: skip
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    console = screen(stderr=True)
    if args.seed < 0:
        raise UserError("The seed must not be negative.", "--seed", "Use 0 or more.")
    keep_inputs(args.output, (args.station, args.wind, args.follow))
    station = _without_truth(load_station(args.station))
    scenario = _scenario(args, station)
    begin = time.perf_counter()
    with Progress(
        TextColumn("simulating"), BarColumn(), TextColumn("{task.completed:.0f} s of wind"),
        TimeElapsedColumn(), console=console, transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task("simulate", total=scenario.duration)
        recording = simulate(
            station, scenario, Path(args.output).name,
            progress=lambda done: progress.update(task, completed=done),
        )  # fmt: skip
    spent = time.perf_counter() - begin
    recording = _comparable(received(recording, scenario.faults))
    folder = write_recording(args.output, recording, force=args.force)
    print(_summary(recording, scenario.duration, spent))
    print(f"wrote {folder}")
    return 0


def _without_truth(station: Station) -> Station:
    """The station without a reference that is the truth, which every simulation writes anyway."""
    reference = station.reference
    if reference is None or absolute(reference.topic.topic) != TRUTH_TOPIC:
        return station
    return station.model_copy(update={"reference": None})


def _comparable(recording: Recording) -> Recording:
    """The recording with its true wind as reference, where its station has no other."""
    station = recording.station
    if station.reference is not None:
        return recording
    truth = Reference(kind="truth", topic=Input(topic=TRUTH_TOPIC))
    return replace(recording, station=station.model_copy(update={"reference": truth}))


def _scenario(args: argparse.Namespace, station: Station) -> Scenario:
    wind, duration = _wind(args, station)
    samples = duration * args.rate
    if samples > MOST_SAMPLES:
        raise UserError(
            f"these are {samples:.3g} samples of each signal, more than the memory holds.",
            "--duration, --rate",
            f"Simulate at most {MOST_SAMPLES / args.rate / 3600.0:.3g}h at this rate.",
        )
    jump_at, jump_by = args.clock_jump if args.clock_jump else (None, 0.0)
    return Scenario(
        wind=wind,
        duration=duration,
        seed=args.seed,
        trajectory=_trajectory(args),
        sample_rate=args.rate,
        vane_rate=args.rate,
        reference_rate=args.rate,
        platform_rate=args.rate,
        temperature=args.temperature,
        temperature_amplitude=args.temperature_amplitude,
        temperature_period=args.slow_period,
        pressure=args.pressure,
        platform_noise=not args.exact_platform,
        faults=TransportFaults(
            jitter=args.jitter or 0.0,
            loss=args.loss,
            doubling=args.doubling,
            not_a_number=args.nan,
            clock_jump_at=jump_at,
            clock_jump=jump_by,
            seed=args.seed,
        ),
    )


def _wind(args: argparse.Namespace, station: Station) -> tuple[TurbulenceSpec | Winds, float]:
    duration = float(args.duration)
    if args.wind:
        measured = read_recording(args.wind)
        wind = measured.truth if measured.reference is None else measured.reference
        if wind is None or wind.time.size < 2:
            raise UserError("The recording has no reference wind.", args.wind, "Name one that has.")
        stamps = wind.time
        return wind, min(duration, float(stamps.max() - stamps.min()) * 1e-9)
    towards = velocity_from_direction(1.0, args.direction_from)
    direction = math.atan2(float(towards[1]), float(towards[0]))
    if args.surface_layer:
        site = station.recording
        spec = surface_layer_spec(
            args.speed, site.measuring_height, site.roughness_length, args.stability,
            direction=direction, seed=args.seed,
        )  # fmt: skip
    else:
        spec = isotropic_spec(
            args.speed, args.intensity, args.integral_length, direction, args.seed
        )
    slow = replace(
        spec,
        slow_amplitude=args.slow_amplitude,
        slow_period=args.slow_period,
        turn_amplitude=math.radians(args.turn_amplitude),
    )
    return slow, duration


def _trajectory(args: argparse.Namespace) -> Trajectory | PlatformStates | None:
    if args.follow:
        followed = read_recording(args.follow)
        if followed.platform is None:
            raise UserError(
                "The recording has no platform to follow.", args.follow, "Name one that has."
            )
        return followed.platform
    if args.carrier is None:
        if args.platform_speed is not None:
            raise UserError(
                "--platform-speed needs to know what moves.", "--carrier", "Name a carrier."
            )
        return None
    course = float(yaw_from_compass(args.course))
    make = CARRIERS[args.carrier]
    if args.platform_speed is None:
        return make(course=course, seed=args.seed)
    return make(speed=args.platform_speed, course=course, seed=args.seed)


def _summary(recording: Recording, duration: float, spent: float) -> str:
    pulses = ", ".join(f"{p.time.size} pulses of {n}" for n, p in recording.pulses.items())
    angles = ", ".join(f"{a.time.size} readings of {n}" for n, a in recording.angles.items())
    return (
        f"simulated {duration:.0f} s in {spent:.1f} s ({duration / spent:.0f} times real time): "
        f"{pulses}{', ' if pulses and angles else ''}{angles}"
    )
