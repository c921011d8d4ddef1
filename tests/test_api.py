"""What Python users are answered."""

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
