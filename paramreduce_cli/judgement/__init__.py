"""What judges reduced models: their errors, picking one, the verdict, stability."""
