"""A recording beside the simulation of its station: what is compared, and how it is looked at."""
