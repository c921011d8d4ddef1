"""Colours stand out from what they lie on, as WCAG 2.2 asks for (AA)."""

import re
from importlib import resources

import pytest

from paramreduce_cli.report.curves import COLOURS

TEXT, GRAPHICS = 4.5, 3.0


def lightened():
    """Share of a curve's colour on a dark page, the rest is white; as the page's script has it."""
    script = resources.files("paramreduce_cli.report").joinpath("explorer.js").read_text("utf-8")
    return int(re.search(r"color-mix\(in srgb, \$\{own\} (\d+)%, white\)", script)[1]) / 100


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


def test_curves_can_be_seen():
    card = {theme: channels(colours["card"]) for theme, colours in themes().items()}
    for colour in COLOURS:
        own = channels(colour)
        assert contrast(own, card["light"]) >= GRAPHICS
        mixed = [lightened() * c + 1 - lightened() for c in own]
        assert contrast(mixed, card["dark"]) >= GRAPHICS
