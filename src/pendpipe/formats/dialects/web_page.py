"""Tables of web pages, and of Excel's XML."""

import re
from html import unescape

from pendpipe.formats.plugin import text_dialect


def _lines(lines: list[str]) -> list[str]:
    """Make rows with tabs, by patterns that stop at the next sign."""
    text = re.sub(r"(?i)<(style|script|title)\b[^<]*", "", " ".join("\n".join(lines).split()))
    text = re.sub(r"(?i)</(tr|row) ?>|<br ?/? ?>", "\n", text)
    cells = re.sub(r"(?i)</(t[dh]|data) ?>(?! ?\n)", "\t", text)
    return unescape(re.sub(r"<[^<>]*>", "", cells)).split("\n")


WEB_PAGE = text_dialect(
    "web page",
    re.compile(
        r"\s*<(!doctype html|html|table|meta|div|\?xml[^<]*(<\?[^<]*)?<workbook)\b", re.I
    ).match,
    _lines,
)
