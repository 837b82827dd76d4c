"""Wind as NMEA 0183 sentences, for marine instruments.

`MWV` carries the apparent wind as an angle from the bow, `MWD` the true wind as a direction from
north. Both state where the wind comes from.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.recordings.nmea import with_checksum

KNOT = 1852.0 / 3600.0
"""[m/s]"""


def apparent_wind_sentence(apparent: npt.ArrayLike, talker: str = "WI") -> str:
    """`MWV` with reference R (relative).

    Args:
        apparent: Wind minus the sensor's velocity, forward and left [m/s], shape (2,) or (3,).
        talker: Two letters.
    """
    forward, left = np.asarray(apparent, dtype=np.float64)[:2]
    from_bow = np.degrees(np.arctan2(left, -forward)) % 360.0
    speed = float(np.hypot(forward, left))
    return _line(f"{talker}MWV,{_bearing(from_bow)},R,{speed:.2f},M,A")


def true_wind_sentence(
    velocity: npt.ArrayLike, declination_deg: float | None = None, talker: str = "WI"
) -> str:
    """`MWD`.

    Args:
        velocity: Where the air goes: east, north [m/s], shape (2,) or (3,).
        declination_deg: Magnetic north east of true north; None leaves the magnetic field empty.
        talker: Two letters.
    """
    wind = np.asarray(velocity, dtype=np.float64)
    true_deg = float(direction_from_deg(np.array([wind[0], wind[1], 0.0])))
    magnetic = "" if declination_deg is None else _bearing((true_deg - declination_deg) % 360.0)
    speed = float(np.hypot(wind[0], wind[1]))
    return _line(
        f"{talker}MWD,{_bearing(true_deg)},T,{magnetic},M,{speed / KNOT:.2f},N,{speed:.2f},M"
    )


def _line(body: str) -> str:
    return f"{with_checksum(body)}\r\n"


def _bearing(degrees: float) -> str:
    # Rounding may reach 360, which is 0.
    return f"{round(float(degrees), 1) % 360.0:05.1f}"
