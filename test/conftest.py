"""Read before any test module, and so before numpy is imported."""

from wind_sensors.processes import one_thread_of_linear_algebra

one_thread_of_linear_algebra()
