"""Where a model and a recording differ, and what was left out.

>>> from pendpipe.diagnose import diagnose_recording
>>> from pendpipe.formats import read
>>> outcome = diagnose_recording(read("run7.csv"))      # doctest: +SKIP
>>> print(outcome.diagnosis.statement)                  # doctest: +SKIP
>>> outcome.diagnosis.as_json()["effects"][0]["id"]     # doctest: +SKIP
'circular-error'

``outcome.diagnosis`` is what ``pendpipe diagnose`` writes as ``diagnosis.json``; ``search``
and ``beginning`` hold the fits and readings behind it. Nothing is imported before it is
used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pendpipe.diagnose.result import Diagnosis
    from pendpipe.diagnose.run import Outcome, diagnose_decay, diagnose_recording

__all__ = ["Diagnosis", "Outcome", "Progress", "diagnose_decay", "diagnose_recording", "silent"]

Progress = Callable[[str], None]
"""Receives one line for each step of a diagnosis."""


def silent(line: str) -> None:
    """Print nothing."""


def __getattr__(name: str) -> Any:
    """Import what is asked for."""
    if name not in __all__:
        raise AttributeError(f"module 'pendpipe.diagnose' has no attribute {name!r}")
    import importlib

    place = "result" if name == "Diagnosis" else "run"
    return getattr(importlib.import_module(f"pendpipe.diagnose.{place}"), name)
