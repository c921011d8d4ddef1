"""The robot's YAML: schema, defaults, and errors with line numbers. Only here is YAML read."""

from paramreduce_cli.config.loading import get_schema, load_config, locate_errors
from paramreduce_cli.config.schema import Config

__all__ = ["Config", "get_schema", "load_config", "locate_errors"]
