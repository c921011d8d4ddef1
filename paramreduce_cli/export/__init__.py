"""Reduced models as code: one exporter a file."""
