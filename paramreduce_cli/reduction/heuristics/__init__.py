"""How subsets are found; those in ``torque_only`` make sense for the torque error alone."""

from paramreduce_cli.registry import Registry

heuristics = Registry("heuristic", __name__)
