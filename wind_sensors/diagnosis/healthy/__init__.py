"""What is normal: learnt from healthy recordings, the measure of every difference."""
