"""Heuristics that take no criterion: they are of the torques alone."""
