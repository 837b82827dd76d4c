"""Whether two station files describe one station."""

from __future__ import annotations

from wind_sensors.errors import UserError
from wind_sensors.station.model import AnyInstrument, Station

MADE = (
    "kind",
    "pulses_per_revolution",
    "calibration_distance",
    "distance_constant",
    "damping_ratio",
    "arm_radius",
    "starting_speed",
    "stall_speed",
    "angular_response_deg",
    "angular_response",
    "mounted_on",
    "distance_to_vane_axis",
    "axis",
)
"""Keys that say which instrument it is: its kind, how it was built and calibrated. What can go
wrong with it, where its signals come from and when they fail may differ from file to file."""


def first_difference(one: Station, other: Station) -> str:
    """The first thing in which two files describe different stations, in words; empty: none.

    Instruments are compared by name with the keys in `MADE`, beside them whether there is a
    carrier and whether messages are samples or means. Times, topics, the reference and what is
    known to be wrong are not compared.

    Args:
        one, other: Stations; the words call `one` there and `other` here.
    """
    ours = {entry.name: entry for entry in one.instruments}
    theirs = {entry.name: entry for entry in other.instruments}
    if sorted(ours) != sorted(theirs):
        return f"the instruments are {', '.join(ours)} there and {', '.join(theirs)} here"
    for name, entry in ours.items():
        found = _unlike(entry, theirs[name])
        if found:
            return found
    if (one.platform is None) != (other.platform is None):
        return "only one of them has a platform"
    if one.recording.averaging_time != other.recording.averaging_time:
        times = (one.recording.averaging_time, other.recording.averaging_time)
        return "recording.averaging_time is {:g} s there and {:g} s here".format(*times)
    return ""


def refuse_another(station: Station, healthy: Station, where: str) -> None:
    """Refuse what was learnt on another station.

    Args:
        station: The station that is to be judged.
        healthy: The station of a healthy recording or of a baseline.
        where: The file of the latter.

    Raises:
        UserError: They differ.
    """
    difference = first_difference(station, healthy)
    if difference:
        raise UserError(
            f"this is not the station that is to be judged: {difference}.",
            where,
            "Name healthy recordings of the same station; if it is the same, make its station "
            "files agree.",
        )


def _unlike(entry: AnyInstrument, other: AnyInstrument) -> str:
    for key in MADE:
        value, another = getattr(entry, key, None), getattr(other, key, None)
        if value != another:
            return f"{entry.name}.{key} is {value} there and {another} here"
    return ""
