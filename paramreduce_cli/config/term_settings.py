"""Settings for removing negligible terms."""

from typing import Annotated, Literal

from pydantic import Field

from paramreduce_cli.fields.numbers import Number, Whole
from paramreduce_cli.fields.section import Section


class TermsSection(Section):
    """The settings for removing negligible terms of functions, besides parameters."""

    functions: Annotated[list[Literal["inverse", "direct"]], Field(min_length=1)] = [
        "inverse",
        "direct",
    ]
    """Each is simplified by itself, and gets values of its own."""
    torque_error: Annotated[Number, Field(gt=0, lt=1)] = 0.01
    """Allowed on the estimation set, and on the validation set where its torques are not held out, a share (0.01 is 1 %)."""
    acceleration_error: Annotated[Number, Field(gt=0)] | None = None
    """The same of accelerations, a share, for the direct dynamics; without it only a positive definite mass matrix is asked for."""
    rounds: Annotated[Whole, Field(ge=0, le=100_000)] = 8
    """How many times in a row it may bring nothing to leave terms out once more: first of the best subsets, in formulations changed at random, then from shortly before the best ends. What saves less than one operation in two hundred brings nothing."""
    time_limit: Annotated[Number, Field(gt=0)] | None = None
    """Time limit for the descents of each function, s, which takes somewhat longer as a whole: then no more are begun, and what is found depends on the machine; without it they end by themselves."""
