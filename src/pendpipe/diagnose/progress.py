"""What a diagnosis says while it works: a line a step."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str], None]
"""Takes one line."""


def silent(line: str) -> None:
    """Say nothing."""
