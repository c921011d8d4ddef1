import numpy as np
import pytest
from simulated_logs import two_link_log

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification import filters
from paramreduce_cli.identification.data_split import UNUSED
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.identification.quality import estimate_noise_floor
from paramreduce_cli.records import RawLog, RawLogs

NAMES = ("upper", "fore")


def made(noise, **keys):
    logs = RawLogs((RawLog("log.csv", two_link_log(noise=noise), 2),), ())
    section = LogSection(files=["log.csv"], columns={"velocity": "dq{}"}, state_cutoff=10, **keys)
    return process_logs(logs, section, NAMES)


@pytest.mark.parametrize("torque_cutoff", [10, "none"])
def test_the_noise_floor_is_what_white_noise_leaves(torque_cutoff):
    """The difference of a log with noise to the same one without, low-passed alike."""
    noisy, clean = made(0.5, torque_cutoff=torque_cutoff), made(0.0, torque_cutoff=torque_cutoff)
    nominal = np.array([3.0, 0.7])
    used = noisy.training.fold != UNUSED
    taps = filters.design_low_pass(noisy.torque_cutoff, noisy.rate)
    passed = [filters.apply_filter(np.asarray(log.training.tau), taps) for log in (noisy, clean)]
    left, tau = (passed[0] - passed[1])[used], passed[0][used]
    expected = np.linalg.norm(left / nominal) / np.linalg.norm(tau / nominal)
    assert estimate_noise_floor(noisy, nominal) == pytest.approx(expected, rel=0.15)
    # What the other one has above 10 Hz is Coulomb friction.
    assert estimate_noise_floor(clean, nominal) < 0.2 * expected


def test_joints_whose_torques_are_not_measured_have_no_part_in_it():
    found = made(0.5)
    one = estimate_noise_floor(found, np.array([3.0, np.inf]))
    assert one == pytest.approx(estimate_noise_floor(found, np.array([1.0, np.inf])))
    assert one != pytest.approx(estimate_noise_floor(found, np.array([3.0, 3.0])))
