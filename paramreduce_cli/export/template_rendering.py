"""Exported files from the templates that say what is the same in all of them."""

from functools import cache
from importlib.resources import files

import jinja2


@cache
def _make_environment() -> jinja2.Environment:
    """Return the environment that loads templates and rejects unknown names in them."""

    def load(name: str) -> str:
        return (files("paramreduce_cli.export") / "templates" / name).read_text(encoding="utf-8")

    return jinja2.Environment(
        loader=jinja2.FunctionLoader(load),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def render_template(template: str, **context: object) -> str:
    """Return a file from its template, by the template's name without ``.jinja``."""
    return _make_environment().get_template(f"{template}.jinja").render(context)
