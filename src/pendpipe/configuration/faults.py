"""Errors in a configuration, one line each with the nearest known name."""

import difflib
import json
import re
from collections.abc import Iterable
from pathlib import Path

from pydantic import BaseModel, ValidationError

from pendpipe.errors import InputError


def read_text(path: Path, absent: str, remedy: str, form: str) -> str:
    """Read a file that the user has written.

    Raises
    ------
    InputError
        If there is none, or it is no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, f"there is no such {absent}", remedy) from None
    except (OSError, UnicodeDecodeError) as fault:
        reason = getattr(fault, "strerror", fault)
        raise InputError(path, f"it can't be read ({reason})", f"give {form} in UTF-8") from None


def nearest(name: str, known: Iterable[str]) -> str:
    """Say which of the known names `name` may have meant, or all of them."""
    names = sorted(known)
    without_unit = [known_name for known_name in names if name and known_name.startswith(name)]
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.6) or without_unit
    return f"did you mean '{close[0]}'?" if close else f"known are {', '.join(names) or 'none'}"


def as_input_error(place: str | Path, fault: ValidationError, model: type[BaseModel]) -> InputError:
    """Turn what pydantic found into one line: a misspelt key before the one it leaves missing."""
    first = min(fault.errors(), key=lambda entry: entry["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    where = f"{place}, {'.'.join(path) or 'top level'}"
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        return InputError(where, f"unknown key '{path[-1]}'", nearest(path[-1], known))
    if first["type"] == "missing":
        return InputError(where, "this key is missing", "add it (see config/README.md)")
    given = first.get("input")
    problem = first["msg"][0].lower() + first["msg"][1:]
    shown = "" if isinstance(given, dict | list) else f" (it is {given!r})"
    return InputError(where, problem + shown, "see config/README.md")


def _known_keys(model: type[BaseModel], path: list[str]) -> Iterable[str]:
    """The keys of the section to which a path of keys leads."""
    schema = section = model.model_json_schema()
    for key in path:
        named = re.findall(r"#/\$defs/(\w+)", json.dumps(section["properties"].get(key)))
        # (A key that is the user's own name for an entry leads no further.)
        section = schema["$defs"][named[0]] if named else section
    return list(section["properties"])
