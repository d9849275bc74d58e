"""Where a model and a recording differ, and what is missing.

>>> from pendpipe.diagnosis.run import diagnose_recording
>>> from pendpipe.formats import read
>>> outcome = diagnose_recording(read("examples/string-pendulum.csv"))
>>> outcome.verdict, outcome.effects[0].identifier, outcome.effects[0].presumed
('consistent', 'circular-error', True)
>>> outcome.to_dict()["effects"][0]["kind"]
'dynamics'

``print(outcome)`` gives a dozen lines. ``outcome.diagnosis`` holds the answer, ``search`` and
``beginning`` the fits and readings behind it.
"""

from collections.abc import Callable

Progress = Callable[[str], None]
"""Receives one line for each step of a diagnosis."""


def silent(line: str) -> None:
    """Print nothing."""
