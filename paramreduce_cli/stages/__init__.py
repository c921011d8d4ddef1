"""The stages of the pipeline, a short file each: glue between records and numerics.

The order of the pipeline is not written down anywhere: it follows from what each stage's
signature reads and returns. The sections of the config that it names are those that its result
depends on.
"""

from paramreduce_cli.registry import Registry

stages = Registry("stage", __name__)
