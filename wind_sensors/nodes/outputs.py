"""Estimates and window statistics as the output topics of a station."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistWithCovarianceStamped, Vector3Stamped
from std_msgs.msg import Float64, String

from wind_sensors.motion import sensor_rotation, wind_in_platform
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.nodes.nmea import apparent_wind_sentence, true_wind_sentence
from wind_sensors.nodes.quality import advertise, output_quality

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.publisher import Publisher

    from wind_sensors.estimation.outputs import WindEstimate, WindowStatistics
    from wind_sensors.station.model import Platform
    from wind_sensors.station.signals import FloatArray

_SECOND = 1_000_000_000

BIAS_TERMS = ("u", "v", "w", "vane_lag", "translation", "arithmetic_mean")
"""Relative biases of the raw mean speed that have a topic of their own."""

TOPICS: dict[str, str] = {
    "wind": "TwistWithCovarianceStamped: corrected wind velocity, where the air goes, ENU",
    "wind/apparent": "TwistWithCovarianceStamped: wind minus sensor velocity, sensor frame",
    "wind/body": "TwistWithCovarianceStamped: `wind` along the axes of a moving platform",
    "wind/vector": "Vector3Stamped: `wind` without covariance, for plots",
    "wind/mean": "TwistWithCovarianceStamped: corrected vector mean of each window; this and "
    "the numbers below are nan where less than half of the window was measured",
    "wind/speed": "Float64: corrected scalar mean speed of each window [m/s]",
    "wind/direction_from": "Float64: where the mean wind comes from [deg clockwise from north]",
    "wind/direction_variance": "Float64: of each window, corrected for the vane [rad^2]",
    "wind/bias": "TwistWithCovarianceStamped: velocity removed from the raw mean",
    "wind/bias/<term>": "Float64: one relative term of it (u, v, w, vane_lag, ...)",
    "wind/nmea": "String: NMEA 0183 MWV and MWD sentences (with parameter nmea)",
    "/diagnostics": "DiagnosticArray: health of every input and of the estimate; in `window` the "
    "uncertainties of speed, direction_from and direction_variance",
}
"""Output topics of an estimator node, relative to its namespace."""


def stamp(nanoseconds: int) -> Time:
    """Nanoseconds as a message."""
    return Time(sec=nanoseconds // _SECOND, nanosec=nanoseconds % _SECOND)


class WindPublishers:
    """Publishes what an estimator delivers; messages are stamped with the time the wind blew.

    Args:
        node: Its namespace is the station's.
        platform: The carrier; None on a mast.

    Attributes:
        platform: The carrier with the sensor's pose; may be exchanged.
        frame_id: Of earth-fixed vectors.
        sensor_frame_id: Of the apparent wind.
        body_frame_id: Of the wind along the platform's axes.
        nmea_talker: Two letters; empty: no sentences.
        nmea_period: Between sentences [ns].
    """

    def __init__(self, node: Node, platform: Platform | None) -> None:
        self.frame_id = "map"
        self.sensor_frame_id = "wind_sensor"
        self.body_frame_id = "base_link"
        self.nmea_talker = ""
        self.nmea_period = _SECOND
        self._node = node
        self._outlets: list[Publisher] = []
        self.platform = platform
        twist = TwistWithCovarianceStamped
        self._wind = self._advertise(twist, "wind")
        self._apparent = self._advertise(twist, "wind/apparent")
        self._body = None if platform is None else self._advertise(twist, "wind/body")
        self._vector = self._advertise(Vector3Stamped, "wind/vector")
        self._mean = self._advertise(twist, "wind/mean")
        self._speed = self._advertise(Float64, "wind/speed")
        self._direction = self._advertise(Float64, "wind/direction_from")
        self._variance = self._advertise(Float64, "wind/direction_variance")
        self._bias = self._advertise(twist, "wind/bias")
        self._terms = {name: self._advertise(Float64, f"wind/bias/{name}") for name in BIAS_TERMS}
        self._nmea: Publisher | None = None
        self._last_sentence: int | None = None

    def _advertise(self, message_type: type[Any], topic: str) -> Publisher:
        outlet = advertise(self._node, message_type, topic, output_quality())
        self._outlets.append(outlet)
        return outlet

    @property
    def fewest_subscribers(self) -> int:
        """Of all topics, the number of subscribers of the one with the fewest."""
        return min(int(outlet.get_subscription_count()) for outlet in self._outlets)

    def publish_estimates(self, estimates: Iterable[WindEstimate]) -> None:
        """`wind`, `wind/apparent`, `wind/body`, `wind/vector` and NMEA sentences."""
        for estimate in estimates:
            time = stamp(estimate.time)
            self._wind.publish(_twist(time, self.frame_id, estimate.velocity, estimate.covariance))
            self._apparent.publish(
                _twist(time, self.sensor_frame_id, estimate.apparent, estimate.apparent_covariance)
            )
            if self._body is not None and self.platform is not None:
                along, spread = wind_in_platform(
                    estimate.velocity, estimate.covariance, estimate.to_earth,
                    sensor_rotation(self.platform),
                )
                self._body.publish(_twist(time, self.body_frame_id, along, spread))
            vector = Vector3Stamped()
            vector.header.stamp = time
            vector.header.frame_id = self.frame_id
            _fill(vector.vector, estimate.velocity)
            self._vector.publish(vector)
            if self.nmea_talker:
                self._publish_sentences(estimate)

    def publish_window(self, window: WindowStatistics) -> None:
        """`wind/mean` and the other topics of a finished averaging window."""
        time = stamp(window.stop)
        self._mean.publish(
            _twist(time, self.frame_id, window.vector_mean, window.vector_mean_covariance)
        )
        self._bias.publish(_twist(time, self.frame_id, window.bias, window.bias_covariance))
        self._speed.publish(Float64(data=float(window.scalar_mean)))
        self._direction.publish(Float64(data=float(direction_from_deg(window.vector_mean))))
        self._variance.publish(Float64(data=float(window.corrected_direction_variance)))
        for name, term in window.bias_terms.items():
            if name in self._terms:
                self._terms[name].publish(Float64(data=float(term.value)))

    def _publish_sentences(self, estimate: WindEstimate) -> None:
        last = self._last_sentence
        if last is not None and 0 <= estimate.time - last < self.nmea_period:
            return
        self._last_sentence = estimate.time
        if self._nmea is None:
            self._nmea = self._advertise(String, "wind/nmea")
        talker = self.nmea_talker
        platform = self.platform
        declination = None if platform is None else platform.magnetic_declination_deg
        # Angles count from the bow, wherever the sensor's x axis points.
        felt = (
            estimate.apparent
            if platform is None
            else sensor_rotation(platform) @ estimate.apparent
        )
        for text in (
            apparent_wind_sentence(felt, talker),
            true_wind_sentence(estimate.velocity, declination, talker),
        ):
            self._nmea.publish(String(data=text))


def _twist(
    time: Time, frame_id: str, velocity: FloatArray, covariance: FloatArray
) -> TwistWithCovarianceStamped:
    message = TwistWithCovarianceStamped()
    message.header.stamp = time
    message.header.frame_id = frame_id
    _fill(message.twist.twist.linear, velocity)
    full = np.zeros((6, 6))
    full[:3, :3] = covariance
    message.twist.covariance = full.reshape(36)
    return message


def _fill(vector: Any, values: FloatArray) -> None:
    vector.x, vector.y, vector.z = float(values[0]), float(values[1]), float(values[2])
