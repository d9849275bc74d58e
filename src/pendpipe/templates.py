"""Pages made from a package's own templates."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

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
    environment = Environment(
        loader=PackageLoader(package),
        autoescape=name.endswith(".html"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not name.endswith(".html"),
    )
    return environment.get_template(name).render(made_by=MADE_BY, **content)
