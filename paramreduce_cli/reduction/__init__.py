"""Which parameters to keep: errors, and one file per heuristic."""
