"""Independent implementations; none shares code with what it checks."""
