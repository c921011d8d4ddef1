"""A simulated manoeuvre of the full and of the selected model, coordinate by coordinate."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table

_HEADER = (
    "coordinate", "position, rms about its mean", "deviation, rms", "acceleration, rms", "deviation of the acceleration, rms",
)  # fmt: skip


@placed(PageSection.MANOEUVRE, 2)
def manoeuvre(data: ReportData) -> Table:
    """Motion of the full model, and deviation of the selected model as a percentage of it."""
    result = data.manoeuvre
    if result is None:
        return Table("Simulated manoeuvre", _HEADER, ())
    units = [data.find_length_unit(name) for name in result.names]
    columns = [
        (result.compute_rms(quantity), result.compute_deviations(quantity), end)
        for quantity, end in (("position", ""), ("acceleration", "/s²"))
    ]
    rows = [
        (
            name,
            *(
                cell
                for rms, deviations, end in columns
                for cell in (f"{rms[k]:.3g} {units[k]}{end}", format_percent(float(deviations[k])))
            ),
        )
        for k, name in enumerate(result.names)
    ]
    return Table("Simulated manoeuvre", _HEADER, tuple(rows))
