"""Descriptions of robots, turned into a Mechanism."""
