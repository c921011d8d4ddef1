"""Languages that models are written in, one a file."""

from paramreduce_cli.registry import Registry

languages = Registry("exporter", __name__)
