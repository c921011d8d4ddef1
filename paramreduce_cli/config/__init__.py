"""The robot's YAML: schema, defaults, and errors with line numbers. Only here is YAML read."""

from paramreduce_cli.config.loading import config_schema, load_config, placed_errors
from paramreduce_cli.config.schema import Config

__all__ = ["Config", "config_schema", "load_config", "placed_errors"]
