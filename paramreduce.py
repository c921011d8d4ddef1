"""The package by its project's name: `import paramreduce as pr` is `import paramreduce_cli as pr`."""

import sys

import paramreduce_cli
from paramreduce_cli.__main__ import main

sys.modules[__name__] = paramreduce_cli

if __name__ == "__main__":
    main()
