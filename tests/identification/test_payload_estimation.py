"""Which parameters are fitted if a payload is identified alone."""

import numpy as np
from simulated_logs import TWO_LINK

from paramreduce_cli.config import load_config
from paramreduce_cli.identification.payload_estimation import list_payload_columns
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states

KNOWN = "drives={all: {viscous: 0.5, coulomb: 0.5}}"


def list_names(*settings, seed=0):
    """Names of the fitted parameters of the two-link arm on random states."""
    config = load_config(TWO_LINK, list(settings))
    mechanism, values = config.build_mechanism(), config.get_values()
    states = draw_states(mechanism, 100, np.random.default_rng(seed))
    W = Dynamics(mechanism, once=True).compute_regressor(*states)
    W = W.reshape(-1, W.shape[2])
    factor = np.linalg.qr(np.column_stack([W, W @ values]), mode="r")
    chosen = list_payload_columns(mechanism, values, ["tool"], factor)
    return [mechanism.parameters[k].name for k in chosen]


def test_drives_with_values_are_not_fitted():
    tool = "payloads.tool={body: fore}"
    assert list_names(KNOWN, tool) == ["m_tool", "mx_tool", "my_tool", "Izz_tool"]
    unknown = "drives={all: {viscous: 0.5, coulomb: unknown}}"
    assert list_names(unknown, tool)[4:] == ["fc_z_upper", "fc_z_fore"]


def test_first_moments_come_before_the_mass():
    """On the first link two of m, mx and Izz are independent, in a plane and beside the axis."""
    names = list_names(KNOWN, "payloads.tool={body: upper, at: [0.3, 0, 0]}")
    assert set(names) == {"mx_tool", "my_tool", "m_tool"}


def test_a_payload_without_effect_has_no_columns():
    config = load_config(TWO_LINK, [KNOWN, "payloads.tool={body: fore}"])
    mechanism = config.build_mechanism()
    factor = np.zeros((4, mechanism.n_parameters + 1))
    assert list_payload_columns(mechanism, config.get_values(), ["tool"], factor).size == 0
