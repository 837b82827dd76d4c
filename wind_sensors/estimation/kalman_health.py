"""What the Kalman estimator has to say about its rotors, its vanes and itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wind_sensors.estimation.outputs import HealthItem, HealthLevel
from wind_sensors.estimation.turbulence_process import WIND_STATES

if TYPE_CHECKING:
    from wind_sensors.estimation.kalman import KalmanCore

_INCONSISTENT = 3.0
"""Mean squared normalised innovation from which the estimate no longer describes the data."""
_EXTRA_SHARE = 0.005
_LOST_SHARE = 0.005


def kalman_health(core: KalmanCore) -> list[HealthItem]:
    """Items `<rotor> edges`, `<vane> readings`, `<propeller> angle`, `<rotor> lulls`,
    `estimate`."""
    f = core.filter
    items = []
    rotors = len(core.rotor_names)
    ratios = f.innovation[:, 0] / np.maximum(f.innovation[:, 1], 1.0)
    for i, name in enumerate(core.rotor_names):
        accepted, lost, extra, regained = (int(v) for v in f.tally[i])
        values = {
            "edges": str(accepted),
            "lost edges": str(lost),
            "extra edges": str(extra),
            "implausible edges": str(int(f.outliers[i])),
            "wind found again": str(regained),
            "edge scatter": f"{np.sqrt(f.edge_variance[i]):.4f} slots",
            "speed l s": f"{f.mean[WIND_STATES + 2 * i]:.2f} m/s",
            "normalised innovation": f"{ratios[i]:.2f}",
        }
        level, message = HealthLevel.OK, "Edges fit the rotor's motion."
        if accepted and extra > _EXTRA_SHARE * accepted:
            level, message = HealthLevel.WARN, f"{extra} implausible extra edges were left out."
        elif accepted and lost > _LOST_SHARE * accepted:
            level, message = HealthLevel.WARN, f"{lost} edges are missing and were restored."
        items.append(HealthItem(f"{name} edges", level, message, values))
    for i, name in enumerate(core.vane_names):
        k = rotors + i
        values = {
            "reading scatter": f"{np.degrees(np.sqrt(f.reading_variance[i])):.2f} deg",
            "implausible readings": str(int(f.outliers[k])),
            "normalised innovation": f"{ratios[k]:.2f}",
        }
        items.append(
            HealthItem(
                f"{name} readings", HealthLevel.OK, "Readings fit the vane's motion.", values
            )
        )
    items += core.watch.health(((f.tally[:, 0] > 0) & (f.stride > 0)).tolist())
    items += core.lulls.health()
    seen = f.innovation[:, 1] > 50.0
    worst = float(ratios[seen].max()) if seen.any() else 1.0
    values = {
        "normalised innovation": f"{worst:.2f}",
        "small-scale level along, across, up": (
            f"{f.levels[0]:.3f}, {f.levels[2]:.3f}, {f.levels[4]:.3f} m^2 s^-2 s^-2/3"
        ),
        "restarts": str(core.restarts),
    }
    if worst > _INCONSISTENT:
        items.append(
            HealthItem(
                "estimate",
                HealthLevel.WARN,
                "Innovations exceed their expected scatter: the station does not describe its "
                "signals.",
                values,
            )
        )
    else:
        items.append(HealthItem("estimate", HealthLevel.OK, "Consistent with the data.", values))
    return items
