import numpy as np
import pytest

from paramreduce_cli.excitation.symmetry import complete_series, generate_group

NAMES = ["s_1", "s_2", "s_3", "s_4", "s_5", "s_6"]
TURN = ["s_5", "s_6", "s_1", "s_2", "s_3", "s_4"]
MIRROR = ["s_2", "s_1", "s_6", "s_5", "s_4", "s_3"]


@pytest.mark.parametrize(
    ("given", "order"), [([], 1), ([TURN], 3), ([MIRROR], 2), ([TURN, MIRROR], 6)]
)
def test_the_whole_group_is_found(given, order):
    found = generate_group(given, NAMES)
    assert len(found) == order
    assert len(set(found)) == order
    assert all(a.compose(b) in found for a in found for b in found)


def test_signs_multiply():
    found = generate_group([["-b", "a"]], ["a", "b"])  # a quarter turn of the plane
    assert len(found) == 4
    series = np.array([[1.0, 2.0], [10.0, 20.0]])
    images = [image.tolist() for image in complete_series([series], found)]
    assert images[0] == series.tolist()
    assert [[-10.0, -20.0], [1.0, 2.0]] in images
    assert (-series).tolist() in images


def test_a_completed_set_is_its_own_image():
    rng = np.random.default_rng(0)
    group = generate_group([TURN, MIRROR], NAMES)
    whole = complete_series([rng.normal(size=(6, 5)) for _ in range(2)], group)
    assert len(whole) == 12
    for element in group:
        for series in whole:
            image = element.map_series(series)
            assert any(np.array_equal(image, other) for other in whole)
