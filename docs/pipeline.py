"""The diagram of the pipeline in the README, from the declared stages: `python docs/pipeline.py` renews it."""

from pathlib import Path

from paramreduce_cli.artifacts.store import get_file
from paramreduce_cli.running.pipeline import Stage, list_stages

IMAGE = Path(__file__).parent / "images" / "pipeline.svg"
_WIDTH, _HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 150, 44, 34, 20, 12
_STYLE = (
    "text{font:12px system-ui,sans-serif;text-anchor:middle;fill:#1f2328}"
    ".file{font-size:10.5px;fill:#57606a}"
    "rect{fill:#f6f8fa;stroke:#57606a;rx:6}.optional{stroke-dasharray:4 3}"
    "path{fill:none;stroke:#57606a}"
)


def draw_pipeline() -> str:
    """Return the stages as SVG: columns by their longest chain of inputs, optional ones dashed, arrows for direct inputs."""
    stages = {stage.name: stage for stage in list_stages()}
    makers = {stage.output: stage.name for stage in stages.values()}
    inputs = {
        name: {makers[entry.type] for entry in stage.artifacts} for name, stage in stages.items()
    }
    columns: dict[str, int] = {}
    for name in stages:  # in their order, so that inputs have a column already
        columns[name] = 1 + max((columns[other] for other in inputs[name]), default=-1)
    places: dict[str, tuple[int, int]] = {}
    for name, column in columns.items():
        row = sum(1 for other in places.values() if other[0] == column)
        places[name] = (column, row)
    width = 2 * _MARGIN + (1 + max(columns.values())) * (_WIDTH + _GAP_X) - _GAP_X
    rows = 1 + max(row for _, row in places.values())
    height = 2 * _MARGIN + rows * (_HEIGHT + _GAP_Y) - _GAP_Y
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="Stages of a run">',
        f"<style>{_STYLE}</style>",
        '<rect width="100%" height="100%" style="fill:#fff;stroke:none;rx:0"/>',
    ]
    for name in stages:
        direct = inputs[name] - {far for near in inputs[name] for far in _ancestors(near, inputs)}
        parts += [_arrow(places[other], places[name]) for other in sorted(direct)]
    parts += [_box(stage, places[stage.name]) for stage in stages.values()]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _ancestors(name: str, inputs: dict[str, set[str]]) -> set[str]:
    """Return the stages that a stage depends on, directly or through others."""
    return inputs[name] | {far for near in inputs[name] for far in _ancestors(near, inputs)}


def _corner(place: tuple[int, int]) -> tuple[int, int]:
    return _MARGIN + place[0] * (_WIDTH + _GAP_X), _MARGIN + place[1] * (_HEIGHT + _GAP_Y)


def _box(stage: Stage, place: tuple[int, int]) -> str:
    """Return the box of a stage, with the file that it makes."""
    x, y = _corner(place)
    optional = stage.name in ("process-log", "reduce-terms", "identify")
    file = get_file(stage.output).split("/")[0]
    return (
        f'<rect {"class=" + chr(34) + "optional" + chr(34) + " " if optional else ""}x="{x}" y="{y}" '
        f'width="{_WIDTH}" height="{_HEIGHT}"/>'
        f'<text x="{x + _WIDTH / 2:g}" y="{y + 18}">{stage.name}</text>'
        f'<text class="file" x="{x + _WIDTH / 2:g}" y="{y + 34}">{file}</text>'
    )


def _arrow(start: tuple[int, int], end: tuple[int, int]) -> str:
    """Return a curve from the right side of one box to the left side of another."""
    (x0, y0), (x1, y1) = _corner(start), _corner(end)
    x0, y0, y1 = x0 + _WIDTH, y0 + _HEIGHT // 2, y1 + _HEIGHT // 2
    bend = _GAP_X // 2
    head = f"M {x1 - 6} {y1 - 4} L {x1} {y1} L {x1 - 6} {y1 + 4}"
    return f'<path d="M {x0} {y0} C {x0 + bend} {y0} {x1 - bend} {y1} {x1} {y1} {head}"/>'


if __name__ == "__main__":
    IMAGE.write_text(draw_pipeline(), encoding="utf-8")
