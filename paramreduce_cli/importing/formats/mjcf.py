"""MJCF, MuJoCo's own files."""

from paramreduce_cli.importing.mjcf_files import read_mjcf
from paramreduce_cli.importing.mjcf_writing import write_mjcf
from paramreduce_cli.importing.robot_format import RobotFormat
from paramreduce_cli.records import Kind


def mjcf() -> RobotFormat:
    """Return how MJCF is read and written."""
    held = (Kind.VISCOUS, Kind.COULOMB, Kind.ROTOR, Kind.STIFFNESS)
    return RobotFormat("mujoco", read_mjcf, write_mjcf, held, True, True)
