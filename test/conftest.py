"""Read before any test module, and so before numpy is imported."""

from wind_sensors.processes import one_thread_of_linear_algebra

one_thread_of_linear_algebra()

from hypothesis import settings  # noqa: E402 - may import numpy

settings.register_profile("no deadline", deadline=None)
"""An example that takes long says that the machine is busy or that a kernel is being compiled."""

settings.load_profile("no deadline")
