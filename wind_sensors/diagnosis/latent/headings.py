"""What a moving platform felt, and what it should have felt in a wind that changes slowly.

Within a block of time the earth wind is a constant and a trend, both unknown. While the platform
takes several headings and speeds, few numbers must explain many views of the same wind; whatever
the station leaves out shows as a disagreement between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.averages import BoolArray
from wind_sensors.diagnosis.means.bench import Bench
from wind_sensors.errors import UserError
from wind_sensors.motion.frames import heading_of
from wind_sensors.motion.platform_track import Motion, PlatformTrack
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.wind_at_sensor import WindAtSensors
from wind_sensors.station.doubles import without_doubles
from wind_sensors.station.model import Cup, Rotor, Station, Vane
from wind_sensors.station.signals import Angles, Pulses, Recording, TimeArray
from wind_sensors.station.silence import silent_instruments

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

BIN = 4.0
"""Means over so long are compared [s]."""

BLOCK = 600.0
"""Length of a block of steady, or steadily changing, wind [s]."""

FEWEST_BLOCKS = 6
"""A record has at least so many blocks: an hour. With fewer, no half is left to be scored on."""

FEWEST_BINS = 40
"""A block with fewer bins is left out."""


@dataclass(frozen=True)
class Felt:
    """Apparent wind and motion in bins of time.

    Attributes:
        station: The station.
        rotor, vane: What measured it.
        elapsed: Middle of each bin [s since the start of the recording], shape (n,).
        wind: Apparent wind as indicated: east and north of the sensor's x and y axes as real and
            imaginary part [m/s], shape (n,).
        motion: Of the platform, as reported, shape (n,).
        start: Of the recording [ns].
        block: Number of the block of each bin.
    """

    station: Station
    rotor: str
    vane: str
    elapsed: FloatArray
    wind: ComplexArray
    motion: Motion
    start: int
    block: npt.NDArray[np.intp]

    def __len__(self) -> int:
        return int(self.elapsed.size)


def _bin_speeds(rotor: Rotor, pulses: Pulses, edges: TimeArray) -> FloatArray:
    """Mean indicated speed in each bin [m/s]; NaN in gaps."""
    turns = pulses.turns
    if turns is None:
        turns = np.arange(1, pulses.time.size + 1) / rotor.pulses_per_revolution
    seconds = (pulses.time - edges[0]) * 1e-9
    wanted = (edges - edges[0]) * 1e-9
    at = np.interp(wanted, seconds, turns)
    rate = np.diff(at) / np.diff(wanted)
    start = rotor.starting_speed if isinstance(rotor, Cup) else 0.0
    speed = 2.0 * np.pi * rotor.calibration_distance * rate + start
    right = np.clip(np.searchsorted(seconds, wanted[1:]), 1, seconds.size - 1)
    gap = seconds[right] - seconds[np.clip(np.searchsorted(seconds, wanted[:-1]) - 1, 0, None)]
    return np.where((gap < 3.0 * BIN) & (rate > 0.0), speed, np.nan)


def _bin_headings(angles: Angles, edges: TimeArray) -> ComplexArray:
    """Mean unit vector of the nose's heading in each bin; NaN in empty ones."""
    number = np.searchsorted(edges, angles.time, side="right") - 1
    inside = (number >= 0) & (number < edges.size - 1)
    size = edges.size - 1
    unit = np.exp(1j * angles.angle[inside])
    total = np.bincount(number[inside], unit.real, size) + 1j * np.bincount(
        number[inside], unit.imag, size
    )
    length = np.abs(total)
    return np.where(length > 0.0, total / np.where(length > 0.0, length, 1.0), np.nan)


def felt_by(recording: Recording) -> Felt:
    """The apparent wind of a recording in bins.

    Raises:
        UserError: There is no rotor with a vane on a moving platform, or the record is too short.
    """
    recording = without_doubles(recording)
    station = recording.station
    silent = {each.instrument for each in silent_instruments(recording, station)}
    speaking = [i for i in station.instruments if i.name not in silent]
    rotors = [i for i in speaking if isinstance(i, Rotor)]
    vanes = [i for i in speaking if isinstance(i, Vane)]
    if station.platform is None or recording.platform is None or not rotors or not vanes:
        raise UserError(
            "without a reference wind a moving platform with a rotor and a vane is needed.",
            recording.name,
            "Add a reference to the station, or the platform's odometry to the recording.",
        )
    step = round(BIN * 1e9)
    edges = np.arange(recording.start, recording.stop, step, dtype=np.int64)
    if edges.size < 2 or (recording.stop - recording.start) * 1e-9 < FEWEST_BLOCKS * BLOCK:
        raise UserError(
            f"{(recording.stop - recording.start) * 1e-9:.0f} s are too short for a wind that is "
            "not known.",
            recording.name,
            f"At least {FEWEST_BLOCKS * BLOCK:.0f} s with several headings are needed.",
        )
    rotor, vane = rotors[0], vanes[0]
    speed = _bin_speeds(rotor, recording.pulses[rotor.name], edges)
    nose = _bin_headings(recording.angles[vane.name], edges)
    middle = edges[:-1] + step // 2
    track = PlatformTrack(recording.platform)
    sample = track.at(middle)
    inside = (middle >= track.start) & (middle <= track.stop)
    good = np.isfinite(speed) & np.isfinite(nose) & inside
    elapsed = np.asarray((middle - recording.start) * 1e-9, dtype=np.float64)
    block = np.floor(elapsed / BLOCK).astype(np.intp)
    count = np.bincount(block[good], minlength=int(block.max()) + 1)
    good &= count[block] >= FEWEST_BINS
    seen = sample.motion
    motion = Motion(
        seen.attitude[good], seen.velocity[good], seen.angular_rate[good], seen.position[good]
    )
    return Felt(
        station, rotor.name, vane.name, elapsed[good], -(speed * nose)[good], motion,
        recording.start, np.unique(block[good], return_inverse=True)[1].astype(np.intp),
    )


def heading_spread(felt: Felt) -> FloatArray:
    """Circular standard deviation of the heading in each block [rad]."""
    unit = np.exp(1j * heading_of(felt.motion.attitude))
    count = np.bincount(felt.block)
    mean = np.bincount(felt.block, unit.real) + 1j * np.bincount(felt.block, unit.imag)
    return np.asarray(np.sqrt(-2.0 * np.log(np.clip(np.abs(mean) / count, 1e-12, 1.0))))


def affine(felt: Felt, station: Station) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Indicated apparent wind in no wind, and what one m/s from each axis adds; shape (n,) each."""
    columns = []
    vane = station.instrument(felt.vane)
    rotor = station.instrument(felt.rotor)
    assert isinstance(vane, Vane) and isinstance(rotor, Rotor)
    turned = rotor.calibration_gain * np.exp(1j * np.radians(vane.offset_deg))
    for wind in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        drive = Drive(
            felt.start, BIN, np.tile(np.array(wind), (len(felt), 1)), felt.motion,
            elapsed=float(felt.elapsed[0]),
        )
        flow = WindAtSensors(station, drive).flow(rotor).wind
        columns.append(turned * (flow[:, 0] + 1j * flow[:, 1]))
    calm, east, north = columns
    return calm, east - calm, north - calm


def _explained(felt: Felt, station: Station, rows: BoolArray) -> ComplexArray:
    """Simulated apparent wind [m/s] in the wind that fits each block best; NaN in other rows."""
    calm, east, north = affine(felt, station)
    out = np.full(len(felt), np.nan + 0j)
    for b in np.unique(felt.block[rows]):
        inside = np.flatnonzero(rows & (felt.block == b))
        at = felt.elapsed[inside]
        trend = (at - at.mean()) / BLOCK
        e, n = east[inside], north[inside]
        design = np.stack([e, n, e * trend, n * trend], axis=1)
        stacked = np.concatenate([design.real, design.imag])
        wanted = felt.wind[inside] - calm[inside]
        target = np.concatenate([wanted.real, wanted.imag])
        weights = np.linalg.lstsq(stacked, target, rcond=None)[0]
        out[inside] = calm[inside] + design @ weights
    return out


def residual_of(felt: Felt, station: Station, rows: BoolArray) -> ComplexArray:
    """Felt minus simulated apparent wind [m/s], shape (number of rows,)."""
    return felt.wind[rows] - _explained(felt, station, rows)[rows]


def bench_of(felt: Felt, station: Station) -> Bench:
    """A moving platform as a bench: residuals along and across, one behind the other."""
    count = len(felt)

    def stacked(candidate: Station, rows: BoolArray) -> FloatArray:
        found = residual_of(felt, candidate, rows[:count])
        return np.concatenate([found.real, found.imag])

    everything = np.ones(2 * count, dtype=bool)

    def change(base: Station) -> Callable[[Station], FloatArray]:
        before = stacked(base, everything)
        return lambda candidate: stacked(candidate, everything) - before

    before = stacked(station, everything)
    noise = np.full(2 * count, 1.4826 * float(np.median(np.abs(before))))
    return Bench(
        station, stacked, change, noise, np.tile(felt.block, 2), np.tile(felt.elapsed, 2)
    )

