"""URDF."""

from paramreduce_cli.importing.robot_format import RobotFormat
from paramreduce_cli.importing.urdf_files import read_urdf
from paramreduce_cli.importing.urdf_writing import write_urdf
from paramreduce_cli.records import Kind


def urdf() -> RobotFormat:
    """Return how URDF is read and written."""
    held = (Kind.VISCOUS, Kind.COULOMB)
    return RobotFormat("robot", read_urdf, write_urdf, held, False, False)
