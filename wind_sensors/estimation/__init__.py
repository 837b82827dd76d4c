"""Signals to wind: streaming estimators that give the same bits live and offline."""

from wind_sensors.estimation.outputs import (
    BiasTerm,
    HealthItem,
    HealthLevel,
    ProcessedRecording,
    WindEstimate,
    WindowStatistics,
)
from wind_sensors.estimation.processing import process
from wind_sensors.estimation.settings import METHODS, EstimatorSettings, Method
from wind_sensors.estimation.streaming import StreamingEstimator, make_estimator, must_compile

__all__ = [
    "METHODS",
    "BiasTerm",
    "EstimatorSettings",
    "HealthItem",
    "HealthLevel",
    "Method",
    "ProcessedRecording",
    "StreamingEstimator",
    "WindEstimate",
    "WindowStatistics",
    "make_estimator",
    "must_compile",
    "process",
]
