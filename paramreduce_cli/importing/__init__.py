"""From the robot files that people have to a config: read, made simple, written."""
