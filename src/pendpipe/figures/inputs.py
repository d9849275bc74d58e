"""Read what the stages have written for the figures and the page; a fault is one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pendpipe.errors import InputError


def read_content(path: Path, remedy: str = "run the campaign first") -> dict[str, Any]:
    """Read a JSON file that holds an object.

    Raises
    ------
    InputError
        If there is no such file, or it holds something else.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(path, "there is no such file", remedy) from None
    except (UnicodeDecodeError, json.JSONDecodeError) as fault:
        raise InputError(path, f"this is no JSON ({fault})", "make it again") from None
    if not isinstance(content, dict):
        raise InputError(path, "this is no JSON object", "make it again")
    return content


def read_comparison(path: Path) -> dict[str, Any]:
    """Read comparison.json."""
    content = read_content(path, "run pendpipe compare first")
    if "records" not in content:
        raise InputError(path, "it has no records", "make it again with pendpipe compare")
    return content


def results_folder(configuration: dict[str, Any]) -> Path:
    """The folder of a campaign's results: a folder a record lies in it."""
    return Path(str(configuration.get("results") or "results"))
