"""The estimator against the best linear estimate: real turbulence through simulated instruments.

A sonic's record drives a simulated cup and vane. Two limits are computed for each component:

- the best non-causal linear (Wiener) estimate from the spectra and cross-spectra of the signals and
  the wind: sum of S (1 - coherence^2), both wind components of the naive reading as inputs;
- what the same would reach if the instruments were linear, at the mean wind, with the samples'
  aliases and the vane's noise as the only disturbances. In a light, gusty wind (intensity above a
  half, gusts from below the starting speed) no instrument is near this.
"""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import csd

from wind_sensors.estimation import EstimatorSettings, process
from wind_sensors.simulation import Drive, angle_readings, edge_times, respond
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Angles, Pulses, Recording

FloatArray = npt.NDArray[np.float64]

SONIC_FOLDER = Path("real") / "sonic_20hz"
VANE_RATE = 20.0
VANE_NOISE_DEG = 0.2
_START_NS = 1_000_000_000_000
_FINER = 8
_SEGMENT = 256
_SETTLING = 60.0

STATION = Station.model_validate(
    {
        "instruments": [
            {
                "kind": "cup", "name": "cup", "pulses": {"topic": "cup/pulses"},
                "pulses_per_revolution": 4, "calibration_distance": 0.14,
                "starting_speed": 0.1, "distance_constant": 1.67, "mu2": 0.45,
            },
            {
                "kind": "vane", "name": "vane", "joint_states": {"topic": "vane/joint_states"},
                "distance_constant": 0.5, "damping_ratio": 0.35, "noise_deg": VANE_NOISE_DEG,
            },
        ]
    }
)


class WienerResult(NamedTuple):
    """Rms errors along and across the mean wind [m/s]."""

    found: tuple[float, float]
    limit: tuple[float, float]
    linear_instruments: tuple[float, float]
    naive: tuple[float, float]


def sonic_wind(path: Path) -> FloatArray:
    """Wind of a TOA5 file of a sonic at 20 Hz, mean wind along x [m/s], shape (n, 3)."""
    with gzip.open(path, "rt") as lines:
        rows = [line.split(",") for line in list(lines)[4:]]
    wind = np.array([[float(v.strip('"')) for v in row[2:5]] for row in rows])
    wind = wind[np.isfinite(wind).all(axis=1)]
    turn = np.arctan2(wind[:, 1].mean(), wind[:, 0].mean())
    c, s = np.cos(turn), np.sin(turn)
    rotated: FloatArray = np.stack(
        (c * wind[:, 0] + s * wind[:, 1], -s * wind[:, 0] + c * wind[:, 1], wind[:, 2]), axis=1
    )
    return rotated


def recorded(wind: FloatArray, rate: float, seed: int = 1) -> Recording:
    """Signals of the station in a wind at `rate` [Hz]."""
    drive = Drive(_START_NS, 1.0 / rate, wind)
    response = respond(STATION, drive)
    edges = edge_times(response, "cup", seed)
    duration = (wind.shape[0] - 1) / rate
    stamps = _START_NS + np.arange(0, int(duration * VANE_RATE)) * round(1e9 / VANE_RATE)
    # Half a period off the sonic's samples: no estimate may profit from common instants.
    stamps = stamps + round(0.37e9 / VANE_RATE)
    readings = angle_readings(response, "vane", stamps, seed)
    return Recording(
        name="sonic",
        station=STATION,
        start=_START_NS,
        stop=_START_NS + round(duration * 1e9),
        pulses={"cup": Pulses(np.asarray(edges, dtype=np.int64))},
        angles={"vane": Angles(stamps, readings)},
    )


def _coherence_limits(wind: FloatArray, rate: float, recording: Recording) -> tuple[float, float]:
    """Rms errors of the best linear estimates from the signals' spectra and cross-spectra."""
    n = wind.shape[0]
    time = np.arange(n) / rate
    cup = STATION.instrument("cup")
    assert cup.kind == "cup"
    edges = (recording.pulses["cup"].time - _START_NS) * 1e-9
    turned = 2.0 * np.pi / cup.pulses_per_revolution * np.arange(edges.size)
    bounds = np.append(time - 0.5 / rate, time[-1] + 0.5 / rate)
    speed = cup.calibration_distance * np.diff(np.interp(bounds, edges, turned)) * rate
    speed = speed + cup.starting_speed
    vane = recording.angles["vane"]
    heading = np.interp(time, (vane.time - _START_NS) * 1e-9, np.unwrap(vane.angle))
    inner = slice(round(_SETTLING * rate), n - round(10 * rate))
    inputs = [(-speed * f(heading))[inner] for f in (np.cos, np.sin)]
    limits = []
    for k in (0, 1):
        def cross(a: FloatArray, b: FloatArray) -> npt.NDArray[np.complex128]:
            return np.asarray(csd(a, b, rate, nperseg=_SEGMENT)[1], dtype=np.complex128)

        own = np.array([[cross(a, b) for b in inputs] for a in inputs]).transpose(2, 0, 1)
        with_wind = np.array([cross(a, wind[inner, k]) for a in inputs]).T
        weights = np.linalg.solve(own, with_wind[:, :, np.newaxis])[:, :, 0]
        explained = np.einsum("fa,fa->f", with_wind.conj(), weights).real
        left = cross(wind[inner, k], wind[inner, k]).real - explained
        limits.append(float(np.sqrt(np.sum(left[1:]) * rate / _SEGMENT)))
    return limits[0], limits[1]


def _spectrum(signal: FloatArray) -> FloatArray:
    """Two-sided periodogram of the linearly interpolated signal, smoothed in bands."""
    n = signal.size
    fine = np.interp(np.arange(n * _FINER) / _FINER, np.arange(n), signal - signal.mean())
    power = np.abs(np.fft.rfft(fine)) ** 2 / fine.size
    k = np.arange(power.size)
    band = np.floor(12.0 * np.log2(np.maximum(k, 1))).astype(int)
    total = np.bincount(band, power)
    count = np.bincount(band)
    smooth: FloatArray = (total / np.maximum(count, 1))[band]
    return smooth


def _limit(
    spectrum: FloatArray, response: npt.NDArray[np.complex128], noise: float, samples: int
) -> float:
    """Rms error of the best linear estimate from regular samples of a filtered signal.

    Args:
        spectrum: Of the signal on the fine grid, periodogram units.
        response: Transfer function from signal to what is sampled, at the same frequencies.
        noise: Variance of a sample.
        samples: Number of samples in the record.
    """
    n = 2 * (spectrum.size - 1)
    full = np.concatenate((spectrum, spectrum[-2:0:-1]))
    transfer = np.concatenate((response, np.conj(response[-2:0:-1])))
    power = full * np.abs(transfer) ** 2
    place = np.arange(n)
    place = np.where(place > n // 2, place - n, place)
    folded = np.bincount(place % samples, power, minlength=samples)
    seen = folded[place % samples] + noise * n / samples
    gained = np.abs(full * np.conj(transfer)) ** 2 / seen
    return float(np.sqrt(max(np.sum(full - gained) / n, 0.0)))


def compare(wind: FloatArray, rate: float = 20.0) -> WienerResult:
    """Errors of `kalman` and `naive` and the limits for a wind at `rate` [Hz]."""
    speed = float(wind[:, 0].mean())
    recording = recorded(wind, rate)
    errors = []
    for method in ("kalman", "naive"):
        result = process(
            recording,
            EstimatorSettings(method=method, smoother_lag=4.0, output_rate=37.0),
        )
        at = (result.time - _START_NS) * 1e-9 * rate
        inside = (at > _SETTLING * rate) & (at < wind.shape[0] - 10 * rate)
        truth = np.stack(
            [np.interp(at[inside], np.arange(wind.shape[0]), wind[:, i]) for i in (0, 1)], axis=1
        )
        errors.append(np.sqrt(np.mean((result.velocity[inside, :2] - truth) ** 2, axis=0)))
    n = wind.shape[0]
    omega = 2j * np.pi * np.arange(n * _FINER // 2 + 1) * rate / n
    cup, vane = STATION.instrument("cup"), STATION.instrument("vane")
    assert cup.kind == "cup" and vane.kind == "vane"
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = 1.0 / (1.0 + omega * cup.distance_constant / speed) / omega
    turned[0] = turned[1]
    edges = len(recording.pulses["cup"].time)
    along = _limit(_spectrum(wind[:, 0]), turned, 1e-16, edges)
    s = omega * vane.distance_constant / speed
    pointed = 1.0 / (1.0 + s**2 + 2.0 * vane.damping_ratio * s)
    readings = len(recording.angles["vane"].time)
    noise = (speed * np.radians(VANE_NOISE_DEG)) ** 2
    across = _limit(_spectrum(wind[:, 1]), pointed, float(noise), readings)
    kalman, naive = errors
    return WienerResult(
        (float(kalman[0]), float(kalman[1])),
        _coherence_limits(wind, rate, recording),
        (along, across),
        (float(naive[0]), float(naive[1])),
    )


def main() -> None:
    """Print the table."""
    shared = Path(__file__).resolve().parents[2] / "shared"
    for path in sorted((shared / SONIC_FOLDER).glob("*.dat.gz")):
        wind = sonic_wind(path)
        r = compare(wind)
        print(f"{path.name}: mean {wind[:, 0].mean():.2f} m/s")
        columns = zip(("along", "across"), *r, strict=True)
        for name, found, limit, ideal, naive in columns:
            print(
                f"  {name:6s} kalman {found:.3f}  Wiener {limit:.3f} m/s  ratio {found / limit:.2f}"
                f"  (linear instruments {ideal:.3f})  naive {naive:.3f} m/s"
            )


if __name__ == "__main__":
    main()
