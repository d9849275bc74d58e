"""Pages made from a package's own templates."""

from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from pendpipe.cells import inert
from pendpipe.files import MADE_BY


def render(package: str, name: str, **content: Any) -> str:
    """Fill a template of ``<package>/templates``; what goes into HTML is escaped.

    Parameters
    ----------
    package
        Dotted name, ``"pendpipe.effects"``.
    name
        Of the template.
    content
        What the template names; nothing that it names may be missing.
    """
    template = _environment(package, name.endswith(".html")).get_template(name)
    return template.render(made_by=MADE_BY, **content)


@cache
def _environment(package: str, is_html: bool) -> Environment:
    """Kept, so that a template is compiled once for a thousand pages."""
    environment = Environment(
        loader=PackageLoader(package),
        autoescape=is_html,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not is_html,
    )
    environment.filters["inert"] = inert  # of cells: a page can be opened as a table
    return environment
