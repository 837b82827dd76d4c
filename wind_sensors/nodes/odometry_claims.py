"""What an odometry says about itself, its frames and its noise, against what the station says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from wind_sensors.nodes.diagnostics import Level, Status
from wind_sensors.station.model import Platform, Station

_SEVERAL = 3.0
"""A stated standard deviation so many times that of the station file is another one."""

_YAW = 35
_X, _Y = 0, 7
"""Places on the diagonals of the covariances. Others are often stated huge for what a planar filter
does not estimate."""


class OdometryClaims(NamedTuple):
    """What a nav_msgs/Odometry says about itself.

    Attributes:
        frame: Of the pose; empty where it does not say.
        child_frame: Of the velocity; empty where it does not say.
        heading_deviation_deg, velocity_deviation: Standard deviations of yaw and of the larger
            horizontal component of the velocity [m/s]; 0 where it does not say.
    """

    frame: str
    child_frame: str
    heading_deviation_deg: float
    velocity_deviation: float


def claims_of(message: Any) -> OdometryClaims:
    """What one nav_msgs/Odometry says about itself."""
    pose, twist = message.pose.covariance, message.twist.covariance
    return OdometryClaims(
        message.header.frame_id.removeprefix("/"),
        message.child_frame_id.removeprefix("/"),
        math.degrees(_deviation(pose[_YAW])),
        max(_deviation(twist[_X]), _deviation(twist[_Y])),
    )


def _deviation(variance: float) -> float:
    return math.sqrt(variance) if math.isfinite(variance) and variance > 0.0 else 0.0


def odometry_status(
    claims: OdometryClaims, station: Station, frame_id: str, body_frame_id: str
) -> Status:
    """Diagnostic `odometry`.

    Args:
        claims: Of the latest message.
        station: A station with odometry.
        frame_id: Frame in which the wind is published.
        body_frame_id: The platform's frame.
    """
    platform = station.platform
    assert platform is not None
    values = {
        "frame": claims.frame,
        "child frame": claims.child_frame,
        "heading deviation": f"{claims.heading_deviation_deg:.3g} deg",
        "velocity deviation": f"{claims.velocity_deviation:.3g} m/s",
    }
    complaints = [
        *_earth_frame(claims, station, frame_id),
        *_body_frame(claims, platform, body_frame_id),
        *_noises(claims, platform),
    ]
    if complaints:
        return Status("odometry", Level.WARN, " ".join(complaints), values)
    return Status(
        "odometry", Level.OK, "Its frames and noises are as the station file takes them.", values
    )


def _earth_frame(claims: OdometryClaims, station: Station, wind_frame: str) -> Iterator[str]:
    frame = claims.frame
    assert station.platform is not None
    if station.platform.frame == "ned":
        # As MAVROS names the same frame with other axes.
        frame = frame.removesuffix("_ned")
    # The station file's frame is stated to point east and north.
    if frame and frame not in (wind_frame, station.recording.frame):
        yield (
            f"The odometry's pose is in the frame {claims.frame}, the wind is published in "
            f"{wind_frame}: its direction is right only if the x axis of {claims.frame} points "
            f"east. If it does, set `frame_id` to {claims.frame}; if not, name an odometry whose "
            "frame does."
        )


def _body_frame(claims: OdometryClaims, platform: Platform, body_frame: str) -> Iterator[str]:
    frame = claims.child_frame
    if platform.frame == "ned":
        frame = frame.removesuffix("_frd")
    if frame and frame != body_frame:
        yield (
            f"The odometry's velocity is that of {claims.child_frame}, the platform's frame is "
            f"{body_frame}: `platform.sensor_position` and `sensor_rotation_deg` must count from "
            f"{claims.child_frame}. If they do, set `body_frame_id` to {claims.child_frame}."
        )


def _noises(claims: OdometryClaims, platform: Platform) -> Iterator[str]:
    for stated, told, unit, what, key in (
        (platform.attitude_noise_deg, claims.heading_deviation_deg, "deg", "heading",
         "attitude_noise_deg"),
        (platform.velocity_noise, claims.velocity_deviation, "m/s", "velocity", "velocity_noise"),
    ):
        if told > _SEVERAL * stated:
            yield (
                f"The odometry states a standard deviation of {told:.2g} {unit} of its {what}, the "
                f"station file {stated:g}, by which the wind's uncertainty goes. If the message is "
                f"right, set `platform.{key}`."
            )
