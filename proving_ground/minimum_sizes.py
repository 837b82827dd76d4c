"""The smallest size of each effect worth reporting, and what a size means.

A size changes the quarter-hour mean by about half to one per cent, or the direction by about a
degree, or is plainly visible in the signal it touches. Recordings state sizes as multiples of it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MinimumSize:
    """value in `unit`; meaning says of what; kinds are the stations where the effect can occur;
    graded is false where an effect is there or is not; most is the largest size that an instrument
    in use can have, in these units of its smallest."""

    value: float
    unit: str
    meaning: str
    kinds: str = "ABC"
    graded: bool = True
    most: float = 12.0


MINIMUM_SIZES: dict[str, MinimumSize] = {
    "wake_shadow": MinimumSize(0.06, "1", "loss of speed in the middle of the wake"),
    "flow_distortion": MinimumSize(0.02, "1", "largest change of speed with direction"),
    "axis_tilt": MinimumSize(6.0, "deg", "lean of the sensor's axis", most=7.5),
    "platform_velocity": MinimumSize(
        1.0, "1", "share of the platform's velocity missing from its odometry", "B", False
    ),
    "platform_velocity_scale": MinimumSize(
        0.08, "1", "error of scale of the velocity", "B", most=6.0
    ),
    "lever_arm": MinimumSize(1.0, "m", "error of the sensor's place", "B"),
    "heading_deviation": MinimumSize(3.0, "deg", "compass deviation, once a turn", "B"),
    "frame_error": MinimumSize(8.0, "deg", "turn of the velocity's frame", "B", most=11.25),
    "rotor_downwash": MinimumSize(0.8, "m/s", "downward jet in a calm", "B"),
    "calibration_drift": MinimumSize(0.01, "1", "change of the indicated speed"),
    "calibration_offset": MinimumSize(0.12, "m/s", "loss of speed at every wind"),
    "bearing_friction": MinimumSize(0.12, "m/s", "loss of speed at 5 m/s"),
    "air_density": MinimumSize(0.12, "1", "logarithm of the loss of density", most=6.0),
    "rotor_inertia": MinimumSize(0.5, "1", "growth of the moment of inertia"),
    "torque_asymmetry": MinimumSize(
        0.25, "1", "growth of the torque while speeding up", most=3.6
    ),
    "damaged_cup": MinimumSize(0.03, "1", "loss of force on one cup or blade"),
    "angular_response": MinimumSize(0.12, "1", "change of the response to a tilted wind"),
    "icing": MinimumSize(0.012, "1", "loss of speed by ice, with the mass that goes with it"),
    "propeller_translation": MinimumSize(
        0.25, "m", "error of the propeller's distance from the vane's axis", "C"
    ),
    "vane_friction": MinimumSize(1.5, "deg", "angle at which the vane sticks at 5 m/s"),
    "vane_inertia": MinimumSize(0.4, "1", "growth of the vane's moment of inertia"),
    "vane_damping": MinimumSize(0.5, "1", "growth of the damping ratio at 8 m/s"),
    "vane_imbalance": MinimumSize(
        1.2, "deg", "error of the vane at 5 m/s on a leaning axis", most=6.0
    ),
    "missed_pulses": MinimumSize(0.01, "1", "share of the pulses lost"),
    "extra_pulses": MinimumSize(0.01, "1", "share of the pulses doubled"),
    "encoder_slot_error": MinimumSize(0.03, "1", "error of one slot in slot widths"),
    "vane_offset": MinimumSize(1.0, "deg", "turn of the vane's zero"),
    "vane_eccentricity": MinimumSize(1.0, "deg", "error of the vane once a turn"),
    "potentiometer_gap": MinimumSize(4.0, "deg", "width of the vane's dead gap"),
    "quantisation": MinimumSize(2.0, "deg", "step of the vane's reading"),
    "low_pass_filter": MinimumSize(0.12, "s", "time constant of the vane's electronics"),
    "sensor_swap": MinimumSize(1.0, "1", "whether the vane counts clockwise", graded=False),
    "stuck_sensor": MinimumSize(20.0, "s", "time for which a signal stands still"),
    "timestamp_latency": MinimumSize(0.1, "s", "delay of the stamps"),
    "clock_drift": MinimumSize(0.25, "s", "error of the stamps at the end of the record"),
}


NEEDS_SLOTS = ("damaged_cup", "encoder_slot_error")


def applicable(kind: str, pulses_per_revolution: int) -> list[str]:
    """Names of the effects that can show on a station, in a fixed order.

    What happens within a turn shows only where a turn has three pulses or more.
    """
    return [
        name
        for name, size in MINIMUM_SIZES.items()
        if kind in size.kinds and (pulses_per_revolution > 2 or name not in NEEDS_SLOTS)
    ]
