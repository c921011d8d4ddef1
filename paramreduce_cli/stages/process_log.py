"""The stage process-log: logs of the machine, processed for identification."""

import warnings

import numpy as np

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.identification.cutoff_selection import make_column_function
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import MeasuredLog, Model, ProgressCallback, RawLogs


def make_no_log_error() -> ConfigError:
    """Return the error that the config names no log."""
    return ConfigError(
        "is missing: it says where the logs are.",
        ("sampling", "log"),
        remedy="`paramreduce init ROBOT.urdf --log FILE` writes it.",
    )


def process_log(
    log: LogSection | None,
    model: Model,
    logs: RawLogs,
    report_progress: ProgressCallback = lambda _: None,
) -> MeasuredLog:
    """Process logs: clean, filter, differentiate and split them.

    The result includes sentences on each processing step, and warnings about suspicious data.

    Raises:
        ConfigError: The config names no log.
    """
    if log is None:
        raise make_no_log_error()
    names = model.mechanism.coordinate_names
    unmeasured = [
        name for name, size in zip(names, model.nominal_torque, strict=True) if np.isinf(size)
    ]
    dynamics = Dynamics(model.mechanism, once=True)
    compute_columns = make_column_function(dynamics, model.base.columns)
    found = process_logs(logs, log, names, report_progress, unmeasured, compute_columns)
    for text in found.warnings:
        warnings.warn(f"log: {text.rstrip('.')}", ParamreduceWarning, stacklevel=2)
    return found
