"""Worker processes, the completion of items by them, and storage for large matrices."""
