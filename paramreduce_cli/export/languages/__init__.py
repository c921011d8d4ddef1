"""Languages that models are written in, one a file."""

from paramreduce_cli.registry import Registry

languages = Registry("language", __name__)
