"""Reduced models whose terms are reduced, not only their parameters."""
