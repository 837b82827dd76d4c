"""What is told of an averaging window, on the screen and in `windows.csv`."""

from __future__ import annotations

import csv
import io
import math
from typing import NamedTuple

import numpy as np

from wind_sensors.estimation import ProcessedRecording, WindowStatistics
from wind_sensors.estimation.constants import measures_vertical
from wind_sensors.motion.frames import direction_from_deg

TERMS = {
    "u": "overspeeding (u)",
    "w": "angular response (w)",
    "vane_lag": "vane lag",
    "translation": "propeller translation",
    "arithmetic_mean": "arithmetic mean",
    "v": "mean speed above vector mean (v)",
}
"""Names for people of the bias terms; the last is one of the vector mean alone."""


class Quantity(NamedTuple):
    """One number of a window.

    Attributes:
        name: For people.
        unit: Of both numbers.
        value: The number.
        uncertainty: Its standard deviation; None where none is known.
    """

    name: str
    unit: str
    value: float
    uncertainty: float | None = None


def wind_quantities(
    window: WindowStatistics, *, with_vertical: bool, on_board: bool
) -> list[Quantity]:
    """Means, direction and turbulence of a window.

    Args:
        window: The window.
        with_vertical: Whether the station measures the vertical wind.
        on_board: Whether the rotor feels a moving platform's own speed as well.
    """
    east, north = float(window.vector_mean[0]), float(window.vector_mean[1])
    deviation = np.sqrt(np.maximum(np.diag(window.vector_mean_covariance), 0.0))
    variance, by = window.corrected_direction_variance, window.direction_variance_uncertainty
    least, spread, most = (
        math.degrees(math.sqrt(max(v, 0.0))) for v in (variance - by, variance, variance + by)
    )
    quantities = [
        Quantity("mean speed", "m/s", window.scalar_mean, window.scalar_mean_uncertainty),
        Quantity(
            "raw mean speed felt on board" if on_board else "raw mean speed", "m/s",
            window.raw_scalar_mean,
        ),
        Quantity("vector mean", "m/s", math.hypot(east, north), float(deviation[0])),
        Quantity(
            "from", "deg", float(direction_from_deg(window.vector_mean)),
            math.degrees(window.direction_uncertainty),
        ),
        Quantity("direction spread", "deg", spread, 0.5 * (most - least)),
    ]
    for name, value in zip("uvw"[: 3 if with_vertical else 2], window.turbulence, strict=False):
        quantities.append(Quantity(f"turbulence {name}", "m/s", float(value)))
    if with_vertical:
        upwards = Quantity("upwards", "m/s", float(window.vector_mean[2]), float(deviation[2]))
        quantities.append(upwards)
    return quantities


def told_terms(result: ProcessedRecording) -> list[str]:
    """The bias terms that the station's instruments can have: the others are 0 without doubt."""

    def can_be(term: str) -> bool:
        terms = (w.bias_terms[term] for w in result.windows)
        known = (n for t in terms for n in (t.value, t.uncertainty) if math.isfinite(n))
        return any(known)

    return [term for term in TERMS if can_be(term)]


def bias_quantities(window: WindowStatistics, terms: list[str]) -> list[Quantity]:
    """Biases of a window's raw mean speed in percent; the unit tells of what."""
    return [
        Quantity(
            TERMS[term], f"% of {bias.relative_to}", 100.0 * bias.value, 100.0 * bias.uncertainty
        )
        for term, bias in ((term, window.bias_terms[term]) for term in terms)
    ]


def windows_csv(result: ProcessedRecording) -> str:
    """The windows as a table, units in its header, the standard uncertainty behind what has one."""
    station = result.recording.station
    with_vertical, on_board = measures_vertical(station), station.platform is not None
    terms = told_terms(result)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    for number, window in enumerate(result.windows):
        quantities = wind_quantities(window, with_vertical=with_vertical, on_board=on_board)
        biases = bias_quantities(window, terms)
        quantities += [
            bias if bias.name == TERMS["v"] else bias._replace(name=f"bias: {bias.name}")
            for bias in biases
        ]
        if number == 0:
            table.writerow(
                ["start [UTC]", "stop [UTC]", "data [%]", *_headings(quantities), "raw speed of"]
            )
        table.writerow(
            [_utc(window.start), _utc(window.stop), _number(100.0 * window.complete)]
            + [_number(n) for q in quantities for n in (q.value, q.uncertainty) if n is not None]
            + [window.instrument]
        )
    return text.getvalue()


def _headings(quantities: list[Quantity]) -> list[str]:
    names = []
    for quantity in quantities:
        names.append(f"{quantity.name} [{quantity.unit}]")
        if quantity.uncertainty is not None:
            names.append(f"standard uncertainty of {quantity.name} [{quantity.unit}]")
    return names


def _utc(time_ns: int) -> str:
    return f"{np.datetime_as_string(np.datetime64(time_ns, 'ns'), unit='ms')}Z"


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""
