"""Which parameters to keep: problem, criteria, heuristics, proofs, and the models they make."""
