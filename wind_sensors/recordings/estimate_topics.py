"""What an estimator found, as the output topics of a station."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from rosbags.typesys.store import Typestore

from wind_sensors.motion import sensor_rotation, wind_in_platform
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.recordings.raw_topics import BODY_FRAME, running_time
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.station.inputs import FieldPath
from wind_sensors.station.signals import FloatArray, TimeArray

if TYPE_CHECKING:
    from wind_sensors.estimation.outputs import ProcessedRecording, WindowStatistics

TWIST = "geometry_msgs/msg/TwistWithCovarianceStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"
NUMBER = "std_msgs/msg/Float64"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
SENSOR_FRAME = "sensor"


def estimate_topics(
    processed: ProcessedRecording, types: Typestore, namespace: str = ""
) -> list[TopicMessages]:
    """Output topics of one processed recording.

    Wind vectors say where the air goes, in ENU (`wind`, `wind/mean`, `wind/bias`, `wind/vector`),
    in the sensor's frame (`wind/apparent`) or, on a platform, along its axes (`wind/body`).

    Args:
        processed: What the estimator found.
        types: Message definitions.
        namespace: Before every topic, e.g. `/mast`.
    """
    frame = processed.recording.station.recording.frame
    base = f"{namespace}/wind"
    time, velocity = processed.time, processed.velocity
    vector = template(types, VECTOR, texts={("header", "frame_id"): frame})
    found = [
        _twists(types, base, frame, time, velocity, processed.covariance),
        _twists(
            types,
            f"{base}/apparent",
            SENSOR_FRAME,
            time,
            processed.apparent,
            processed.apparent_covariance,
        ),
        TopicMessages(
            f"{base}/vector",
            VECTOR,
            running_time(time),
            serialised(types, vector, _vector_columns(("vector",), time, velocity)),
        )
        if len(time)
        else TopicMessages(f"{base}/vector", VECTOR, time, []),
    ]
    platform = processed.recording.station.platform
    if platform is not None:
        along, spread = wind_in_platform(
            velocity, processed.covariance, processed.to_earth, sensor_rotation(platform)
        )
        found.append(_twists(types, f"{base}/body", BODY_FRAME, time, along, spread))
    found += _window_topics(types, base, frame, processed.windows)
    found.append(_diagnostics(types, processed, f"{namespace}/diagnostics"))
    return [topic for topic in found if len(topic.raw)]


def _window_topics(
    types: Typestore, base: str, frame: str, windows: tuple[WindowStatistics, ...]
) -> list[TopicMessages]:
    if not windows:
        return []
    time = np.asarray([w.stop for w in windows], dtype=np.int64)
    mean = np.stack([w.vector_mean for w in windows])
    found = [
        _twists(
            types,
            f"{base}/mean",
            frame,
            time,
            mean,
            np.stack([w.vector_mean_covariance for w in windows]),
        ),
        _twists(
            types,
            f"{base}/bias",
            frame,
            time,
            np.stack([w.bias for w in windows]),
            np.stack([w.bias_covariance for w in windows]),
        ),
    ]
    numbers = {
        "speed": [w.scalar_mean for w in windows],
        "direction_from": direction_from_deg(mean),
        "direction_variance": [w.corrected_direction_variance for w in windows],
    }
    for term in sorted({name for w in windows for name in w.bias_terms}):
        numbers[f"bias/{term}"] = [
            w.bias_terms[term].value if term in w.bias_terms else np.nan for w in windows
        ]
    blank = template(types, NUMBER)
    for name, values in numbers.items():
        raw = serialised(types, blank, {("data",): np.asarray(values, dtype=np.float64)})
        found.append(TopicMessages(f"{base}/{name}", NUMBER, running_time(time), raw))
    return found


def _twists(
    types: Typestore,
    topic: str,
    frame: str,
    time: TimeArray,
    velocity: FloatArray,
    covariance: FloatArray,
) -> TopicMessages:
    if not len(time):
        return TopicMessages(topic, TWIST, time, [])
    full = np.zeros((len(time), 6, 6))
    full[:, :3, :3] = covariance
    columns = _vector_columns(("twist", "twist", "linear"), time, velocity)
    columns["twist", "covariance"] = full.reshape(len(time), 36)
    blank = template(types, TWIST, texts={("header", "frame_id"): frame})
    return TopicMessages(topic, TWIST, running_time(time), serialised(types, blank, columns))


def _vector_columns(
    base: FieldPath, time: TimeArray, velocity: FloatArray
) -> dict[FieldPath, npt.NDArray[Any]]:
    columns: dict[FieldPath, npt.NDArray[Any]] = {("header", "stamp"): time}
    for index, axis in enumerate("xyz"):
        path: FieldPath = (*base, axis)
        columns[path] = velocity[:, index]
    return columns


def _diagnostics(types: Typestore, processed: ProcessedRecording, topic: str) -> TopicMessages:
    """One DiagnosticArray with the health at the end of the recording."""
    stop = processed.recording.stop
    status = types.types["diagnostic_msgs/msg/DiagnosticStatus"]
    pair = types.types["diagnostic_msgs/msg/KeyValue"]
    array = template(types, DIAGNOSTICS)
    array.header.stamp = types.types["builtin_interfaces/msg/Time"](
        sec=stop // 1_000_000_000, nanosec=stop % 1_000_000_000
    )
    array.status = [
        status(
            level=int(item.level),
            name=item.name,
            message=item.message,
            hardware_id=processed.recording.name,
            values=[pair(key=key, value=value) for key, value in item.values.items()],
        )
        for item in processed.health
    ]
    time = np.asarray([stop], dtype=np.int64)
    raw = [bytes(types.serialize_cdr(array, DIAGNOSTICS))] if array.status else []
    return TopicMessages(topic, DIAGNOSTICS, time, raw)
