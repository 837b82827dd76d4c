"""Names of all the topics that belong to a station."""

from __future__ import annotations

from wind_sensors.nodes.outputs import BIAS_TERMS, TOPICS
from wind_sensors.nodes.receipts import RECEIPTS_TOPIC
from wind_sensors.station.inputs import angle_inputs
from wind_sensors.station.model import Cup, Input, Propeller, Station

TRUTH_TOPIC = "truth/wind"
"""Where a simulator says what the wind was."""

TRANSFORM_TOPICS = frozenset({"/tf", "/tf_static"})
"""From which a node may take the sensor's pose: inputs that no station file names."""


def instrument_topics(station: Station) -> list[str]:
    """Topics of the instruments, without repetition."""
    sources: list[Input] = []
    for instrument in station.instruments:
        if isinstance(instrument, (Cup, Propeller)):
            sources.append(instrument.pulses)
        else:
            sources += angle_inputs(instrument).values()
    return list(dict.fromkeys(source.topic for source in sources))


def raw_topics(station: Station) -> list[str]:
    """Topics of the instruments, the reference, the air and the platform, without repetition."""
    sources: list[Input | None] = [station.reference.topic if station.reference else None]
    sources += [station.air.temperature, station.air.pressure]
    platform = station.platform
    if platform is not None:
        sources += [platform.odometry, platform.imu, platform.twist]
    others = [source.topic for source in sources if source is not None]
    return list(dict.fromkeys([*instrument_topics(station), *others]))


def station_topics(station: Station) -> list[str]:
    """Raw topics, the true wind, and the outputs of an estimator node."""
    outputs = [topic for topic in TOPICS if "<" not in topic]
    terms = [f"wind/bias/{term}" for term in BIAS_TERMS]
    return [*raw_topics(station), TRUTH_TOPIC, *outputs, *terms]


def is_output(topic: str, message_type: str) -> bool:
    """Whether a topic of a bag is one that an estimator node publishes, in any namespace.

    Args:
        topic: Full name.
        message_type: E.g. `geometry_msgs/msg/Vector3Stamped`; a sonic's wind, or the true wind of
            a simulation, has the name of an output and another type.
    """
    return any(
        message_type.endswith(f"/{kind}")
        and (topic == name if name.startswith("/") else topic.endswith(f"/{name}"))
        for name, kind in _output_types().items()
    )


def _output_types() -> dict[str, str]:
    """Message type by output topic, relative to the node's namespace."""
    types = {RECEIPTS_TOPIC: "DiagnosticStatus"}
    for topic, text in TOPICS.items():
        kind = text.partition(":")[0]
        terms = BIAS_TERMS if "<term>" in topic else ("",)
        types |= {topic.replace("<term>", term): kind for term in terms}
    return types
