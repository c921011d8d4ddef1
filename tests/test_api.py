"""What Python users are answered."""

import dataclasses
import pydoc
from html.parser import HTMLParser

import numpy as np
import pytest
from conftest import ROOT

import paramreduce_cli as pr


def test_wrong_arguments_are_answered_with_what_is_wanted():
    with pytest.raises(TypeError, match=r"build_model takes a config, .*load_config\(path\) reads"):
        pr.build_model("configs/two_link.yaml")
    config = pr.load_config(ROOT / "configs/two_link.yaml")
    with pytest.raises(
        TypeError, match="optimize_trajectories needs a Model, which build_model makes"
    ):
        pr.optimize_trajectories(config, None)


def test_states_of_another_shape_are_refused_with_the_one_that_is_meant():
    import warnings

    from conftest import model_of

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = model_of("four_bar")
    torques = pr.inverse_dynamics(model, pr.full_model(model))
    right = np.zeros((4, 3))
    assert torques(right, right, right).shape == (4, 1)
    for wrong in (np.zeros((4, 1)), np.zeros(3), np.zeros((5, 3))):
        with pytest.raises(
            pr.ParamreduceError,
            match=r"dq has the shape .* it must be \(n_samples, 3\), a column for each of",
        ):
            torques(right, wrong, right)


def list_records(value):
    """Yield a record and all records in it."""
    if dataclasses.is_dataclass(value):
        yield value
        for field in dataclasses.fields(value):
            yield from list_records(getattr(value, field.name))
    elif isinstance(value, dict | tuple):
        for item in value.values() if isinstance(value, dict) else value:
            yield from list_records(item)


def test_texts_of_records_have_ten_lines_at_most(two_link_results):
    results = pr.open_results(two_link_results)
    records = (
        results.model,
        results.trajectories,
        results.samples,
        results.reduction,
        results.validation,
    )
    texts = {type(one).__name__: repr(one) for record in records for one in list_records(record)}
    assert len(texts) > 20
    assert all(len(text.splitlines()) <= 10 for text in texts.values())
    assert max(len(line) for text in texts.values() for line in text.splitlines()) <= 120
    assert "values=float64 array (20,)" in texts["Model"]
    assert (
        repr(pr.load_config(ROOT / "configs/two_link.yaml")) == "Config(robot='two_link', n_dof=2)"
    )


def test_unknown_names_are_answered_with_those_there_are(two_link_results):
    results = pr.open_results(two_link_results)
    with pytest.raises(KeyError, match=r"unknown name 'bset'\. Choose from: qr, .*best-subset"):
        results.validation.heuristics["bset"]
    with pytest.raises(KeyError, match=r"qr has no model with 99 parameters\. Choose from: 1, 2"):
        pr.chosen(results.reduction, "qr", 99)
    with pytest.raises(KeyError, match=r"unknown language 'fortran'\. Choose from: c, casadi"):
        pr.code(results.model, pr.base_model(results.model), "fortran")
    with pytest.raises(KeyError, match=r"unknown function 'torques'\. Choose from: idm, ddm, both"):
        pr.code(results.model, pr.base_model(results.model), what="torques")


def test_code_of_several_functions_has_a_name_of_its_own(two_link_results):
    results = pr.open_results(two_link_results)
    base = pr.base_model(results.model)
    files = pr.code(results.model, base, "python", what=["gravity", "momentum"], name="arm")
    assert set(files) == {"arm.py", "arm_test.py"}
    text = files["arm.py"].decode()
    assert text.index("def gravity(") < text.index("def momentum(")
    assert list(pr.code(results.model, base, "fmu", what="ddm")) == [
        "two_link_forward_dynamics.fmu"
    ]


def test_the_package_has_the_name_of_its_project():
    import paramreduce

    assert paramreduce is pr
    text = pydoc.plain(pydoc.render_doc(paramreduce))
    functions = text.partition("FUNCTIONS")[2]
    assert [
        name for name in pr.__all__ if name[0].islower() and f"    {name}" not in functions
    ] == []


def test_notebooks_show_the_selected_model(two_link_results):
    class Cells(HTMLParser):
        found = ()

        def handle_data(self, data):
            self.found += (data,)

    cells = Cells()
    results = pr.open_results(two_link_results)
    cells.feed(results._repr_html_())
    assert {"two_link", "torque error", *results.validation.heuristics} <= set(cells.found)
