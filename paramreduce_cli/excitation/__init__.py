"""Exciting trajectories: Fourier series, criteria, limits and the optimiser."""
