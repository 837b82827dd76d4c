"""Read before any test module, and so before numpy is imported."""

from hypothesis import settings

from wind_sensors.processes import one_thread_of_linear_algebra

one_thread_of_linear_algebra()

# An example that takes long says that the machine is busy, or that a kernel is being compiled.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")
