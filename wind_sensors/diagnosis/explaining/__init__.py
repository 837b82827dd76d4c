"""From a mismatch to effects of the catalogue that explain it."""
