"""Moving platforms without a reference: the earth wind itself is unknown, but changes slowly."""
