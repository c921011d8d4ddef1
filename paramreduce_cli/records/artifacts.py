"""Artifacts that the stages have made of one robot."""

from paramreduce_cli.records.logs import Identification, MeasuredLog
from paramreduce_cli.records.model import Model
from paramreduce_cli.records.reduction import Reduction
from paramreduce_cli.records.representation import record
from paramreduce_cli.records.terms import TermReduction
from paramreduce_cli.records.trajectories import Trajectories
from paramreduce_cli.records.validation import Validation


@record
class Artifacts:
    """The artifacts of one robot without its samples; None where a stage has nothing to do."""

    model: Model | None
    """None where samples were brought without a robot."""
    trajectories: Trajectories | None
    reduction: Reduction
    validation: Validation
    log: MeasuredLog | None
    identification: Identification | None
    terms: TermReduction | None
