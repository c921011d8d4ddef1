"""For the site: what lies outside the folder of the docs is named, not linked."""

import re


def on_page_markdown(markdown, **_):
    """Links such as ../configs/x.yaml work in the repository alone."""
    return re.sub(r"\[([^\]]+)\]\(\.\./[^)]+\)", r"\1", markdown)
