"""Figures, tables and the page: pure functions of records."""
