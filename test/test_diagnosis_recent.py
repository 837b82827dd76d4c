"""What a search keeps of its last results: by the objects themselves, and only so many."""

from __future__ import annotations

import numpy as np

from wind_sensors.diagnosis.explaining.recent import Recent


def test_results_are_kept_for_the_very_objects_and_the_oldest_is_forgotten() -> None:
    recent: Recent[int] = Recent(2)
    first, equal, last = np.zeros(3), np.zeros(3), np.ones(3)
    recent.keep((first, None), 1, how="roughly")
    assert recent.find((first, None), how="roughly") == 1
    assert recent.find((first, None)) is None
    assert recent.find((equal, None), how="roughly") is None
    calls: list[int] = []

    def computed() -> int:
        calls.append(1)
        return 10 + len(calls)

    assert [recent.of((equal, last), computed) for _ in range(3)] == [11, 11, 11]
    recent.keep((last,), 3)
    assert recent.find((first, None), how="roughly") is None
    assert recent.of((equal, last), computed) == 11
