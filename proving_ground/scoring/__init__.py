"""What was found against what was concealed."""
