"""Where things are below a results folder."""

SUMMARY = "report/summary.json"
ITEMS = ".items"
"""Ending of folders with finished items of an artifact that is not whole yet."""
