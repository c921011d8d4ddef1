"""Motions that a machine is to make: to the start of a trajectory, along it, and back."""
