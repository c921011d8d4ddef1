"""Types of the values in a YAML file: numbers, names, and values for all joints or for each."""
