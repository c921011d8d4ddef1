"""Worker processes, the items of stages that these do, and room for large matrices."""
