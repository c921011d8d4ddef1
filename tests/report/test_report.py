import csv
import io
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import h5py
import numpy as np
import pytest
from conftest import run_stages

from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.tables import tables
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.latex_table import format_latex_table
from paramreduce_cli.texts.table import Table


@pytest.fixture(scope="module")
def folder(two_link_results):
    return two_link_results / "report"


@pytest.fixture(scope="module")
def in_every_format(two_link_results, made_once):
    """The folder of a report with figures in all formats."""

    def make(folder):
        shutil.copytree(two_link_results, folder / "results")
        run_stages(folder / "results", "report.formats=[pdf, svg, png]")

    return made_once("formats", make) / "results" / "report"


@pytest.mark.parametrize(
    "name",
    ["trajectory", "torque-error", "operations", "error-vs-operations", "torques",
     "acceleration-error", "poses", "mass-matrix-condition"],
)  # fmt: skip
def test_figures_are_there_in_every_format(in_every_format, name):
    folder = in_every_format / "figures"
    assert name in figures
    assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    ET.fromstring((folder / f"{name}.svg").read_text())


@pytest.mark.parametrize(
    "name", ["torque-error", "error-vs-operations", "torques", "poses", "trajectory"]
)
def test_a_pdf_is_as_wide_as_a_column_and_carries_its_letters(in_every_format, name):
    content = (in_every_format / "figures" / f"{name}.pdf").read_bytes()
    (box,) = re.findall(rb"/MediaBox \[ ([^]]*) \]", content)
    width, height = (float(number) for number in box.split()[2:])
    assert width == 3.5 * 72
    assert height < 9 * 72
    assert content.count(b"/Type /FontDescriptor") == content.count(b"/FontFile2 ") > 0


WITHOUT_ROWS = {"drives", "manoeuvre", "terms", "term-ranges", "term-differences", "log-steps", "hints", "identified-parameters", "identified-errors", "physical-consistency"}  # fmt: skip
"""Tables of what the two links do not have: no files are written of them."""


def test_tables_without_rows_are_not_written(folder):
    written = {path.name for path in (folder / "tables").iterdir()}
    assert written == {
        f"{name}.{kind}" for name in {*tables} - WITHOUT_ROWS for kind in ("csv", "tex")
    }


@pytest.mark.parametrize("name", sorted({*tables} - WITHOUT_ROWS))
def test_tables_are_rectangular(folder, name):
    rows = list(csv.reader(io.StringIO((folder / "tables" / f"{name}.csv").read_text())))
    assert len({len(row) for row in rows}) == 1
    latex = (folder / "tables" / f"{name}.tex").read_text()
    assert latex.count(r"\begin{tabular}") + latex.count(r"\begin{longtable}") == 1
    assert latex.count("&") == len(rows) * (len(rows[0]) - 1)


def test_the_page_needs_nothing_else(folder):
    class Links(HTMLParser):
        found: list[str] = []  # noqa: RUF012
        anchors: set[str] = set()  # noqa: RUF012

        def handle_starttag(self, tag, attrs):
            self.found += [v for k, v in attrs if k in ("src", "href") and v]
            own = {f"#{v}" for k, v in attrs if k == "id"}
            assert not own & self.anchors  # two of one name: links would go to the first
            self.anchors |= own

    page = (folder / "index.html").read_text()
    links = Links()
    links.feed(page)
    inside = {link for link in links.found if link.startswith("#")}
    embedded = [link.partition(";base64,")[0] for link in links.found if link not in inside]
    assert sorted(set(embedded)) == ["data:application/zip", "data:image/svg+xml"]
    assert inside <= links.anchors


@pytest.mark.parametrize("name", [*figures, *tables])
def test_everything_stands_on_the_page(folder, name):
    page = (folder / "index.html").read_text()
    if name in figures:
        drawn = (folder / "figures" / f"{name}.svg").exists()
        assert (f'id="figure-{name}"' in page) == drawn
    if name in tables:
        assert (f'id="table-{name}"' in page) == (folder / "tables" / f"{name}.csv").exists()


def test_summary_holds_what_a_regression_job_compares(summary):
    assert {"robot", "config_sha256", "versions", "seconds", "model", "trajectories", "reduction",
            "validation", "selected"} <= set(summary)  # fmt: skip
    model = {"n_dof", "n_parameters", "n_affecting", "n_base", "rank_gap", "names"}
    assert model <= set(summary["model"])
    stages = {"build-model", "optimize-trajectories", "sample", "reduce", "validate"}
    assert set(summary["seconds"]) == stages
    entry = summary["trajectories"]["estimation"][0]
    assert {"kappa_start", "kappa", "kappa_variants", "peak_position", "peak_velocity", "cpu_seconds",
            "iterations", "status"} <= set(entry)  # fmt: skip
    for name in ("qr", "forward-selection", "backward-elimination"):
        orders = [summary["reduction"][one]["order"] for one in (name, "qr")]
        assert sorted(orders[0]) == sorted(orders[1])
        row = summary["validation"][name][3]
        assert row["n"] == 4
        assert {"estimation", "validation"} <= set(row["torque_error"])
        assert {"estimation", "validation"} <= set(row["acceleration_error"])
        assert set(row["operations"]) == {"inverse", "direct"}
    for model in ("", "base_", "selected_"):
        for rule in ("", "_plain", "_paper_rule"):
            assert f"{model}operations_inverse{rule}" in summary["full"]


def test_summary_agrees_with_the_samples(summary, two_link_results):
    """The selected model's torque error, recomputed from the samples alone."""
    with h5py.File(two_link_results / "samples.h5") as file:
        names = [name.decode() for name in file["parameters/names"]]
        weights = file["nominal_torque"][:]
        for which in ("estimation", "validation"):
            W, tau = file[f"{which}/W"][:], file[f"{which}/tau"][:]
            phi = np.array([summary["selected"]["parameters"].get(name, 0.0) for name in names])
            left = (tau - (W @ phi).reshape(tau.shape)) / weights
            expected = np.linalg.norm(left) / np.linalg.norm(tau / weights)
            assert summary["selected"]["torque_error"][which] == pytest.approx(expected, rel=1e-9)


def test_errors_joint_by_joint_are_those_of_the_samples(summary, two_link_results):
    path = two_link_results / "report" / "tables" / "joint-errors.csv"
    header, *rows = csv.reader(io.StringIO(path.read_text()))
    assert header == ["joint", "estimation", "estimation, share", "validation", "validation, share",
                      "test", "test, share"]  # fmt: skip
    with h5py.File(two_link_results / "samples.h5") as file:
        names = [name.decode() for name in file["parameters/names"]]
        phi = np.array([summary["selected"]["parameters"].get(name, 0.0) for name in names])
        for k, which in enumerate(("estimation", "validation", "test")):
            tau = file[f"{which}/tau"][:]
            left = tau - (file[f"{which}/W"][:] @ phi).reshape(tau.shape)
            rms = np.sqrt(np.mean(left**2, axis=0))
            shares = rms / np.sqrt(np.mean(tau**2, axis=0))
            for row, error, relative in zip(rows, rms, shares, strict=True):
                assert row[1 + 2 * k] == f"{error:.2g} N m"
                assert row[2 + 2 * k] == format_percent(relative)


def test_latex_escapes_what_latex_would_trip_over():
    table = Table("κ & 5 %", ("a_b", "m_3"), (("50 %", "ε_τ"), ("x^2", "my_name")))
    text = format_latex_table(table, {"m_3": r"m_{\mathrm{3}}"})
    for piece in (r"$\kappa$ \& 5 \%", r"$m_{\mathrm{3}}$", r"a\_b", r"50 \%",
                  r"$\varepsilon_\tau$", r"x\^{}2"):  # fmt: skip
        assert piece in text


def test_latex_sets_numbers_breaks_texts_and_fits_the_line():
    long = "a + " * 30
    rows = (("1", "-0.25", "1e-7", "50 %", long), ("23", "4", "2.5e+11", "> 1000 %", "[M | δ]"))
    lines = format_latex_table(Table("t", ("a", "b", "c", "d", "e"), rows)).splitlines()
    (columns,) = (line for line in lines if line.startswith(r"\begin{tabular}"))
    assert columns.startswith(
        r"\begin{tabular}{S[table-format=2]S[table-format=-1.2]S[table-format=1.1e-2]r>{\raggedright"
    )
    assert lines[-4] == r"23 & 4 & 2.5e+11 & $>$ 1000 \% & {[}M $|$ $\delta$] \\"
    many = tuple((str(k), "x" * 20) * 6 for k in range(60))
    turned = format_latex_table(Table("t", ("a", "b") * 6, many)).splitlines()
    assert turned[1] == r"\begin{landscape}"
    assert r"\begin{longtable}" in turned[2]
    scaled = format_latex_table(Table("t", ("a", "b") * 3, tuple(row[:6] for row in many[:3])))
    assert r"\resizebox{\linewidth}" in scaled
    assert r"\begin{table}" in scaled
    assert r"\begin{sidewaystable}" in format_latex_table(Table("t", ("a", "b") * 6, many[:3]))


def typeset(folder):
    """What pdflatex says of all tables in one document."""
    needed = ("siunitx.sty", "longtable.sty", "pdflscape.sty", "rotating.sty")
    if shutil.which("pdflatex") is None or not all(
        subprocess.run(["kpsewhich", name], capture_output=True, check=False).stdout
        for name in needed
    ):
        pytest.skip("there is no LaTeX with siunitx")
    packages = "amsmath,array,graphicx,longtable,pdflscape,rotating,siunitx"
    lines = [r"\documentclass{article}", rf"\usepackage{{{packages}}}", r"\begin{document}"]
    for path in sorted((folder / "tables").glob("*.tex")):
        lines += [rf"\typeout{{TABLE {path.name}}}", path.read_text(), r"\clearpage"]
    return "\n".join([*lines, r"\end{document}"])


def test_latex_tables_fit_the_page(folder, tmp_path):
    (tmp_path / "all.tex").write_text(typeset(folder))
    words = ["pdflatex", "-interaction=nonstopmode", "all.tex"]
    for _ in range(2):  # widths of longtables are those of the run before
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, check=False)
    said = done.stdout.decode("latin1")
    assert "TABLE pareto-front.tex" in said
    assert not re.findall(r"^!.*", said, re.MULTILINE)
    assert not re.findall(r"Overfull \\hbox \((?:[1-9]\d+|[2-9])\.\d+pt too wide.*", said)


def test_warnings_of_a_run_stand_on_its_page(tmp_path):
    """Those of the config, and those of a stage that is not run again."""
    heavy = "parameter_sets.slender_rods.fore.inertia_com=[1e-3, 0, 0, 0.0135, 0, 0.1]"
    for again in ("report.title=One", "report.title=Two"):
        run_stages(tmp_path, heavy, "reduction.best_subset.time_limit=0", again,
                   "reduction.heuristics=[swap, best-subset]", "selected.heuristic=swap")  # fmt: skip
    page = (tmp_path / "report" / "index.html").read_text()
    (listed,) = re.findall(r'<div id="warnings">.*?</div>', page, re.DOTALL)
    assert "<code>config</code>: the inertia of body fore is not physical" in listed
    assert "<code>reduce</code>: best-subset: " in listed
    assert f"{listed.count('<li>')} warnings</a> from the run" in page


def test_headings_are_explained_where_they_stand(folder):
    page = (folder / "index.html").read_text()
    (pareto,) = re.findall(
        r'id="table-pareto-front".*?<p class="symbols">(.*?)</p>', page, re.DOTALL
    )
    assert (
        "<b>operations inverse</b> sums, products and function calls of the inverse dynamics;"
        in pareto
    )
    (geometry,) = re.findall(
        r'id="table-kinematics".*?<p class="symbols">(.*?)</p>', page, re.DOTALL
    )
    assert "operations" not in geometry


def test_drives_have_a_table_of_their_own(tmp_path):
    drives = [
        "drives.z_upper={viscous: 0.5, coulomb: 1, smoothing: 0.1}",
        "drives.both={motion: {z_upper: 1, z_fore: -2}, inertia: 0.01, stiffness: 3, rest: 0.2}",
    ]
    run_stages(tmp_path, *drives)
    table = (tmp_path / "report" / "tables" / "drives.csv").read_text()
    assert table.split("\n")[1:3] == [
        "z_upper,z_upper,,0.5 N m s/rad,1 N m,,,tanh(v / 0.1),",
        "both,z_upper - 2 z_fore,0.01 kg m²,,,,3 N m/rad,,0.2 rad",
    ]
    page = (tmp_path / "report" / "index.html").read_text()
    assert "Rotors, friction and springs" in page
    bodies = (tmp_path / "report" / "tables" / "dynamic-parameters.csv").read_text()
    assert bodies.split("\n")[0] == "body,m,mx,my,mz,Ixx,Ixy,Ixz,Iyy,Iyz,Izz"
