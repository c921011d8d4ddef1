"""The figures of the report, one a file: functions from ReportData to a matplotlib figure."""

from paramreduce_cli.registry import Registry

figures = Registry("figure", __name__)
