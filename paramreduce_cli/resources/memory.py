"""Memory that this process holds and no longer needs."""

import ctypes
import gc
import sys


def release_memory() -> None:
    """Give memory that is free again back to the system, where the C library keeps it."""
    gc.collect()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
        if trim is not None:
            trim(0)
