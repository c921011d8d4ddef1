"""Closed loops: their equations, how they are closed, and what they leave independent."""
