"""What a selection minimises: each criterion makes an objective of a selection problem."""

from paramreduce_cli.registry import Registry

criteria = Registry("criterion", __name__)
