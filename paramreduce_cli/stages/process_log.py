"""The stage process-log: logs of the machine, processed for identification."""

import warnings

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.identification.band_scoring import make_column_function
from paramreduce_cli.identification.friction_selection import make_friction_model
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.identification.quality import find_base
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.static_rests import set_static_rests
from paramreduce_cli.records import MeasuredLog, ProgressCallback, RawLogs
from paramreduce_cli.robots import Robot


def make_no_log_error() -> ConfigError:
    """Return the error that the config names no log."""
    return ConfigError(
        "is missing: it says where the logs are.",
        ("sampling", "log"),
        remedy="`paramreduce init ROBOT.urdf --log FILE` writes it.",
    )


def process_log(
    robot: Robot,
    log: LogSection | None,
    logs: RawLogs,
    report_progress: ProgressCallback = lambda _: None,
) -> MeasuredLog:
    """Process logs: clean, filter, differentiate and split them.

    The cut-off frequencies, and the shape of friction where the config asks for that, are chosen within the training part. The result includes sentences on each processing step, and warnings about suspicious data.

    Raises:
        ConfigError: The config names no log.
    """
    if log is None:
        raise make_no_log_error()
    mechanism = set_static_rests(assemble(robot.build_mechanism()), robot.get_values())
    dynamics = Dynamics(mechanism, once=True)
    found = process_logs_of_robot(dynamics, robot, log, logs, report_progress)
    for text in found.warnings:
        warnings.warn(f"log: {text.rstrip('.')}", ParamreduceWarning, stacklevel=2)
    return found


def process_logs_of_robot(
    dynamics: Dynamics,
    robot: Robot,
    log: LogSection,
    logs: RawLogs,
    report_progress: ProgressCallback = lambda _: None,
) -> MeasuredLog:
    """Process logs with the model of a robot at hand.

    Args:
        dynamics: Dynamics of the robot.
        robot: The robot.
        log: Settings of the section for logs.
        logs: Logs as recorded.
        report_progress: Progress callback.
    """
    base = find_base(dynamics, robot.find_measured()).columns
    names = robot.automatic_friction
    friction = None
    if names:
        drives = robot.list_drives()
        fixed = [name for name in names if "smoothing" in drives[name].model_fields_set]
        friction = make_friction_model(dynamics, base, names, fixed)
    return process_logs(
        logs,
        log,
        dynamics.mechanism.coordinate_names,
        report_progress,
        robot.unmeasured,
        make_column_function(dynamics, base),
        friction,
    )
