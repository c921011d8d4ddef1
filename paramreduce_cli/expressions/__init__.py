"""The expression graph: counting operations, compiling to machine code."""
