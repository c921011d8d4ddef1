"""What the page says of its run in words."""

import dataclasses
import html
import itertools
import json
import re
import types

import h5py
import numpy as np
import pytest
from conftest import CONFIGS, TWO_LINK

from paramreduce_cli.cli.commands.run import run
from paramreduce_cli.records import Block, Estimate
from paramreduce_cli.report.data import find_first_motion
from paramreduce_cli.texts import format_percent


def paragraph(results):
    page = (results / "report" / "index.html").read_text()
    return html.unescape(re.search(r'id="paper".*?</p>\s*<p>(.*?)</p>', page, re.DOTALL)[1])


def test_methods_tell_of_trajectories(two_link_results, summary):
    text = paragraph(two_link_results)
    assert "(2 degrees of freedom) is linear in its 20 standard dynamic parameters" in text
    assert "2 estimation, 1 validation and 4 test trajectories" in text
    assert "within limits of position, velocity, were" in text  # and of no acceleration
    assert "over its nominal torque" in text
    assert "swap, best-subset" in text
    assert f"takes {summary['selected']['operations']['inverse']} operations" in text
    page = (two_link_results / "report" / "index.html").read_text()
    for key in set(re.findall(r"\[([A-Z][a-z]+\d{4})\]", text)):
        assert re.search(rf"@\w+{{{key},", page)


def test_methods_tell_of_a_log(measured_results):
    results = measured_results / "results"
    text = paragraph(results)
    with h5py.File(results / "log.h5") as file:
        recorded, cutoff = file["recorded_rate"][()], file["torque_cutoff"][()]
    assert f"recorded at {recorded:.4g} Hz" in text
    assert ("taken as recorded" in text) != bool(np.isfinite(cutoff))
    assert "Fourier series" not in text
    summary = json.loads((results / "report" / "summary.json").read_text())
    found = summary["identification"]
    assert "identified from the measured torques by least squares weighted by the noise" in text
    unexplained = (
        f"{format_percent(found['reduced']['held_out'])} of the torques held out stay unexplained"
    )
    assert (
        f"{unexplained}, {format_percent(found['full']['held_out'])} with all base parameters"
        in text
    )
    for term in summary["terms"]:
        assert f"Terms of the {term['function']} dynamics" in text
        assert f": {term['operations']} operations instead of" in text


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A cart whose pole carries no torque, from simulated motions."""
    folder = tmp_path_factory.mktemp("cart")
    words = [str(CONFIGS / "cart_pole.yaml"), "--results", str(folder), "--quiet", "--set", "report.formats=[svg]",
             "--set", "validation.stability=false"]  # fmt: skip
    run.main(words, standalone_mode=False)
    return folder


def test_a_joint_without_torque_has_an_error_all_the_same(simulated):
    """By definition, from samples and summary."""
    selected = json.loads((simulated / "report" / "summary.json").read_text())["selected"]
    with h5py.File(simulated / "samples.h5") as file:
        names = [name.decode() for name in file["parameters/names"]]
        W, tau = file["test/W"][:], file["test/tau"][:]
        nominal = file["nominal_torque"][:]
    phi = np.array([selected["parameters"].get(name, 0.0) for name in names])
    errors = np.sqrt((((W @ phi).reshape(tau.shape) - tau) ** 2).mean(axis=0))
    assert np.abs(tau[:, 1]).max() < 1e-9 < errors[1]
    worst = int(np.argmax(errors / nominal))
    page = (simulated / "report" / "index.html").read_text()
    said = re.search(r"RMS of the worst joint, (\w+): (\S+) of", page)
    assert said[1] == ("s", "theta")[worst]
    assert float(said[2]) == pytest.approx(errors[worst], rel=0.06)
    assert "simulated motions" in paragraph(simulated)


def test_values_of_the_same_fit_are_told_by_their_deviations():
    values, deviations = np.array([1.0, 2.0]), np.array([0.1, 1e-12])
    estimate = types.SimpleNamespace(names=("a", "b"), values=values, deviations=deviations)

    def found(others):
        model = types.SimpleNamespace(names=("b", "a"), values=np.array(others))
        return Estimate.find_deviations(estimate, model)

    assert found([2.0, 1.0]) == {"a": 0.1, "b": 1e-12}
    assert found([2.0001, 1.004])  # far less than a deviation, or round-off
    assert not found([2.0, 1.02])
    assert not found([2.01, 1.0])


@pytest.mark.parametrize("sizes", [[7], [100] * 37, [999, 1, 3000]])
def test_a_motion_is_shown_from_its_beginning_to_its_end(sizes):
    """However long it is, with torques as they are, evenly thinned."""
    rng = np.random.default_rng(0)
    total = sum(sizes)
    states = {
        name: rng.normal(size=(total, 2)) for name in ("z", "dz", "ddz", "tau", "q", "dq", "ddq")
    }
    W, phi = rng.normal(size=(total, 2, 3)), rng.normal(size=3)
    edges = np.cumsum([0, *sizes])
    blocks = [
        Block(
            0,
            np.arange(a, b) * 0.1,
            **{k: v[a:b] for k, v in states.items()},
            W=W[a:b].reshape(-1, 3),
        )
        for a, b in itertools.pairwise(edges)
    ]
    later = dataclasses.replace(blocks[0], trajectory=1)
    shown = find_first_motion([*blocks, later], types.SimpleNamespace(standard=phi), most=100)
    every = round(shown.time[1] / 0.1) if total > 1 else 1
    np.testing.assert_allclose(shown.time, np.arange(0, total, every) * 0.1, atol=1e-9)
    assert shown.time.size <= 200
    assert shown.time.size > 100 or every == 1
    np.testing.assert_array_equal(shown.full, states["tau"][::every])
    np.testing.assert_allclose(shown.reduced, W[::every] @ phi)


@pytest.mark.parametrize(
    ("n", "accept", "headline"),
    [(1, "{}", "Good for feed-forward; do not simulate with it."),
     (1, "{torque_error_test: 1e-9}", "Not accepted."),
     (4, "{}", "")],
)  # fmt: skip
def test_the_verdict_begins_with_what_the_model_is_good_for(
    invoke, two_link_copy, n, accept, headline
):
    settings = [f"selected.n={n}", f"validation.accept={accept}", "report.formats=[svg]"]
    common = (TWO_LINK, "--results", two_link_copy)
    invoke("validate", *common, settings=settings, code=int(headline == "Not accepted."))
    invoke("report", *common, settings=settings)
    page = (two_link_copy / "report" / "index.html").read_text()
    verdict = re.search(r'<p class="verdict[^>]*>(<b>.*?</b>)?', page)[1] or ""
    assert verdict == (f"<b>{headline}</b>" if headline else "")
