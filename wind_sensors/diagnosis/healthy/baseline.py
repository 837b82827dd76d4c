"""What healthy recordings of a station show: the standing difference from its simulation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity
from wind_sensors.diagnosis.comparing.observation import NORMALISED_BANDS, Channel, channels_of
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import ERRATIC, STEPS
from wind_sensors.diagnosis.comparing.reference_place import Place
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.station.model import Angle, AnyInstrument, Rotor, Station

FloatArray = npt.NDArray[np.float64]

CALIBRATED_FROM = 4.0
"""Slowest wind of a calibration [m/s] (IEC 61400-12-1). Below it the straight line through the
calibration is continued to the starting speed, near which it cannot hold."""

FEW_DAYS = 3
"""With so many healthy days, what is loudest on any instrument counts for all; with more, less."""

FREQUENCIES = np.geomspace(0.0005, 1.25, 24)
"""Frequencies at which a baseline keeps its curves [Hz]."""

WAVENUMBERS = np.geomspace(0.004, 0.15, 6)
"""Frequencies over the wind's speed at which a baseline keeps the level of the noise [1/m]."""

UNKNOWN_ACTIVITY_EXCESS = 8.0
"""More than nearly all stations have."""

_BANDS = len(NORMALISED_BANDS) - 1

_STATION_SPECTRUM = 0.44
_STATION_INTERVALS = (0.004, 0.004, 0.006, 0.002, 0.0014, 0.002)
_STATION_STILLNESS = (0.24, 0.24, 0.24)
_STATION_ERRATIC = 0.006
_STATION_STEPS = 0.2
_STATION_CHANGES = (0.08,)

_DAILY_SPECTRUM = 0.12
_DAILY_INTERVALS = (0.0008, 0.0008, 0.0008, 0.0003, 0.0001, 0.00008)
_DAILY_STILLNESS = (0.11, 0.09, 0.06)
_DAILY_ERRATIC = 0.001
_DAILY_STEPS = 0.01
_DAILY_CHANGES = (0.06,)
"""A station's discs, slots and bearings are the same on every day: from day to day a statistic
departs by far less from what its station usually shows than any station does from its simulation.
"""


_CALM_SPECTRUM = 0.5
_CALM = 2.5
"""In a wind of the second [m/s] spectra depart by the first more: beside eddies that are weak and
slow the reference's own noise counts. It fades with the eddies' power: with the speed squared."""


def station_deviation(channel: Channel) -> FloatArray:
    """Standard deviations of a channel's statistics from the simulation of any station."""
    bands = np.full(_BANDS, _STATION_SPECTRUM)
    if channel.kind == "vane_angle":
        erratic, steps = np.full(ERRATIC, _STATION_ERRATIC), np.full(STEPS, _STATION_STEPS)
        return np.concatenate((bands, _STATION_STILLNESS, erratic, steps, _STATION_CHANGES))
    return np.concatenate((bands, _STATION_INTERVALS, _STATION_CHANGES))


def daily_deviation(channel: Channel) -> FloatArray:
    """Standard deviations of a channel's statistics from what its station usually shows."""
    bands = np.full(_BANDS, _DAILY_SPECTRUM)
    if channel.kind == "vane_angle":
        erratic, steps = np.full(ERRATIC, _DAILY_ERRATIC), np.full(STEPS, _DAILY_STEPS)
        return np.concatenate((bands, _DAILY_STILLNESS, erratic, steps, _DAILY_CHANGES))
    return np.concatenate((bands, _DAILY_INTERVALS, _DAILY_CHANGES))


def calm_deviation(statistics: int, mean_speed: float) -> FloatArray:
    """What a calm adds to the scatter of a channel's statistics, shape (statistics,).

    Args:
        statistics: Number of them.
        mean_speed: Of the record [m/s].
    """
    added = _CALM_SPECTRUM * (_CALM / mean_speed) ** 2
    return np.where(np.arange(statistics) < _BANDS, added, 0.0)


@dataclass(frozen=True)
class ChannelBaseline:
    """Standing behaviour of one channel.

    Attributes:
        exponent: Slope of measured on simulated as a power of the squared coherence, at
            `FREQUENCIES`.
        low_ratio: Noise variance relative to that just above the low end, at `FREQUENCIES`.
        statistics_mean, statistics_deviation: Of measured minus simulated statistics.
        noise_mean, noise_deviation: Of the logarithm of the residual's spectrum relative to the
            signal's, at `WAVENUMBERS`; an infinite deviation where nothing is known.
        activity_excess: Variance of the levels of quick eddies, beyond their mean over a record,
            over that of as many independent coefficients; shape (bands,).
    """

    exponent: FloatArray
    low_ratio: FloatArray
    statistics_mean: FloatArray
    statistics_deviation: FloatArray
    noise_mean: FloatArray
    noise_deviation: FloatArray
    activity_excess: FloatArray = field(
        default_factory=lambda: np.full(activity.BANDS, UNKNOWN_ACTIVITY_EXCESS)
    )

    def activity_deviation(self, sampling: FloatArray) -> FloatArray:
        """Standard deviation of the levels of quick eddies, shape (bands,).

        Args:
            sampling: Variance of as many independent coefficients, shape (bands,).
        """
        return np.asarray(np.sqrt(self.activity_excess * sampling))

    def statistics_deviation_in(self, mean_speed: float) -> FloatArray:
        """Deviation of the statistics in a wind of some mean speed [m/s]."""
        added = calm_deviation(self.statistics_deviation.size, mean_speed)
        return np.hypot(self.statistics_deviation, added)

    def exponent_at(self, frequency: FloatArray) -> FloatArray:
        """Exponents at other frequencies [Hz]."""
        return np.interp(np.log(frequency + 1e-6), np.log(FREQUENCIES), self.exponent)

    def low_ratio_at(self, frequency: FloatArray) -> FloatArray:
        """Noise ratios at other frequencies [Hz]."""
        return np.interp(np.log(frequency + 1e-6), np.log(FREQUENCIES), self.low_ratio)


@dataclass(frozen=True)
class Baseline:
    """Everything learnt on healthy recordings of one station.

    Attributes:
        recordings: Names of the recordings; empty: none were given (null not calibrated).
        original: The station as its file described it.
        station: The station as commissioned: its file with the standing differences that a gain,
            an offset, a factor of inertia, a mounting angle can describe.
        channels: By channel name.
        means: Amplitude of each template shared by the healthy recordings, by
            `effect|instrument|template number`, in units of the template.
        standing: Scatter of each template's amplitude between them.
        loudest: Largest drop of the cost, beyond its parameters, that an effect promises in one
            healthy recording judged by the others, by `effect|instrument` (or `station`,
            `platform`; the instrument alone: of any effect); calm recordings aside.
        loudest_in_calm: The same, calm ones among them.
        liveliness: Standard deviation of the slowest change, over a recording, of the power of
            quick eddies (its logarithm) that all channels share.
        usual_wind: Wind speed [m/s] that healthy recordings exceed nearly all the time.
        place: Where the reference stands; None: unknown.
    """

    recordings: tuple[str, ...]
    original: Station
    station: Station
    channels: Mapping[str, ChannelBaseline]
    means: Mapping[str, float] = field(default_factory=dict)
    standing: Mapping[str, float] = field(default_factory=dict)
    loudest: Mapping[str, float] = field(default_factory=dict)
    loudest_in_calm: Mapping[str, float] = field(default_factory=dict)
    liveliness: float = activity.USUAL_LIVELINESS
    usual_wind: float = np.inf
    place: Place | None = None

    @property
    def calibrated(self) -> bool:
        """Whether healthy recordings stand behind it."""
        return bool(self.recordings)

    def loudness(self, instrument: str, effect: Effect | None = None) -> float:
        """What the loudest healthy day promises that an effect could be taken for.

        A few days show little of each instrument: what they show of others stands in, in part.

        Args:
            instrument: Name, or `station`, or `platform`.
            effect: What would be named; None: anything.
        """
        elsewhere = min(1.0, FEW_DAYS / max(len(self.recordings), 1))
        loudest = 0.0
        for key, gain in self.loudest.items():
            name, _, where = key.rpartition("|")
            if _is_measure_of(name, effect):
                loudest = max(loudest, gain if where == instrument else elsewhere * gain)
        return loudest

    def in_calm(self) -> Baseline:
        """The same baseline for a recording of a calm day."""
        return replace(self, loudest=self.loudest_in_calm)

    def for_station(self, station: Station) -> Baseline:
        """The same baseline for a recording whose station file may say otherwise.

        What commissioning found (gains, offsets, inertia, mounting angles) goes on top of that
        file.
        """
        same = (
            station.instruments == self.original.instruments
            and station.platform == self.original.platform
            and station.changes == self.original.changes
            and station.reference == self.original.reference
        )
        if same:
            return self
        before = {entry.name: entry for entry in self.original.instruments}
        after = {entry.name: entry for entry in self.station.instruments}
        entries = tuple(
            _as_commissioned(entry, before.get(entry.name), after.get(entry.name))
            for entry in station.instruments
        )
        return replace(
            self,
            original=station,
            station=station.model_copy(update={"instruments": entries}),
            place=self.place if station.reference == self.original.reference else None,
        )

    def to_json(self) -> str:
        """As text; arrays become lists."""
        content: dict[str, Any] = {
            "recordings": list(self.recordings),
            "original": self.original.model_dump(mode="json"),
            "station": self.station.model_dump(mode="json"),
            "channels": {
                name: {k: _listed(v) for k, v in asdict(c).items()}
                for name, c in self.channels.items()
            },
            "means": dict(self.means),
            "standing": dict(self.standing),
            "loudest": dict(self.loudest),
            "loudest_in_calm": dict(self.loudest_in_calm),
            "liveliness": self.liveliness,
            "usual_wind": _listed(np.array([self.usual_wind]))[0],
            "place": None if self.place is None else asdict(self.place),
        }
        return json.dumps(content, indent=1)

    @staticmethod
    def from_json(text: str) -> Baseline:
        """Inverse of `to_json`.

        Raises:
            ValueError: The text is not a baseline.
        """
        content = json.loads(text)
        try:
            known = Baseline(
                recordings=tuple(content["recordings"]),
                original=Station.model_validate(content["original"]),
                station=Station.model_validate(content["station"]),
                channels={
                    name: ChannelBaseline(**{k: _unlisted(v) for k, v in c.items()})
                    for name, c in content["channels"].items()
                },
                means=content["means"],
                standing=content["standing"],
                loudest=content["loudest"],
                loudest_in_calm=content.get("loudest_in_calm", content["loudest"]),
                liveliness=content.get("liveliness", activity.USUAL_LIVELINESS),
                usual_wind=float(_unlisted([content["usual_wind"]])[0]),
                place=None if content.get("place") is None else Place(**content["place"]),
            )
        except (KeyError, TypeError) as problem:
            raise ValueError(f"not a baseline: {problem}") from problem
        for channel in channels_of(known.station):
            kept = known.channels.get(channel.name)
            if kept and kept.statistics_mean.size != station_deviation(channel).size:
                raise ValueError(f"not a baseline: other statistics of {channel.name}")
        return known


def _is_measure_of(name: str, effect: Effect | None) -> bool:
    """Whether what a healthy day promises of one effect tells what another one must bring.

    A vane that reads half a degree more on one day and less on another does not look like one that
    is filtered; the wind's way to the reference, which looks like a delay, not like one that
    is out of balance.

    Args:
        name: Of the effect that the day promises; empty: of any.
        effect: What would be named; None: anything.
    """
    promised = catalogue().get(name)
    if promised is None or (effect is not None and effect.name == name):
        return True
    if promised.own_days:
        return False
    return effect is None or promised.is_quick or not effect.is_quick


def _listed(values: FloatArray) -> list[float | None]:
    """An array for JSON, which knows no infinity."""
    return [float(v) if np.isfinite(v) else None for v in values]


def _unlisted(values: list[float | None]) -> FloatArray:
    return np.array([np.inf if v is None else v for v in values])


def _as_commissioned(
    entry: AnyInstrument, before: AnyInstrument | None, after: AnyInstrument | None
) -> AnyInstrument:
    """An instrument with the differences that commissioning found on its namesake."""
    if isinstance(entry, Rotor) and isinstance(before, Rotor) and isinstance(after, Rotor):
        gain = after.calibration_gain / before.calibration_gain
        return entry.model_copy(
            update={
                "calibration_gain": entry.calibration_gain * gain,
                "calibration_offset": entry.calibration_offset
                + after.calibration_offset
                - before.calibration_offset,
                "inertia_factor": entry.inertia_factor
                * after.inertia_factor
                / before.inertia_factor,
            }
        )
    if isinstance(entry, Angle) and isinstance(before, Angle) and isinstance(after, Angle):
        turned = entry.offset_deg + after.offset_deg - before.offset_deg
        return entry.model_copy(update={"offset_deg": turned})
    return entry


def default_channel(channel: Channel) -> ChannelBaseline:
    """What is expected of a channel without any healthy recording.

    Errors of the reference below 0.1 Hz are its own (exponent 1), above they are the distance
    between reference and instrument, which both share (1/2).
    """
    exponent = np.where(FREQUENCIES < 0.1, 1.0, 0.5)
    deviation = station_deviation(channel)
    return ChannelBaseline(
        exponent=exponent,
        low_ratio=np.ones(FREQUENCIES.size),
        statistics_mean=np.zeros(deviation.size),
        statistics_deviation=deviation,
        noise_mean=np.zeros(WAVENUMBERS.size),
        noise_deviation=np.full(WAVENUMBERS.size, np.inf),
    )
