"""Where a model and a recording differ, and what is missing.

>>> from pendpipe.diagnosis import diagnose_recording
>>> from pendpipe.formats import read
>>> outcome = diagnose_recording(read("examples/string-pendulum.csv"))
>>> outcome.verdict, outcome.effects[0].identifier
('missing-physics', 'circular-error')
>>> outcome.to_dict()["effects"][0]["kind"]
'dynamics'

``print(outcome)`` gives one paragraph. ``outcome.diagnosis`` holds the answer, ``search`` and
``beginning`` the fits and readings behind it. Nothing is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pendpipe.diagnosis.result import Diagnosis
    from pendpipe.diagnosis.run import Outcome, diagnose_decay, diagnose_recording

__all__ = ["Diagnosis", "Outcome", "Progress", "diagnose_decay", "diagnose_recording", "silent"]

Progress = Callable[[str], None]
"""Receives one line for each step of a diagnosis."""


def silent(line: str) -> None:
    """Print nothing."""


def __getattr__(name: str) -> Any:
    """Import the module of a public name when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module 'pendpipe.diagnosis' has no attribute {name!r}")
    import importlib

    module = "result" if name == "Diagnosis" else "run"
    return getattr(importlib.import_module(f"pendpipe.diagnosis.{module}"), name)
