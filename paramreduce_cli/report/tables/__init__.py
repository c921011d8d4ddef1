"""The tables of the report, one a file: functions from ReportData to a Table."""

from paramreduce_cli.registry import Registry

tables = Registry("table", __name__)
