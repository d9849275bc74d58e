"""Put a drawn SVG into the page: small, without clashes of names, and with a description."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path

from markupsafe import Markup

_DROPPED = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<!--.*?-->|<metadata>.*?</metadata>"
    r"|<style type=\"text/css\">.*?</style>",
    re.DOTALL,
)
_NAME = re.compile(r'(\bid="|url\(#|href="#)([^")]+)')
_COORDINATES = re.compile(r'( (?:d|x|y)=")([^"]*)')
_DIGITS = re.compile(r"(\d+\.\d{2})\d+")


def inline_svg(text: str, prefix: str, title: str, description: str) -> Markup:
    """Return the SVG element of a file for use inside HTML.

    Parameters
    ----------
    text
        The file's content, as matplotlib writes it.
    prefix
        Set before every identifier, so that several figures in one page do not clash.
    title, description
        What a screen reader reads out: the name, and what the figure shows.
    """
    body = _DROPPED.sub("", text)
    start = body.index("<svg")
    head, _, rest = body[start:].partition(">")
    box = re.search(r'viewBox="([^"]+)"', head)
    rest = rest.replace("xlink:href", "href")
    rest = _NAME.sub(lambda found: f"{found.group(1)}{prefix}-{found.group(2)}", rest)
    # A hundredth of a point is finer than any screen or printer.
    rest = _COORDINATES.sub(lambda found: found.group(1) + _DIGITS.sub(r"\1", found.group(2)), rest)
    name, words = f"{prefix}-title", f"{prefix}-description"
    opening = (
        f'<svg class="figure" role="img" viewBox="{escape(box.group(1) if box else "")}"'
        f' aria-labelledby="{name} {words}">'
        f'<title id="{name}">{escape(title)}</title><desc id="{words}">{escape(description)}</desc>'
    )
    return Markup(opening + rest.strip())


class Room:
    """The bytes that a page has left for figures."""

    def __init__(self, left: int) -> None:
        self.left = left

    def drawing(self, path: Path, prefix: str, title: str, description: str) -> Markup | None:
        """Return a drawn SVG as `inline_svg` does; None where there is none, or no room for it."""
        if not path.is_file():
            return None
        svg = inline_svg(path.read_text(encoding="utf-8"), prefix, title, description)
        self.left -= len(svg.encode())
        return svg if self.left > 0 else None
