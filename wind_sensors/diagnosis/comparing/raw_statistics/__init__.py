"""Statistics of raw signals that a mean or a spectrum does not show, one module for each kind.

The same functions look at a recording and at its simulation.
"""

STATISTICS = {
    "rotor_rate": (
        "share of long pulse intervals",
        "share of short pulse intervals",
        "unevenness of the slots",
        "unevenness of the slots once per turn",
        "beat of the pulses with the wind, once per turn",
        "beat of the pulses with the wind, twice per turn",
        "largest changes of the rate",
    ),
    "vane_angle": (
        "smallest turns in slow wind",
        "small turns in slow wind",
        "small turns in faster wind",
        "share of readings that tell no direction",
        "readings that tell no direction, along the x axis of the sensor",
        "readings that tell no direction, along its y axis",
        "steps of the readings",
        "largest turns",
    ),
}
"""What the statistics of a channel beyond its spectrum are, for people."""
