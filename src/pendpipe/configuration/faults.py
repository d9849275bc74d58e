"""Errors in a configuration, one line each with the nearest known name."""

import difflib
from collections.abc import Iterable
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

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
        holder = _model_at(model, path[:-1])
        known = holder.model_fields if holder else ()
        return InputError(where, f"unknown key '{path[-1]}'", nearest(path[-1], known))
    if first["type"] == "missing":
        return InputError(where, "this key is missing", "add it (see config/README.md)")
    given = first.get("input")
    problem = first["msg"][0].lower() + first["msg"][1:]
    shown = "" if isinstance(given, dict | list) else f" (it is {given!r})"
    return InputError(where, problem + shown, "see config/README.md")


def _model_at(model: type[BaseModel], path: list[str]) -> type[BaseModel] | None:
    """Follow a path of keys down to the model that holds the last one."""
    current: type[BaseModel] | None = model
    steps = list(path)
    while steps and current is not None:
        inner, is_mapping = _inner_model(current.model_fields[steps.pop(0)].annotation)
        if is_mapping and steps:
            steps.pop(0)  # the user's own name for the entry
        current = inner
    return current


def _inner_model(annotation: Any) -> tuple[type[BaseModel] | None, bool]:
    """Find the model inside ``Model``, ``Model | None`` and ``dict[str, Model]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, False
    is_mapping = get_origin(annotation) is dict
    if is_mapping or get_origin(annotation) in (Union, UnionType):
        for argument in get_args(annotation):
            found, _ = _inner_model(argument)
            if found:
                return found, is_mapping
    return None, is_mapping
