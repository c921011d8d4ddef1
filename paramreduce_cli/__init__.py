"""paramreduce: the smallest set of dynamic parameters that still predicts a robot's forces."""

__version__ = "0.1.0"
