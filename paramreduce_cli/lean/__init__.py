"""Models with few operations: formulations, and the search over them."""
