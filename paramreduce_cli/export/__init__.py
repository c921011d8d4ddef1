"""Models as code: which one, in which language, and whether it computes what it should."""
