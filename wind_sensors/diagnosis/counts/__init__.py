"""Pulses counted second by second: what the whole numbers show."""

from wind_sensors.diagnosis.counts.statistics import (
    CountStatistics,
    PairCounts,
    compare_pair,
    count_statistics,
    counts_of,
)

__all__ = ["CountStatistics", "PairCounts", "compare_pair", "count_statistics", "counts_of"]
