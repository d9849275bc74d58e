"""Which code made a result: another version of pendpipe makes a campaign's results anew."""

from functools import cache
from pathlib import Path
from typing import Final

from pendpipe.files import digest, sha256

PACKAGE: Final = Path(__file__).parent
_SOURCE: Final = {".py", ".html", ".css", ".js", ".txt", ".mplstyle"}


@cache
def code_version() -> str:
    """Hash the package's source, a parameter of every rule: twelve hexadecimal digits.

    All of it, so that no campaign holds results of two versions.
    """
    paths = sorted(path for path in PACKAGE.rglob("*") if path.suffix in _SOURCE)
    # The version counts commits: another one is no other code.
    return digest([sha256(path) for path in paths if path.name != "_version.py"])
