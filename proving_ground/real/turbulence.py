"""Real 20 Hz turbulence to drive the world's instruments with."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from proving_ground.drive import GRID_RATE
from proving_ground.generate import Planted, record
from proving_ground.inflow import Array
from proving_ground.scene import build_scene
from proving_ground.stations import Station
from proving_ground.weather import Weather

SONIC_RATE = 20.0
COLUMNS = ("Ux", "Uy", "Uz")
SMALL_EDDIES = 20.0
"""Variations slower than this [s] are taken to be the same at the reference's place."""


def read_sonic(path: Path) -> Array:
    """Wind (n, 3) [m/s] at 20 Hz of a TOA5 file; what was not measured is interpolated."""
    with path.open(encoding="utf-8", errors="replace") as file:
        file.readline()
        names = [name.strip().strip('"') for name in file.readline().split(",")]
        file.readline()
        file.readline()
        places = [names.index(name) for name in COLUMNS]
        rows = [line.split(",") for line in file]
    wind = np.array([[_number(row[i]) for i in places] for row in rows if len(row) == len(names)])
    index = np.arange(len(wind))
    for column in wind.T:
        good = np.isfinite(column) & (np.abs(column) < 60.0)
        column[:] = np.interp(index, index[good], column[good])
    return wind


def _number(text: str) -> float:
    try:
        return float(text.strip().strip('"'))
    except ValueError:
        return np.nan


def on_grid(wind: Array, added: float = 0.0) -> Array:
    """The wind on the world's grid, with a steady wind `added` [m/s] along its mean."""
    time = np.arange(len(wind)) / SONIC_RATE
    grid = np.arange(int(time[-1] * GRID_RATE) + 1) / GRID_RATE
    fine = np.stack([np.interp(grid, time, column) for column in wind.T], axis=-1)
    mean = fine[:, :2].mean(axis=0)
    fine[:, :2] += added * mean / float(np.hypot(*mean))
    return fine


def record_in(
    station: Station, wind: Array, seed: int, planted: tuple[Planted, ...], folder: Path
) -> list[dict[str, object]]:
    """Record a station of a mast in real wind on the grid, with causes planted or none."""
    speed = np.hypot(wind[:, 0], wind[:, 1])
    level = float(speed.mean())
    width = int(SMALL_EDDIES * GRID_RATE)
    slow = np.convolve(speed, np.ones(width) / width, mode="same")
    small = float(np.std((speed - slow)[width:-width]))
    minutes = (len(wind) - 1) / GRID_RATE / 60.0
    weather = Weather(
        mean_speed=level,
        turbulence=small / level,
        wander_speed=0.05,
        wander_direction=0.05,
        veer=0.0,
        heading=float(np.arctan2(wind[:, 1].mean(), wind[:, 0].mean())),
    )
    count = round(60.0 * minutes * GRID_RATE) + 1
    scene = build_scene(station, weather, minutes, seed, wind[:count])
    folder.mkdir(parents=True)
    return record(scene, planted, folder)
