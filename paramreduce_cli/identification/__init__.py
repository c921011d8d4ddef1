"""From logs of a machine to samples, and from samples to values, how sure they are, and what looks wrong."""
