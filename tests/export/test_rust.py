"""The exported Rust crate runs its self-test, and its functions beside those of the C."""

import shutil
import subprocess

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.reduction.models import make_full_model

pytestmark = pytest.mark.skipif(shutil.which("cargo") is None, reason="Rust is not installed")


def write_crate(folder, robot, what, **options):
    """Write the crate of a model into a folder, and return the exported model."""
    model = model_of(robot)
    exported = make_exported_model(model, make_full_model(model), title="x", what=what, **options)
    for name, content in languages["rust"](exported).items():
        (folder / name).write_bytes(content)
    return exported


def run_cargo(folder, *command):
    """Run cargo without a network, with warnings as errors, and return what it prints."""
    done = subprocess.run(
        ["cargo", "--offline", *command], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stderr
    return done.stdout


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize(
    ("robot", "what", "tests", "std"),
    [
        ("puma560", Exported.BOTH, 2, False),
        ("two_link", Exported.DERIVATIVES, 1, False),
        ("cart_pole", Exported.FORWARD_DYNAMICS, 1, True),  # its friction is a tanh
        ("puma560_friction", Exported.IDM, 1, False),
        ("hexaglide", Exported.BOTH, 3, False),
        ("quarter_car", Exported.IDM, 2, False),
    ],
)
def test_the_crate_passes_its_self_test(tmp_path, robot, what, tests, std, single):
    write_crate(tmp_path, robot, what, single=single)
    source = (tmp_path / f"{robot}.rs").read_text()
    assert ("#![no_std]" in source) is not std
    assert f"{tests} passed" in run_cargo(tmp_path, "test")


def test_a_wrong_result_fails_the_self_test(tmp_path):
    write_crate(tmp_path, "two_link", Exported.IDM)
    source = tmp_path / "two_link.rs"
    text = source.read_text()
    broken = text.replace("let j = turns - MAGIC;", "let j = turns - MAGIC + 1e-6;")
    assert broken != text
    source.write_text(broken)
    done = subprocess.run(
        ["cargo", "test", "--offline"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "off by" in done.stdout


def test_angles_of_any_size(tmp_path):
    """Sines of large angles lose the digits that whole turns take; beyond all numbers they are NaN."""
    write_crate(tmp_path, "two_link", Exported.GRAVITY)
    angles = [0.0, -0.0, 1e-300, 3.0, -1e4, 99999.0, 1e5, -123456.7, 1e7, float("inf"), float("nan")]  # fmt: skip
    listed = ", ".join(
        {"inf": "f64::INFINITY", "nan": "f64::NAN"}.get(repr(x), repr(x)) for x in angles
    )
    main = f"""
#[test]
fn prints() {{
    let (s, c) = sines([{listed}]);
    for k in 0..{len(angles)} {{
        println!("row {{:e}} {{:e}}", s[k], c[k]);
    }}
}}
"""
    source = tmp_path / "two_link.rs"
    source.write_text(source.read_text().replace("#![no_std]\n", "") + main)
    out = run_cargo(tmp_path, "test", "--lib", "--", "--nocapture")
    rows = [line.split()[1:] for line in out.splitlines() if line.startswith("row ")]
    got = np.array(rows, dtype=float)
    with np.errstate(invalid="ignore"):
        expected = np.column_stack([np.sin(angles), np.cos(angles)])
    assert got.shape == expected.shape
    turns = 1 + np.abs(angles) * (np.abs(angles) >= 1e5)
    for row, values, scale in zip(got, expected, turns, strict=True):
        np.testing.assert_allclose(row, values, rtol=0, atol=2e-16 * min(scale, 1e300))
