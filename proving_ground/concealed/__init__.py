"""What can be wrong in a recording: one planting function for each cause, by family."""
