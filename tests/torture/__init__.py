"""What a long life does to files and runs; `make torture` tries it all, `.ci/run` a little of it."""

from pathlib import Path

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "two_link.yaml"
