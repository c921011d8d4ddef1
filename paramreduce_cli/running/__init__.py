"""Runs of the stages: their order, what is up to date, lists of runs, and rules for other tools."""
