"""Colours stand out from what they lie on, as WCAG 2.2 asks for (AA)."""

import re
from importlib import resources
from itertools import combinations

import numpy as np
import pytest

from paramreduce_cli.report.curves import COLOURS, DARK_COLOURS

TEXT, GRAPHICS = 4.5, 3.0


def channels(colour):
    digits = colour.lstrip("#")
    digits = "".join(2 * d for d in digits) if len(digits) == 3 else digits
    return [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]


def contrast(one, other):
    """Of two colours, by their relative luminance."""

    def luminance(rgb):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb]
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def themes():
    """Colours by name, on the light and on the dark page."""
    style = resources.files("paramreduce_cli.report").joinpath("page.css").read_text("utf-8")
    light, dark = (
        dict(re.findall(r"--([a-z-]+): (#[0-9a-f]+);", block))
        for block in re.findall(r":root \{([^}]*)\}", style)
    )
    return {"light": light, "dark": dark | {k: v for k, v in light.items() if k not in dark}}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_texts_can_be_read(theme):
    colours = {name: channels(value) for name, value in themes()[theme].items()}
    for ground in ("back", "card", "good-back", "bad-back", "open-back"):
        assert contrast(colours["ink"], colours[ground]) >= TEXT
    for name in ("soft", "blue", "bad"):
        assert contrast(colours[name], colours["card"]) >= TEXT
        assert contrast(colours[name], colours["back"]) >= TEXT
    assert contrast(colours["back"], colours["blue"]) >= TEXT  # chips of kept parameters


@pytest.mark.parametrize(("theme", "colours"), [("light", COLOURS), ("dark", DARK_COLOURS)])
def test_curves_can_be_seen(theme, colours):
    card = channels(themes()[theme]["card"])
    assert all(contrast(channels(colour), card) >= GRAPHICS for colour in colours)


DEUTERANOPIA = np.array([
    [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881],
])  # fmt: skip
"""Linear RGB as deuteranopes see it [Machado2009]."""
TO_XYZ = np.array([
    [0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041],
])  # fmt: skip


def lab(colour, vision):
    """CIELAB coordinates of a colour, D65."""
    c = np.array(channels(colour))
    linear = np.clip(vision @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4), 0, 1)
    x = TO_XYZ @ linear / (0.95047, 1, 1.08883)
    f = np.where(x > 216 / 24389, np.cbrt(x), (24389 / 27 * x + 16) / 116)
    return 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])


def ciede2000(first, second):
    """Colour difference of two CIELAB colours [Sharma2005]."""
    (L1, a1, b1), (L2, a2, b2) = first, second
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    stretch = 1 + 0.5 * (1 - np.sqrt(mean**7 / (mean**7 + 25**7)))
    C1, C2 = np.hypot(stretch * a1, b1), np.hypot(stretch * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, stretch * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180
    dL, dC, dH = L2 - L1, C2 - C1, 2 * np.sqrt(C1 * C2) * np.sin(np.radians(turn) / 2)
    L, C, h = (L1 + L2) / 2, (C1 + C2) / 2, (h1 + turn / 2) % 360
    T = 1 - sum(
        w * np.cos(np.radians(k * h + s))
        for w, k, s in ((0.17, 1, -30), (-0.24, 2, 0), (-0.32, 3, 6), (0.20, 4, -63))
    )
    S_L = 1 + 0.015 * (L - 50) ** 2 / np.sqrt(20 + (L - 50) ** 2)
    S_C, S_H = 1 + 0.045 * C, 1 + 0.015 * C * T
    R = (
        -2
        * np.sqrt(C**7 / (C**7 + 25**7))
        * np.sin(np.radians(60 * np.exp(-(((h - 275) / 25) ** 2))))
    )
    return np.sqrt((dL / S_L) ** 2 + (dC / S_C) ** 2 + (dH / S_H) ** 2 + R * dC / S_C * dH / S_H)


def test_colour_differences_are_those_of_published_pairs():
    """Pairs 1, 7 and 17 of the test data of [Sharma2005]."""
    for first, second, known in (
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 0, 0), (50, -1, 2), 2.3669),
        ((50, 2.5, 0), (73, 25, -18), 27.1492),
    ):
        assert ciede2000(first, second) == pytest.approx(known, abs=1e-4)


@pytest.mark.parametrize("vision", [np.eye(3), DEUTERANOPIA], ids=["usual", "deuteranopia"])
@pytest.mark.parametrize("colours", [COLOURS, DARK_COLOURS], ids=["light", "dark"])
def test_curves_can_be_told_apart(colours, vision):
    seen = [lab(colour, vision) for colour in colours]
    assert min(ciede2000(a, b) for a, b in combinations(seen, 2)) >= 20
