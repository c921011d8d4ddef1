"""Speed and memory, as ratios measured in one run; `make benchmark` prints them."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before anything imports NumPy
