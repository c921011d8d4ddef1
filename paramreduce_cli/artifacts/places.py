"""Where things are below a results folder."""

SUMMARY = "report/summary.json"
SHARES = ".parts"
"""Ending of folders with parts of an artifact that is not whole yet."""
