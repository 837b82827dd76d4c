"""Baselines from their files."""

from __future__ import annotations

from pathlib import Path

from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.errors import UserError
from wind_sensors.station.model import Station
from wind_sensors.station.sameness import refuse_another

_REMEDY = "Make one with `wind baseline HEALTHY... -o FILE`."


def read_baseline(path: Path, station: Station) -> Baseline:
    """What `wind baseline` wrote.

    Args:
        path: The file.
        station: The station that is to be judged by it.

    Raises:
        UserError: The file is absent or something else, or of another station.
    """
    try:
        baseline = Baseline.from_json(path.read_text(encoding="utf-8"))
    except OSError as problem:
        reason = f"the baseline cannot be read ({problem.strerror})."
        raise UserError(reason, str(path), _REMEDY) from None
    except ValueError:
        reason = "this is not a baseline of this version."
        raise UserError(reason, str(path), _REMEDY) from None
    refuse_another(station, baseline.original, str(path))
    return baseline
