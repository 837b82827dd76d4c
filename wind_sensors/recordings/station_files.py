"""Station files and instrument profiles on disk."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import wind_sensors
from wind_sensors.errors import UserError
from wind_sensors.station.model import Station
from wind_sensors.station.profiles import Profile, read_profile
from wind_sensors.station.reading import read_station


def configuration_folder() -> Path:
    """The folder `config` that came with the package.

    It lies beside the package in a source checkout and in an editable installation, and under
    `share/wind_sensors` of the installation prefix otherwise (pip, colcon).

    Raises:
        UserError: The installation is incomplete.
    """
    package = Path(wind_sensors.__file__).resolve().parent
    for folder in package.parents:
        for candidate in (folder / "config", folder / "share" / "wind_sensors" / "config"):
            if (candidate / "instruments").is_dir():
                return candidate
    raise UserError(
        "the folder `config` of wind_sensors is missing.",
        str(package),
        "Install the package again (pip install, or colcon build).",
    )


@lru_cache(maxsize=1)
def shipped_profiles() -> dict[str, Profile]:
    """The instrument profiles of `config/instruments`, by name."""
    folder = configuration_folder() / "instruments"
    return {
        file.stem: read_profile(file.read_text(encoding="utf-8"), file.stem, str(file))
        for file in sorted(folder.glob("*.yaml"))
    }


def load_station(path: str | Path) -> Station:
    """Read and validate a station file.

    Args:
        path: The file, or the name of a configuration that came with the package
            (`mast_cup_vane`).

    Raises:
        UserError: There is no such file, or it is wrong; every fault is listed with its line.
    """
    file = Path(path)
    if not file.exists() and file.parent == Path() and not file.suffix:
        shipped = configuration_folder() / f"{file}.yaml"
        file = shipped if shipped.exists() else file
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        names = ", ".join(sorted(p.stem for p in configuration_folder().glob("*.yaml")))
        raise UserError(
            "there is no such station file.", str(path), f"Configurations that ship: {names}."
        ) from None
    except IsADirectoryError:
        raise UserError(
            "this is a folder.", str(path), "Name the station file, like recording.yaml in it."
        ) from None
    except UnicodeDecodeError:
        raise UserError(
            "the station file is not a text in UTF-8.", str(path), "Save it as UTF-8."
        ) from None
    except OSError as problem:
        raise UserError(
            f"the station file cannot be read ({problem.strerror or problem}).", str(path)
        ) from None
    return read_station(text, str(path), shipped_profiles())
