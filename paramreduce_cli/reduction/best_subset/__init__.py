"""The best subset of every size, with proofs."""
