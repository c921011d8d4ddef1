"""Compiled loops; imported only when they run, because the compiler takes a moment to load."""
