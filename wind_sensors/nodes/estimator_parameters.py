"""The parameters that every estimator node has, besides those of its instruments."""

from __future__ import annotations

from dataclasses import replace

from wind_sensors.estimation import METHODS, EstimatorSettings
from wind_sensors.nodes.parameters import Parameter
from wind_sensors.nodes.quality import INPUT_DEPTH
from wind_sensors.nodes.receipts import RECEIPTS_TOPIC
from wind_sensors.nodes.station_parameters import FRAME_ID, FRAME_PATTERN, STATION

_DEFAULTS = EstimatorSettings()

SETTINGS: tuple[Parameter, ...] = (
    Parameter(
        "method",
        str,
        _DEFAULTS.method,
        "How wind follows from the signals: kalman (turbulence, instruments and pulse times in "
        "one filter with a fixed-lag smoother), inverse (the instruments' equations solved for "
        "the wind), naive (the calibration alone, for comparison).",
        choices=tuple(METHODS),
        changeable=True,
    ),
    Parameter(
        "output_rate",
        float,
        _DEFAULTS.output_rate,
        "Estimates per second [Hz].",
        minimum=0.1,
        maximum=200.0,
        changeable=True,
    ),
    Parameter(
        "smoother_lag",
        float,
        _DEFAULTS.smoother_lag,
        "How much later data may still improve an estimate [s]; on average an estimate comes late "
        "by 1.25 times this and by reordering_window.",
        minimum=0.05,
        maximum=600.0,
        changeable=True,
    ),
    Parameter(
        "reordering_window",
        float,
        _DEFAULTS.reordering_window,
        "How long to wait for messages that arrive out of order [s].",
        minimum=0.0,
        maximum=10.0,
        changeable=True,
    ),
    Parameter(
        "bandwidth",
        float,
        _DEFAULTS.bandwidth,
        "Cut-off frequency of the noise filter of method inverse [Hz].",
        minimum=0.01,
        maximum=50.0,
        changeable=True,
    ),
    Parameter(
        "window",
        float,
        _DEFAULTS.window,
        "Averaging time of the mean wind and its biases [s].",
        minimum=1.0,
        maximum=86400.0,
        changeable=True,
    ),
    Parameter(
        "adaptation_time",
        float,
        _DEFAULTS.adaptation_time,
        "Memory of the turbulence that the filter assumes [s].",
        minimum=5.0,
        maximum=3600.0,
        changeable=True,
    ),
    Parameter(
        "stop_time",
        float,
        _DEFAULTS.stop_time,
        "A rotor without an edge for this long has stopped; so long is the wind told after the "
        "last sign of life of all rotors and vanes [s].",
        minimum=0.5,
        maximum=600.0,
        changeable=True,
    ),
    Parameter(
        "gap_time",
        float,
        _DEFAULTS.gap_time,
        "An input silent for this long has a gap [s].",
        minimum=0.1,
        maximum=600.0,
        changeable=True,
    ),
    Parameter(
        "jump_time",
        float,
        _DEFAULTS.jump_time,
        "A clock that steps back by more than this restarts the estimator; a stamp that is ahead "
        "by more waits for others that agree [s].",
        minimum=0.5,
        maximum=600.0,
        changeable=True,
    ),
    Parameter(
        "turbulence_intensity",
        float,
        _DEFAULTS.turbulence_intensity,
        "Standard deviation over mean speed, assumed until the data have spoken.",
        minimum=0.01,
        maximum=1.0,
        changeable=True,
    ),
    Parameter(
        "use_air",
        bool,
        _DEFAULTS.use_air,
        "Use temperature and pressure for the air density where they are measured.",
        changeable=True,
    ),
)
"""Parameters that make up `EstimatorSettings`."""

NODE_PARAMETERS: tuple[Parameter, ...] = (
    STATION,
    *SETTINGS,
    replace(FRAME_ID, changeable=True),
    Parameter(
        "sensor_frame_id",
        str,
        "wind_sensor",
        "Frame of wind/apparent: x forward, y left, z up.",
        pattern=FRAME_PATTERN,
        changeable=True,
    ),
    Parameter(
        "body_frame_id",
        str,
        "base_link",
        "Frame of wind/body, the platform's: x forward, y left, z up.",
        pattern=FRAME_PATTERN,
        changeable=True,
    ),
    Parameter(
        "use_tf",
        bool,
        True,
        "Take the sensor's pose on a moving platform from tf2 (sensor_frame_id in body_frame_id) "
        "where tf2 is installed and knows both frames; the station file's pose until then.",
    ),
    Parameter(
        "nmea",
        bool,
        False,
        "Publish NMEA 0183 MWV and MWD sentences on wind/nmea.",
        changeable=True,
    ),
    Parameter(
        "nmea_talker",
        str,
        "WI",
        "Talker of the sentences, two capital letters.",
        pattern="[A-Z]{2}",
        changeable=True,
    ),
    Parameter(
        "nmea_rate",
        float,
        1.0,
        "Sentences per second [Hz].",
        minimum=0.01,
        maximum=20.0,
        changeable=True,
    ),
    Parameter(
        "reliable_inputs",
        bool,
        False,
        "Ask for lost raw messages again; needs publishers that are reliable too.",
    ),
    Parameter(
        "input_depth",
        int,
        INPUT_DEPTH,
        "Raw messages kept for a busy node.",
        minimum=1,
        maximum=1_000_000,
    ),
    Parameter(
        "send_receipts",
        bool,
        False,
        f"Tell on {RECEIPTS_TOPIC} how many raw messages have come, so that a simulator can wait.",
    ),
    Parameter(
        "wait_for_subscribers",
        int,
        0,
        "With send_receipts: tell nothing, so that the simulator does not begin, before each "
        "output has so many subscribers; one that finds it late has lost the first messages.",
        minimum=0,
        maximum=100,
    ),
    Parameter(
        "silence",
        float,
        2.0,
        "When nothing at all has arrived for this long of wall time [s], the node's own clock "
        "moves the estimate on, this far behind it.",
        minimum=0.1,
        maximum=600.0,
        changeable=True,
    ),
    Parameter(
        "diagnostics_period", float, 1.0, "Between diagnostics [s].", minimum=0.05, maximum=60.0
    ),
)
"""Parameters of every estimator node, besides those of its instruments."""
