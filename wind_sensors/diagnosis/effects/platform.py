"""Effects of the carrier: motion, frames, and its own wind."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.effects.definition import Effect, Parameter, Values
from wind_sensors.motion.frames import heading_of
from wind_sensors.simulation.drive import Drive
from wind_sensors.station.model import (
    HeadingDeviation,
    Instrument,
    Platform,
    Station,
)

Entry = Instrument | Platform

FloatArray = npt.NDArray[np.float64]

DEAD_SHARE = 0.2
"""A log that shows less than this share of what the positions' change shows is dead."""

DEAD_AVERAGE = 10.0
"""Time [s] over which the two are compared."""

LEAST_TRAVEL = 0.5
"""Speed [m/s] below which a carrier may well stand still."""

DEAD_SHORTEST = 60.0
"""A log that is silent for less [s] is not held to be dead."""

LIVING_SHARE = 0.5
SHORTEST_LIFE = 20.0
"""A log is alive that shows at least this share of what the positions' change shows, for so long
altogether [s]."""

MISSING_SHARE = 0.5
"""Smallest share of the carrier's velocity that counts as not removed; what lacks less is a wrong
scale."""

SECTORS = 8
FEWEST_SECTORS = 4
SHORTEST_VISIT = 0.01
"""A carrier that spends this share of the record in each of so many of these sectors of heading
shows what its compass does twice a turn."""


def _is_platform(entry: Entry, station: Station) -> bool:
    return isinstance(entry, Platform)


def _speeds(drive: Drive) -> tuple[FloatArray, FloatArray] | None:
    """Reported speed and that of the positions [m/s], shape (n,) each; None: they are not known."""
    motion = drive.motion
    if motion is None or motion.travel is None:
        return None
    wide = max(1, int(DEAD_AVERAGE / drive.dt))
    reported, moved = (
        np.sqrt(np.maximum(uniform_filter1d(np.sum(v * v, axis=1), wide, mode="nearest"), 0.0))
        for v in (motion.velocity, motion.travel)
    )
    return reported, moved


def dead_log(drive: Drive) -> tuple[float, float] | None:
    """Where the positions move and the reported velocity does not, for the longest time.

    Returns:
        Begin and end [s since the drive's first instant]; None: nowhere.
    """
    speeds = _speeds(drive)
    if speeds is None:
        return None
    reported, moved = speeds
    dead = (moved > LEAST_TRAVEL) & (reported < DEAD_SHARE * moved)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], dead, [False])).astype(int)))
    if edges.size == 0:
        return None
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins))
    begin, end = float(begins[longest] * drive.dt), float(ends[longest] * drive.dt)
    return (begin, end) if end - begin > DEAD_SHORTEST else None


def log_lives(drive: Drive, begin: float, end: float) -> bool:
    """Whether the reported velocity goes with the positions' for a while.

    Args:
        drive: Holds both.
        begin, end: Where [s since the drive's first instant].
    """
    speeds = _speeds(drive)
    if speeds is None:
        return False
    reported, moved = (speed[int(begin / drive.dt) : int(end / drive.dt) + 1] for speed in speeds)
    living = (moved > LEAST_TRAVEL) & (reported > LIVING_SHARE * moved)
    return bool(drive.dt * np.count_nonzero(living) > SHORTEST_LIFE)


def log_is_dead(drive: Drive) -> bool:
    """Whether the positions move somewhere and the reported velocity does not."""
    return dead_log(drive) is not None


def _share(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Platform)
    return {
        "velocity_share": values["velocity_share"],
        "position_share": values.get("position_share", entry.position_share),
    }


def _share_size(values: Values) -> float:
    missing = abs(values["velocity_share"] - 1.0)
    return max(missing, values.get("position_share", 0.0)) / MISSING_SHARE


PLATFORM_VELOCITY = Effect(
    name="platform_velocity",
    meaning="The carrier's motion is not in the signals, or has been removed already.",
    entrance="wind",
    equation="apparent wind = wind - share * ((1 - q) V + q d(position)/dt + omega x r)",
    source="rigid-body kinematics",
    region="with the carrier's speed and heading",
    # A share of a velocity is a scale of it.
    contains=frozenset({"platform_velocity_scale"}),
    parameters=(
        Parameter(
            "velocity_share", "1", -1.2, 1.0, healthy=1.0, minimum=MISSING_SHARE,
            starts=(0.0, 0.5), step=0.02,
        ),
        Parameter(
            "position_share", "1", 0.0, 1.0, healthy=0.0, starts=(1.0,), step=0.02,
            free=log_is_dead,
        ),
    ),
    applies=_is_platform,
    update=_share,
    exact=True,
    templates=({"velocity_share": 0.9, "position_share": 0.0},),
    confusable={
        "platform_velocity_scale": "a run at another speed against an independent log",
    },
    size=_share_size,
)


def _velocity_scale(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Platform)
    return {"velocity_scale": entry.velocity_scale * values["velocity_scale"]}


PLATFORM_VELOCITY_SCALE = Effect(
    name="platform_velocity_scale",
    meaning="The carrier's speed is reported in a wrong scale.",
    entrance="wind",
    equation="V true = V reported / scale",
    source="rigid-body kinematics",
    region="with the carrier's speed and heading",
    parameters=(
        # Knots or km/h for m/s, or the other way round, are errors of 0.28 to 3.6.
        Parameter(
            "velocity_scale", "1", 0.1, 6.0, healthy=1.0, minimum=0.05, step=0.01,
            starts=(0.4, 0.7, 1.5, 2.5),
        ),
    ),
    applies=_is_platform,
    update=_velocity_scale,
    exact=True,
    templates=({"velocity_scale": 1.05},),
    confusable={
        "platform_velocity": "a run at another speed against an independent log",
        "lever_arm": "a straight run without turning: the lever arm falls silent",
    },
)


def _lever(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Platform)
    x, y, z = entry.sensor_position
    return {"sensor_position": (x + values["dx"], y + values["dy"], z + values["dz"])}


def _lever_size(values: Values) -> float:
    return math.hypot(values["dx"], values["dy"], values["dz"]) / 0.5


LEVER_ARM = Effect(
    name="lever_arm",
    meaning="The sensor does not sit where the station file says.",
    entrance="wind",
    equation="apparent wind = wind - V - omega x (r + d)",
    source="rigid-body kinematics",
    region="while the carrier rolls, pitches or turns",
    parameters=tuple(
        Parameter(
            name, "m", -30.0, 30.0, minimum=0.5, step=0.1, starts=(-5.0, -2.0, 2.0, 5.0),
            spare=True,
        )
        for name in ("dx", "dy", "dz")
    ),
    applies=_is_platform,
    update=_lever,
    exact=True,
    form_error=0.12,
    templates=(
        {"dx": 0.5, "dy": 0.0, "dz": 0.0},
        {"dx": 0.0, "dy": 0.5, "dz": 0.0},
        {"dx": 0.0, "dy": 0.0, "dz": 0.5},
    ),
    confusable={"vane_imbalance": "a straight run in calm water; a tape measure"},
    size=_lever_size,
)


def _deviation(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Platform)
    stated = entry.heading_deviation
    return {
        "heading_deviation": HeadingDeviation.model_construct(
            constant_deg=stated.constant_deg + values["constant"],
            sine_deg=stated.sine_deg + values["sine"],
            cosine_deg=stated.cosine_deg + values["cosine"],
            sine_2_deg=stated.sine_2_deg + values["sine_2"],
            cosine_2_deg=stated.cosine_2_deg + values["cosine_2"],
        )
    }


def _deviation_size(values: Values) -> float:
    once = math.hypot(values["sine"], values["cosine"])
    twice = math.hypot(values["sine_2"], values["cosine_2"])
    return max(abs(values["constant"]), once, twice) / 2.0


def _goes_round(drive: Drive) -> bool:
    """Whether the carrier shows its compass on headings all around."""
    if drive.motion is None:
        return False
    heading = np.mod(heading_of(drive.motion.attitude), 2.0 * np.pi)
    visits = np.bincount((heading * (SECTORS / (2.0 * np.pi))).astype(np.intp), minlength=SECTORS)
    return int(np.count_nonzero(visits > SHORTEST_VISIT * heading.size)) >= FEWEST_SECTORS


HEADING_DEVIATION = Effect(
    name="heading_deviation",
    meaning="The compass deviates, by a constant and with the heading.",
    entrance="wind",
    equation="heading h reported as h + A + B sin h + C cos h + D sin 2h + E cos 2h",
    source="compass deviation, coefficients A to E",
    region="with the carrier's heading",
    parameters=(
        Parameter("constant", "deg", -45.0, 45.0, minimum=2.0, step=0.5, spare=True),
        Parameter("sine", "deg", -45.0, 45.0, minimum=2.0, step=0.5),
        Parameter("cosine", "deg", -45.0, 45.0, minimum=2.0, step=0.5),
        *(
            Parameter(
                name, "deg", -15.0, 15.0, minimum=2.0, step=0.5, spare=True, free=_goes_round
            )
            for name in ("sine_2", "cosine_2")
        ),
    ),
    applies=_is_platform,
    update=_deviation,
    exact=True,
    templates=tuple(
        {**dict.fromkeys(("constant", "sine", "cosine", "sine_2", "cosine_2"), 0.0), name: 2.0}
        for name in ("constant", "sine", "cosine")
    ),
    confusable={
        "vane_offset": "a full circle: a compass error changes with the heading",
        "frame_error": "a full circle",
    },
    size=_deviation_size,
)


OTHER_AXES: dict[str, Literal["platform", "earth"]] = {"platform": "earth", "earth": "platform"}
"""Axes in which the velocity may be reported, whichever the station file states."""


def _rotation(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Platform)
    roll, pitch, yaw = entry.sensor_rotation_deg
    keys: dict[str, Any] = {
        "sensor_rotation_deg": (roll + values["roll"], pitch + values["pitch"], yaw),
        "velocity_turn_deg": entry.velocity_turn_deg + values["velocity_turn"],
    }
    if values["other_axes"] > 0.5:
        keys["velocity_axes"] = OTHER_AXES[entry.velocity_axes]
    return keys


def _rotation_size(values: Values) -> float:
    lean = math.hypot(values["roll"], values["pitch"])
    turn = 90.0 * values["other_axes"]
    return max(lean, abs(values["velocity_turn"]), turn) / 6.0


FRAME_ERROR = Effect(
    name="frame_error",
    meaning="The carrier's velocity or the sensor is in another frame than stated.",
    entrance="wind",
    equation="V true = R(-turn) V reported; sensor axes = R(roll, pitch) carrier axes; "
    "V reported in earth's axes where the carrier's are stated, or the reverse",
    source="REP-103",
    region="with the carrier's speed, or while it leans",
    parameters=(
        Parameter("roll", "deg", -90.0, 90.0, minimum=6.0, step=0.5, spare=True),
        Parameter("pitch", "deg", -90.0, 90.0, minimum=6.0, step=0.5, spare=True),
        Parameter(
            "velocity_turn", "deg", -270.0, 270.0, minimum=6.0, step=1.0,
            starts=(20.0, -20.0, 90.0, -90.0, 180.0), spare=True,
        ),
        Parameter("other_axes", "1", 0.0, 1.0, value_from="forms"),
    ),
    applies=_is_platform,
    update=_rotation,
    exact=True,
    includes=frozenset({"axis_tilt"}),
    templates=(
        {"roll": 3.0, "pitch": 0.0, "velocity_turn": 0.0, "other_axes": 0.0},
        {"roll": 0.0, "pitch": 3.0, "velocity_turn": 0.0, "other_axes": 0.0},
        {"roll": 0.0, "pitch": 0.0, "velocity_turn": 6.0, "other_axes": 0.0},
    ),
    confusable={
        "vane_offset": "sight the vane's mark along the keel",
        "heading_deviation": "a full circle at rest: a wrong velocity frame falls silent",
        "platform_velocity_scale": "a run on another course against an independent log",
    },
    size=_rotation_size,
)


def _downwash(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Platform)
    stated = entry.downwash
    forward, leftward = stated.spread
    return {
        "downwash": stated.model_copy(
            update={
                "induced_velocity": stated.induced_velocity + values["induced_velocity"],
                "wake_skew": stated.wake_skew + values["wake_skew"],
                "spread": (forward + values["forward"], leftward + values["leftward"]),
            }
        )
    }


ROTOR_DOWNWASH = Effect(
    name="rotor_downwash",
    meaning="The inflow of the carrier's own rotors reaches the sensor.",
    entrance="wind",
    equation="w' = w - v_i; u' = u + v_i (skew u / |v_h| + spread); "
    "v_i sqrt(u^2 + v_i^2) = v_h^2",
    source="Glauert's momentum theory of a rotor in forward flight",
    region="strongest at low airspeed",
    occasional=True,
    stirs=True,
    parameters=(
        Parameter("induced_velocity", "m/s", 0.0, 10.0, minimum=0.3, step=0.1),
        # A jet blows down above all: what hardly does is no jet.
        Parameter("wake_skew", "1", 0.0, 0.4, healthy=None, step=0.05),
        Parameter("forward", "1", -0.7, 0.7, healthy=None, step=0.05),
        Parameter("leftward", "1", -0.7, 0.7, healthy=None, step=0.05),
    ),
    applies=_is_platform,
    update=_downwash,
    templates=(
        {"induced_velocity": 0.5, "wake_skew": 0.0, "forward": 0.0, "leftward": 0.0},
        {"induced_velocity": 0.5, "wake_skew": 0.3, "forward": 0.0, "leftward": 0.0},
    ),
    confusable={"calibration_offset": "rotors off, the same wind"},
    size=lambda values: abs(values["induced_velocity"]) / 0.3,
)

EFFECTS = (
    PLATFORM_VELOCITY,
    PLATFORM_VELOCITY_SCALE,
    LEVER_ARM,
    HEADING_DEVIATION,
    FRAME_ERROR,
    ROTOR_DOWNWASH,
)
