"""What the sections of a YAML are made of: numbers, names, one value for all joints or one each."""
