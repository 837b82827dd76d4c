"""Names of all the topics that belong to a station."""

from __future__ import annotations

from wind_sensors.nodes.outputs import TOPICS
from wind_sensors.nodes.signal_messages import TRUTH_TOPIC
from wind_sensors.station.inputs import angle_inputs
from wind_sensors.station.model import Cup, Input, Propeller, Station

BIAS_TERMS = ("u", "v", "w", "vane_lag", "translation", "arithmetic_mean")


def raw_topics(station: Station) -> list[str]:
    """Topics of the instruments, the reference, the air and the platform, without repetition."""
    sources: list[Input | None] = []
    for instrument in station.instruments:
        if isinstance(instrument, (Cup, Propeller)):
            sources.append(instrument.pulses)
        else:
            sources += angle_inputs(instrument).values()
    sources.append(station.reference.topic if station.reference else None)
    sources += [station.air.temperature, station.air.pressure]
    platform = station.platform
    if platform is not None:
        sources += [platform.odometry, platform.imu, platform.twist]
    return list(dict.fromkeys(source.topic for source in sources if source is not None))


def station_topics(station: Station) -> list[str]:
    """Raw topics, the true wind, and the outputs of an estimator node."""
    outputs = [topic for topic in TOPICS if "<" not in topic]
    terms = [f"wind/bias/{term}" for term in BIAS_TERMS]
    return [*raw_topics(station), TRUTH_TOPIC, *outputs, *terms]
