"""Sines and cosines of exported C against the library's, in more digits."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.export.code_generation import make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
_MANY = 200_000


def compiled(folder, single):
    """The routine of an exported file, as a function of angles."""
    model = model_of("two_link")
    chosen, _ = find_chosen_model("full", model, None, None)
    made = languages["c"](make_exported_model(model, chosen, title="", single=single))
    (folder / "two_link.h").write_bytes(made["two_link.h"])
    source = made["two_link.c"].decode()
    source += (
        "void run(size_t m, real *x, real *sine, real *cosine);\n"
        "void run(size_t m, real *x, real *sine, real *cosine) { sines(m, x, sine, cosine); }\n"
    )
    (folder / "s.c").write_text(source)
    flags = ["-O2", "-shared", "-fPIC", "-o", "s.so", "s.c", "-lm"]
    subprocess.run(["gcc", "-std=c99", *flags], cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "s.so"))
    kind = np.float32 if single else np.float64

    def sines(x):
        x = np.ascontiguousarray(x, kind)
        found = np.empty((2, x.size), kind)
        pointer = np.ctypeslib.ndpointer(kind, flags="C_CONTIGUOUS")
        library.run.argtypes = [ctypes.c_size_t, pointer, pointer, pointer]
        library.run(x.size, x, found[0], found[1])
        return found

    return sines, kind


@pytest.mark.parametrize(
    ("single", "limit", "off"), [(False, 1e5, 1.7e-16), (True, 3e3, 1e-7)], ids=["double", "single"]
)
def test_sines_and_cosines(tmp_path, single, limit, off):
    """To less than one unit in the last place of one, up to the limit and beyond it."""
    sines, kind = compiled(tmp_path, single)
    rng = np.random.default_rng(0)
    near = np.arange(-64, 65) * (np.pi / 4)
    for x in (
        rng.uniform(-4, 4, _MANY), rng.uniform(-limit, limit, _MANY), near, np.array([0.0, -0.0]),
        np.array([10 * limit, 1.0, -1e7]),
    ):  # fmt: skip
        x = x.astype(kind)
        exact = np.longdouble(x)
        assert np.abs(sines(x) - np.array([np.sin(exact), np.cos(exact)])).max() <= off


def test_what_is_not_a_number_stays_so(tmp_path):
    sines, _ = compiled(tmp_path, single=False)
    assert np.isnan(sines(np.array([np.nan, np.inf]))).all()
