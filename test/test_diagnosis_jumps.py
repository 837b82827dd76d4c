"""Where stamps jump: what gaps and crowds of stamps tell of a clock."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, recorded
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.explaining.jumps import MOST_GAPS, late_stamps

FloatArray = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return prepare(recorded(STATION, 96))


def stamps(seed: int, every: float = 0.05, seconds: float = 390.0) -> FloatArray:
    """Stamps of a sensor that jitters a little [s]."""
    rng = np.random.default_rng(seed)
    even = np.arange(0.0, seconds, every)
    return np.asarray(even + 0.1 * every * rng.uniform(-1.0, 1.0, even.size))


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**16),
    late=st.floats(0.3, 3.0),
    begin=st.floats(60.0, 150.0),
    lasting=st.floats(60.0, 150.0),
)
def test_a_gap_tells_the_delay_and_a_crowd_its_end(
    comparison: Comparison, seed: int, late: float, begin: float, lasting: float
) -> None:
    time = stamps(seed)
    end = begin + lasting
    moved = np.sort(np.where((time > begin) & (time < end), time + late, time))
    lasts, ends = late_stamps(comparison, "vane", moved)
    since = comparison.drive.elapsed
    for term in (lasts, ends):
        assert term.values["latency"] == pytest.approx(late, abs=0.03)
        assert term.held == {"latency"}
        assert term.interval[0] - since == pytest.approx(begin, abs=0.06)
    assert lasts.interval[1] is None
    assert ends.interval[1] is not None
    assert ends.interval[1] - since == pytest.approx(end, abs=0.4)


def test_messages_that_were_lost_again_and_again_are_no_jump(comparison: Comparison) -> None:
    time = stamps(3)
    assert late_stamps(comparison, "vane", time) == []
    kept = np.ones(time.size, dtype=np.bool_)
    for gap in range(MOST_GAPS + 1):
        kept[1000 * (gap + 1) : 1000 * (gap + 1) + 20] = False
    assert late_stamps(comparison, "vane", time[kept]) == []
