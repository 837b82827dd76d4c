"""`wind simulate`: the recording that a station would have made in a wind."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import replace

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from wind_sensors.cli.durations import LONGEST, METAVAR, seconds, seconds_by_unit
from wind_sensors.cli.option_rules import Rule, obey
from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.motion.frames import velocity_from_direction, yaw_from_compass
from wind_sensors.recordings import load_station, read_recording, write_recording
from wind_sensors.recordings.raw_topics import TRUTH_TOPIC
from wind_sensors.recordings.reading import name_of
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
MOST_SAMPLES = 4_000_000
"""Of one simulation: a kilobyte each fills the memory of a usual machine."""

_TOLERANCE = 1.0
"""By so much a duration may exceed the measured wind that is blown again [s]."""

_DEFAULTS: dict[str, float] = {
    "duration": 900.0,
    "speed": 8.0,
    "direction_from": 270.0,
    "intensity": 0.12,
    "integral_length": 60.0,
    "stability": 0.0,
    "slow_amplitude": 0.0,
    "turn_amplitude": 0.0,
    "slow_period": 600.0,
    "course": 90.0,
}
"""Of the options that have an effect only with or without others."""

RULES = (
    Rule(
        "--wind",
        excludes=(
            "--speed", "--direction-from", "--intensity", "--integral-length", "--surface-layer",
            "--stability", "--slow-amplitude", "--turn-amplitude",
        ),
    ),
    Rule("--surface-layer", excludes=("--intensity", "--integral-length")),
    Rule("--stability", needs=("--surface-layer",)),
    Rule(
        "--slow-period",
        needs=("--slow-amplitude", "--turn-amplitude", "--temperature-amplitude"),
    ),
    Rule("--follow", excludes=("--carrier", "--platform-speed", "--course")),
    Rule("--platform-speed", needs=("--carrier",)),
    Rule("--course", needs=("--carrier",)),
)
"""Which options go together."""


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
    )
    parser.add_argument(
        "station", metavar="STATION", help="station file, or the name of a shipped configuration"
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="folder to write")
    parser.add_argument("--force", action="store_true", help="replace OUT if it is there")
    parser.add_argument(
        "--duration", type=seconds, metavar=METAVAR,
        help="like 90s, 15min, 1h (default: 15min, or as long as the wind of --wind)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of everything random, from 0 (default: %(default)s)"
    )

    def number(
        group: argparse._ArgumentGroup, option: str, kind: Callable[[str], float], unit: str,
        what: str, default: float | None = None,
    ) -> None:
        """An option for a number; without a default of its own `_DEFAULTS` has one."""
        shown = _DEFAULTS.get(option[2:].replace("-", "_"), default)
        text = what if shown is None else f"{what} (default: {shown:g})"
        group.add_argument(option, type=kind, default=default, metavar=unit, help=text)

    wind = parser.add_argument_group("wind")
    number(wind, "--speed", between(0.01, 100.0, "m/s"), "M/S", "mean wind speed")
    number(
        wind, "--direction-from", between(-360.0, 360.0, "deg"), "DEG",
        "direction the wind comes from, clockwise from north",
    )
    number(wind, "--intensity", share, "SHARE", "turbulence intensity sigma/U")
    number(
        wind, "--integral-length", between(0.1, 10_000.0, "m"), "M", "longitudinal integral length"
    )
    wind.add_argument(
        "--surface-layer", action="store_true",
        help="anisotropic turbulence over the station's roughness at its height, instead of "
        "--intensity and --integral-length",
    )
    number(
        wind, "--stability", between(-5.0, 2.0), "Z/L",
        "height over the Monin-Obukhov length, with --surface-layer",
    )
    number(
        wind, "--slow-amplitude", between(-50.0, 50.0, "m/s"), "M/S",
        "amplitude of a slow change of the mean speed",
    )
    number(
        wind, "--turn-amplitude", between(-180.0, 180.0, "deg"), "DEG",
        "amplitude of a slow turn of the mean direction",
    )
    wind.add_argument(
        "--slow-period", type=seconds, metavar=METAVAR,
        help="period of the slow changes, that of the temperature too (default: 10min)",
    )
    wind.add_argument(
        "--wind", metavar="RECORDING", help="blow this recording's reference or true wind instead"
    )

    carrier = parser.add_argument_group("carrier (a station with a platform)")
    carrier.add_argument("--carrier", choices=sorted(CARRIERS), help="how the platform moves")
    number(
        carrier, "--platform-speed", between(0.0, 100.0, "m/s"), "M/S",
        "over ground, with --carrier (default: the carrier's usual one)",
    )
    number(
        carrier, "--course", between(-360.0, 360.0, "deg"), "DEG",
        "clockwise from north, with --carrier",
    )
    carrier.add_argument(
        "--follow", metavar="RECORDING", help="move as the platform in this recording"
    )
    carrier.add_argument(
        "--exact-platform", action="store_true", help="the platform reports without noise"
    )

    air = parser.add_argument_group("air and rates")
    number(air, "--temperature", between(-90.0, 60.0, "deg C"), "DEG_C", "of the air", 15.0)
    number(
        air, "--temperature-amplitude", between(-40.0, 40.0, "K"), "K",
        "of a slow change of the temperature (default: none)",
    )
    number(air, "--pressure", between(10_000.0, 120_000.0, "Pa"), "PA", "of the air", 101_325.0)
    number(
        air, "--rate", between(0.01, FASTEST_RATE, "per second"), "HZ",
        "of all sampled signals", 20.0,
    )

    faults = parser.add_argument_group("faults of the transport")
    number(faults, "--loss", share, "SHARE", "of messages lost", 0.0)
    number(faults, "--doubling", share, "SHARE", "of messages that come twice", 0.0)
    faults.add_argument(
        "--jitter", type=seconds_by_unit, metavar=METAVAR,
        help="largest random delay, with its unit, like 50ms (default: none)",
    )
    number(faults, "--nan", share, "SHARE", "of angles that are NaN", 0.0)
    faults.add_argument(
        "--clock-jump", type=between(-LONGEST, LONGEST, "s"), nargs=2, metavar=("AT", "BY"),
        help="the stamping clock jumps by BY seconds AT seconds after the start",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    console = screen(stderr=True)
    if args.seed < 0:
        raise UserError("The seed must not be negative.", "--seed", "Use 0 or more.")
    keep_inputs(args.output, (args.station, args.wind, args.follow))
    obey(args, RULES)
    station = _without_truth(load_station(args.station))
    if args.exact_platform and station.platform is None:
        raise UserError(
            "this has no effect on a station without a platform.", "--exact-platform",
            "Leave it out, or add `platform` to the station file.",
        )
    scenario = _scenario(_completed(args), station)
    begin = time.perf_counter()
    with Progress(
        TextColumn("simulating"), BarColumn(), TextColumn("{task.completed:.0f} s of wind"),
        TimeElapsedColumn(), console=console, transient=True,
    ) as progress:
        task = progress.add_task("simulate", total=scenario.duration)
        recording = simulate(
            station, scenario, name_of(args.output),
            progress=lambda done: progress.update(task, completed=done),
        )
    spent = time.perf_counter() - begin
    recording = _comparable(received(recording, scenario.faults))
    folder = write_recording(args.output, recording, force=args.force)
    print(_summary(recording, scenario.duration, spent))
    print(f"wrote {folder}")
    return 0


def _completed(args: argparse.Namespace) -> argparse.Namespace:
    """The options with their defaults; the duration of a measured wind stays open."""
    values = vars(args)
    open_ended = {"duration"} if args.wind else set()
    missing = {
        name: value
        for name, value in _DEFAULTS.items()
        if values[name] is None and name not in open_ended
    }
    return argparse.Namespace(**{**values, **missing})


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
        temperature_amplitude=args.temperature_amplitude or 0.0,
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
    if args.wind:
        measured = read_recording(args.wind)
        wind = measured.truth if measured.reference is None else measured.reference
        if wind is None or wind.time.size < 2:
            raise UserError("The recording has no reference wind.", args.wind, "Name one that has.")
        length = float(wind.time.max() - wind.time.min()) * 1e-9
        duration = length if args.duration is None else float(args.duration)
        if duration > length + _TOLERANCE:
            raise UserError(
                f"the wind of {args.wind} lasts only {length:.0f} s.",
                "--duration",
                "Leave it out to use all of that wind.",
            )
        return wind, min(duration, length)
    towards = velocity_from_direction(1.0, args.direction_from)
    direction = math.atan2(float(towards[1]), float(towards[0]))
    if args.surface_layer:
        site = station.recording
        spec = surface_layer_spec(
            args.speed, site.measuring_height, site.roughness_length, args.stability,
            direction=direction, seed=args.seed,
        )
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
    return slow, float(args.duration)


def _trajectory(args: argparse.Namespace) -> Trajectory | PlatformStates | None:
    if args.follow:
        followed = read_recording(args.follow)
        if followed.platform is None:
            raise UserError(
                "The recording has no platform to follow.", args.follow, "Name one that has."
            )
        return followed.platform
    if args.carrier is None:
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
