"""Whether data bear out an explanation, and what is said of it."""
