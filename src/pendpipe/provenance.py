"""Which code made a result: another version of pendpipe makes a campaign's results anew."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent
_SOURCE: Final = {".py", ".html", ".css", ".js", ".txt", ".mplstyle"}


@cache
def code_version() -> str:
    """Hash the package's source, a parameter of every rule: twelve hexadecimal digits.

    All of it, so that no campaign holds results of two versions.
    """
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        # The version counts commits: another one is no other code.
        if path.suffix in _SOURCE and path.name != "_version.py":
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
