"""Rotors, friction and springs: along what they act, and their parameters."""

from paramreduce_cli.records import BASE, DRIVE, SIGN_FRICTION, Drive, Kind, Mechanism, Parameter
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table

_USUAL = (Kind.ROTOR, Kind.VISCOUS, Kind.COULOMB, Kind.OFFSET, Kind.STIFFNESS)
"""Kinds that have a column even if no drive has them."""


@placed(PageSection.MECHANISM, 4)
def drives(data: ReportData) -> Table:
    """Rotors, friction and springs, also those between bodies, with the motions that they act along."""
    mechanism = data.robot_model.mechanism
    present = {parameter.kind for parameter in mechanism.parameters}
    kinds = [kind for kind in DRIVE if kind in present or kind in _USUAL]
    rows = []
    for drive in mechanism.drives:
        columns = mechanism.find_drive_columns(drive)
        cells = [
            _format_cell(
                mechanism.parameters[columns[kind]], data.robot_model.values[columns[kind]]
            )
            if kind in columns
            else ""
            for kind in kinds
        ]
        sign = _sign(drive) if columns.keys() & set(SIGN_FRICTION) else ""
        if Kind.STRIBECK in columns:
            sign += f"; Stribeck beyond {drive.stribeck_velocity:g}"
        sprung = {Kind.STIFFNESS, Kind.SPRING_TABLE} & columns.keys()
        unit = "m" if any(mechanism.parameters[k].sliding for k in columns.values()) else "rad"
        slack = f"{drive.rest:g} {unit}" if sprung else ""
        rows.append((drive.name, _describe_motion(mechanism, drive), *cells, sign, slack))
    header = ("drive", "motion", *(kind.symbol for kind in kinds), "sign of speed", "slack at")
    return Table("Rotors, friction and springs", header, tuple(rows))


def _format_cell(parameter: Parameter, value: float) -> str:
    return f"{value:g} {parameter.unit}".strip().replace("^2", "²")


def _describe_motion(mechanism: Mechanism, drive: Drive) -> str:
    """Return the weighted sum of coordinates, or the motion between two bodies, that a drive acts along."""
    if drive.between is not None:
        first, second = (
            "base" if k == BASE else mechanism.bodies[k].name for k in drive.between.bodies
        )
        axis = " xyz"[drive.between.axis + 1] if drive.between.kind in ("shift", "turn") else ""
        return f"{drive.between.kind} {axis} of {second} from {first}".replace("  ", " ")
    names = zip(drive.weights.tolist(), mechanism.generalised_names, strict=True)
    terms = [f"{'' if weight == 1 else f'{weight:g} '}{name}" for weight, name in names if weight]
    return " + ".join(terms).replace("+ -", "- ")


def _sign(drive: Drive) -> str:
    return f"tanh(v / {drive.smoothing:g})" if drive.smoothing else "sign(v)"
