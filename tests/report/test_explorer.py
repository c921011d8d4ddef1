"""The explorer: what it carries, and what it shows in a browser."""

import base64
import gzip
import io
import json
import re
import zipfile

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest
from browser import MISSING, complaints, opened
from explored import explored

import paramreduce_cli as pr
from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.texts import format_percent

in_browser = pytest.mark.skipif(MISSING, reason="there is no Chromium with its driver")


@pytest.fixture(scope="module")
def page(two_link_results):
    return two_link_results / "report" / "index.html"


@pytest.fixture(scope="module")
def carried(page):
    """What is embedded, unpacked."""

    def unpacked(value):
        if isinstance(value, dict) and {"data", "shape", "type"} <= set(value):
            content = gzip.decompress(base64.b64decode(value["data"]))
            return np.frombuffer(content, value["type"]).reshape(value["shape"])
        if isinstance(value, dict):
            return {key: unpacked(one) for key, one in value.items()}
        return [unpacked(one) for one in value] if isinstance(value, list) else value

    text = re.search(r'id="explorer-data">(.*?)</script>', page.read_text(), re.DOTALL)[1]
    return unpacked(json.loads(text))


def test_errors_and_costs_are_those_of_the_summary(carried, summary):
    names = [name for curve in carried["curves"] for name in curve["names"]]
    assert sorted(names) == sorted(summary["validation"])
    for curve in carried["curves"]:
        for name in curve["names"]:
            for k, row in enumerate(summary["validation"][name]):
                assert curve["n"][k] == row["n"]
                for which in ("estimation", "validation"):
                    known = row["torque_error"][which]
                    assert curve["torque"][which][k] == pytest.approx(known, rel=1e-12)
                assert curve["operations"]["inverse"][k] == row["operations"]["inverse"]


def test_torques_are_those_of_the_samples(carried, summary, two_link_results):
    """The selected model's torques from what is embedded, and from samples and summary."""
    models, motion = carried["models"], carried["motion"]
    curve = next(c for c in carried["curves"] if summary["selected"]["heuristic"] in c["names"])
    k = curve["model"][curve["n"].index(summary["selected"]["n"])]
    own = slice(models["starts"][k], models["starts"][k + 1])
    embedded = motion["W"][..., models["columns"][own]] @ models["values"][own]
    with h5py.File(two_link_results / "samples.h5") as file:
        names = [name.decode() for name in file["parameters/names"]]
        step = -(-file["validation/tau"].shape[0] // len(motion["time"]))
        W, tau = file["validation/W"][:], file["validation/tau"][:]
    phi = np.array([summary["selected"]["parameters"].get(name, 0.0) for name in names])
    expected = (W @ phi).reshape(tau.shape)[::step][: len(embedded)]
    assert np.abs(embedded - expected).max() < 1e-5 * np.abs(expected).max()
    assert np.abs(motion["tau"] - tau[::step][: len(embedded)]).max() < 1e-5 * np.abs(tau).max()


def test_every_trajectory_moves(carried, two_link_results):
    """Points of the bodies' frames, by the forward kinematics of the samples."""
    figure = carried["figure"]
    model = pr.open_results(two_link_results).model
    with h5py.File(two_link_results / "samples.h5") as file:
        recorded = {
            f"{name} {int(k) + 1}": file[f"{name}/z"][file[f"{name}/trajectory"][()] == k]
            for name in ("validation", "estimation")
            for k in np.unique(file[f"{name}/trajectory"])
        }
    assert [motion["name"] for motion in figure["motions"]] == list(recorded)
    points = figure["points"] * figure["step"] + np.array(figure["low"])
    begin = 0
    for motion in figure["motions"]:
        frames = points[begin : begin + motion["frames"]]
        begin += motion["frames"]
        q = recorded[motion["name"]]
        q = q[:: -(-len(q) // motion["frames"])]
        assert len(q) == motion["frames"] >= 10
        for moving, row in zip(frames[::7], q[::7], strict=True):
            for pose in compute_body_poses(model.mechanism, row):
                off = np.linalg.norm(moving - pose[:3, 3], axis=1).min()
                assert off < 2 * figure["step"], "some point is the frame's origin"
    assert begin == len(points)


@in_browser
def test_another_motion_can_be_chosen(page, carried):
    from selenium.webdriver.support.ui import Select

    motions = carried["figure"]["motions"]
    with opened(page) as driver:
        place = driver.find_element("css selector", ".mechanism")
        select = Select(place.find_element("tag name", "select"))
        assert [option.text for option in select.options] == [m["name"] for m in motions]
        time = place.find_element("css selector", "input")
        shown = "return arguments[0].querySelector('canvas').toDataURL()"
        before = driver.execute_script(shown, place)
        for k, motion in enumerate(motions[1:], 1):
            select.select_by_index(k)
            assert int(time.get_attribute("max")) == motion["frames"] - 1
            now = driver.execute_script(shown, place)
            assert now != before
            before = now
        assert not complaints(driver)


def test_heuristics_that_found_the_same_are_one_curve(carried, summary):
    subsets = {
        name: [frozenset((one["subsets"] or [one["order"][:n] for n in one["n"]])[k]) for k in range(len(one["n"]))]
        for name, one in summary["reduction"].items()
        if name not in ("proofs", "pareto")
    }  # fmt: skip
    for curve in carried["curves"]:
        assert len({tuple(subsets[name]) for name in curve["names"]}) == 1
    assert len(carried["curves"]) < len(subsets)  # on this arm some find the same everywhere
    by_torque = {tuple(subsets[curve["names"][0]]) for curve in carried["curves"]}
    assert len(by_torque) == len(carried["curves"])


def test_the_code_is_in_the_page(page):
    content = re.search(r"data:application/zip;base64,([^\"]+)", page.read_text())[1]
    with zipfile.ZipFile(io.BytesIO(base64.b64decode(content))) as archive:
        assert {"two_link.h", "two_link.c"} <= set(archive.namelist())


@in_browser
def test_every_step_of_the_slider_shows_its_model(page, summary):
    with opened(page, place="qr:2") as driver:

        def text(part):
            return driver.find_element("css selector", f'[data-part="{part}"]').text

        rows = {row["n"]: row for row in summary["validation"]["qr"]}
        for n in (2, 3, max(rows)):
            driver.execute_script(
                "const s = document.querySelector('[data-part=n]'); s.value = arguments[0] - 1;"
                "s.dispatchEvent(new Event('input'));", n)  # fmt: skip
            error = rows[n]["torque_error"]
            assert text("count") == str(n)
            sets = ("estimation", "validation")
            expected = [*(error[which] for which in sets), error["test"]["median"]]
            for one, shown in zip(expected, text("torque").split(" / "), strict=True):
                digits = float(shown.removesuffix(" %")) / 100
                assert digits == pytest.approx(one, rel=5e-3, abs=1e-10)
            assert text("inverse") == str(rows[n]["operations"]["inverse"])
            assert text("command").endswith(f"--model qr:{n}")
            assert len(driver.find_elements("css selector", ".chip.kept")) == n
        field = driver.find_element("css selector", '[data-part="tolerance"]')
        field.send_keys("50\t")
        least = min(n for n in rows if max(rows[n]["torque_error"][s] for s in sets) <= 0.5)
        assert text("count") == str(least)
        assert driver.execute_script("return location.hash") == f"#qr:{least}"
        assert complaints(driver) == []


@in_browser
def test_every_model_is_shown_with_the_numbers_of_the_tables(page, summary):
    with opened(page) as driver:
        count, wrong = explored(driver, summary)
        assert complaints(driver) == []
    assert wrong == {}
    assert count == sum(map(len, summary["validation"].values())) > 40


@in_browser
def test_what_is_shown_can_be_saved(page):
    with opened(page) as driver:
        names = driver.execute_script(
            "return [...document.querySelectorAll('button.save')].map((b) => b.textContent)"
        )
    assert {"error-chart.png", "inverse-chart.png", "mechanism.png", "references.bib", "summary.csv",
            "errors-by-joint.csv", "torque-error.svg", "torque-z_fore.png"} <= set(names)  # fmt: skip
    assert len(names) == len(set(names))


@in_browser
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (390, True)])
def test_the_answer_comes_first_at_any_width(page, summary, width, dark):
    with opened(page, width=width, dark=dark) as driver:
        assert driver.execute_script("return document.documentElement.scrollWidth") <= width
        header = driver.find_element("id", "answer")
        selected = summary["selected"]
        assert selected["verdict"] in header.text
        assert "paramreduce export" in header.text
        assert format_percent(selected["torque_error"]["validation"]) in header.text
        assert str(selected["operations"]["inverse"]) in header.text
        assert all(name in header.text for name in selected["parameters"])
        assert width < 1000 or header.rect["y"] + header.rect["height"] < 800
        background = driver.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, re.findall(r"\d+", background)[:3])) < 200) == dark
        figure = driver.find_element("css selector", "figure")
        driver.execute_script("arguments[0].scrollIntoView()", figure)
        seen = plt.imread(io.BytesIO(figure.screenshot_as_png))[..., :3]
        assert (np.median(seen) < 0.3) == dark, "figures are on the page's own background"
        charts = driver.find_elements("css selector", ".uplot canvas")
        assert all(chart.size["width"] <= width for chart in charts)
        wide = "return [...document.querySelectorAll('.tile b')].some((b) => b.scrollWidth > b.clientWidth + 1)"
        assert not driver.execute_script(wide)
        assert len(charts) >= 3
        assert complaints(driver) == []


@in_browser
@pytest.mark.parametrize("place", ["explorer", "provenance"])
def test_an_address_with_a_section_leads_there(page, place):
    with opened(page, place=place) as driver:
        top = driver.execute_script(
            f"return document.getElementById('{place}').getBoundingClientRect().top"
        )
        end = driver.execute_script(
            "return document.documentElement.scrollHeight - innerHeight - scrollY"
        )
    assert abs(top) < 60 or end < 2
