"""What is mounted, where, with which constants; the signals it delivers."""
