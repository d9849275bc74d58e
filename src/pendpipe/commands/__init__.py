"""One module a command: its arguments, and a thin call of the library."""

from __future__ import annotations

from typing import Any


def print_json(content: Any) -> None:
    """Print one JSON object for programs; what is not finite is null."""
    import json

    from pendpipe.files import finite

    print(json.dumps(finite(content), indent=1, ensure_ascii=False))
