"""The page as a picture: key states at two widths beside stored thumbnails.

Thumbnails are coarse, so that times and other fonts' edges do not count and a lost or displaced part
does. ``RENEW_SCREENS=1`` stores new ones; look at the page before.
"""

import os
import shutil
import subprocess
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from browser import MISSING, opened
from PIL import Image

SCREENS = Path(__file__).parent / "screens"
COARSE = 16
"""Pixels of the page in one of a thumbnail."""
MEAN, PART = 4.0, 0.02
"""Mean difference of 255, and share of pixels that may differ by more than a quarter of that range."""
STATES = {
    "top": ("two_link_results", {"width": 1280}),
    "top-phone-dark": ("two_link_results", {"width": 390, "dark": True}),
    "explorer": ("two_link_results", {"width": 1280, "place": "explorer"}),
    "explorer-phone": ("two_link_results", {"width": 390, "place": "explorer"}),
    "measured-top": ("measured_page", {"width": 1280}),
    "measured": ("measured_page", {"width": 1280, "place": "identification"}),
    "measured-phone-dark": (
        "measured_page",
        {"width": 390, "place": "identification", "dark": True},
    ),
}
FONT = "DejaVuSans.ttf"
"""With which the stored thumbnails were made."""


def font():
    """That stands for the page's own on this machine."""
    if shutil.which("fc-match") is None:
        return ""
    done = subprocess.run(["fc-match", "-f", "%{file}", "system-ui"], capture_output=True, text=True, check=False)  # fmt: skip
    return Path(done.stdout).name


@pytest.fixture
def measured_page(measured_results):
    """A run on a log, whose page tells what the measurements say."""
    pytest.importorskip("cvxpy")  # without it a part of the page is not there
    return measured_results / "results"


def thumbnail(picture):
    image = Image.open(BytesIO(picture)).convert("RGB")
    size = (image.width // COARSE, image.height // COARSE)
    return image.resize(size, Image.Resampling.BOX)


@pytest.mark.skipif(MISSING, reason="there is no Chromium with its driver")
@pytest.mark.skipif(font() != FONT, reason=f"the page is not set in {FONT} here")
@pytest.mark.parametrize("state", STATES)
def test_the_page_looks_as_it_did(request, state):
    results, seen_as = STATES[state]
    page = request.getfixturevalue(results) / "report" / "index.html"
    with opened(page, **seen_as) as driver:
        seen = thumbnail(driver.get_screenshot_as_png())
    path = SCREENS / f"{state}.png"
    if os.environ.get("RENEW_SCREENS"):
        seen.save(path)
    known = Image.open(path)
    assert seen.size == known.size
    difference = np.abs(np.asarray(seen, float) - np.asarray(known, float))
    assert difference.mean() < MEAN
    assert np.mean(difference.max(axis=2) > 64) < PART
