"""Starting points that the raw signals give away, and those that nothing shows a way to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import with_missed
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.diagnosis.effects.platform import dead_log, log_lives
from wind_sensors.diagnosis.explaining.intervals import interval_of, window_of
from wind_sensors.diagnosis.explaining.jumps import late_stamps
from wind_sensors.diagnosis.explaining.rotor_guesses import rotor_guesses
from wind_sensors.diagnosis.explaining.terms import Term, suggested
from wind_sensors.diagnosis.explaining.vane_guesses import vane_guesses
from wind_sensors.station.model import Angle, Rotor, Station
from wind_sensors.station.signals import Angles, Pulses

FloatArray = npt.NDArray[np.float64]
Key = tuple[str, str]
Guesses = dict[Key, list[Term]]

LEAN = 15.0
"""Lean of the axis [deg] from which its fit begins: what it does to a rotor grows with its square,
so that a small lean shows no way."""

JET = 2.5
JET_SPREADS = ((0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25))
"""Induced velocity [m/s] of rotors and shares of it that blow forward and to the left, to begin
with: a small jet from above moves nothing that turns about an upright axis."""

BLIND_EFFECTS = frozenset(
    {"axis_tilt", "clock_drift", "bearing_friction", "rotor_downwash", "frame_error"}
)
"""Effects that are tried whether or not the screening sees them."""

BLIND_IN_PARTS = (BLIND_EFFECTS - {"clock_drift", "frame_error"}) | {"potentiometer_gap"}
"""Effects that are tried in the minutes in which others are seen: the blind ones but a clock that
drifted and axes that were mistaken, which stay wrong, and a gap that the wind crosses on its way
through other directions."""

DRIFTS = (-4000.0, -2000.0, -1000.0, 1000.0, 2000.0, 4000.0)
"""Drifts of a clock [ppm] to begin with: past a lag of a second or two the signals have lost each
other, and nothing shows the way."""


def hidden_by_a_dead_log(comparison: Comparison) -> list[Term]:
    """The motion that a log does not report while the positions change; empty: it reports all."""
    silent = dead_log(comparison.drive)
    if silent is None:
        return []
    still = suggested("platform_velocity", PLATFORM, velocity_share=1.0, position_share=1.0)
    if log_lives(comparison.drive, *window_of(comparison, still.interval)):
        still = replace(still, interval=interval_of(comparison, *silent))
    return [still]


def as_counted(comparison: Comparison, guesses: Mapping[Key, Sequence[Term]]) -> Comparison:
    """The comparison that knows of which rotors pulses are lost, and how.

    Args:
        comparison: The recording.
        guesses: Effects that its raw signals suggest, by effect and instrument.
    """
    deaf, mended = set(), {}
    for (effect, instrument), terms in guesses.items():
        if effect != "missed_pulses":
            continue
        if any("dead_time" in term.held for term in terms):
            deaf.add(instrument)
            continue
        rotor = comparison.station.instrument(instrument)
        pulses = comparison.recording.pulses[instrument]
        if isinstance(rotor, Rotor) and any("loss_growth" in term.held for term in terms):
            mended[instrument] = with_missed(pulses, rotor.pulses_per_revolution)
    told = {name: pulses for name, pulses in mended.items() if pulses is not None}
    if not told and not deaf:
        return comparison
    return replace(comparison, mended=told, deaf=frozenset(deaf)).measuring()


def guesses_of(comparison: Comparison, station: Station) -> Guesses:
    """Effects that the raw signals suggest, with starting values, by effect and instrument."""
    out: Guesses = {}
    for still in hidden_by_a_dead_log(comparison):
        out[still.key] = [still]
    leans = [
        suggested(
            "axis_tilt", STATION, tilt_x=LEAN * np.cos(towards), tilt_y=LEAN * np.sin(towards)
        )
        for towards in np.arange(8) * np.pi / 4.0
    ]
    out[leans[0].key] = leans
    if station.platform is not None:
        jets = [
            suggested(
                "rotor_downwash", PLATFORM,
                induced_velocity=JET, wake_skew=0.0, forward=forward, leftward=leftward,
            )
            for forward, leftward in JET_SPREADS
        ]
        out[jets[0].key] = jets
        others = suggested(
            "frame_error", PLATFORM, roll=0.0, pitch=0.0, velocity_turn=0.0, other_axes=1.0
        )
        out[others.key] = [others]
    clocks = [channel.instrument for channel in comparison.channels]
    for instrument in [*clocks, STATION]:
        drifts = [suggested("clock_drift", instrument, drift=drift) for drift in DRIFTS]
        out[drifts[0].key] = drifts
    simulated = comparison.simulate(station)
    for channel in comparison.channels:
        entry = station.instrument(channel.instrument)
        stamps: Pulses | Angles
        if isinstance(entry, Rotor):
            stamps = comparison.recording.pulses[entry.name]
            rate = simulated.series[channel.name]
            terms = rotor_guesses(comparison, station, entry, rate)
        else:
            assert isinstance(entry, Angle)
            stamps = comparison.recording.angles[entry.name]
            terms = vane_guesses(comparison, channel, entry)
        terms += late_stamps(comparison, entry.name, comparison.grid.seconds(stamps.time))
        for term in terms:
            out.setdefault(term.key, []).append(term)
    return out
