"""Wind to signals."""
