"""What Python users are answered."""

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
