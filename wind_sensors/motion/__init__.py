"""Frames, attitudes, the carrier's motion, and the wind it makes or hides."""

from wind_sensors.motion.platform_errors import reported_motion, true_motion
from wind_sensors.motion.platform_track import (
    Motion,
    PlatformTrack,
    TrackLimits,
    TrackSample,
    velocity_at,
)
from wind_sensors.motion.relative_wind import (
    apparent_wind,
    earth_wind,
    earth_wind_covariance,
    sensor_rotation,
    wind_in_platform,
)

__all__ = [
    "Motion",
    "PlatformTrack",
    "TrackLimits",
    "TrackSample",
    "apparent_wind",
    "earth_wind",
    "earth_wind_covariance",
    "reported_motion",
    "sensor_rotation",
    "true_motion",
    "velocity_at",
    "wind_in_platform",
]
