"""`python -m wind_sensors.cli`."""

import sys

from wind_sensors.cli.main import main

sys.exit(main())
