"""Which functions of the library each test enters, for `benchmarks.mutations`.

    python benchmarks/entered.py FILE [pytest's words]     # within the tree whose tests run

What is compiled, and what other processes run, is not seen. What fixtures do counts for the test
that first asks for them.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest


class Entered:
    """Notes each test's functions, as ``path:qualified name``, and its seconds."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.codes = folder, set[CodeType]()
        self.names: dict[CodeType, str] = {}
        self.tests: dict[str, dict[str, Any]] = {}

    def __call__(self, frame: FrameType, _event: str, _argument: object) -> None:
        """Note a function that begins; its lines are not followed."""
        self.codes.add(frame.f_code)

    def name(self, code: CodeType) -> str:
        """The outermost function that a piece of code belongs to."""
        if code not in self.names:
            path, name = Path(code.co_filename), code.co_qualname.split(".<")[0]
            ours = path.is_relative_to(self.folder / "src") and code.co_name != "<module>"
            place = path.relative_to(self.folder).as_posix() if ours else ""
            self.names[code] = f"{place}:{name}" if ours else ""
        return self.names[code]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Follow one test with its fixtures."""
        self.codes.clear()
        began = time.monotonic()
        threading.settrace(self)
        sys.settrace(self)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            threading.settrace(None)  # type: ignore[arg-type]
            seconds = round(time.monotonic() - began, 3)
            names = {self.name(code) for code in list(self.codes)} - {""}
            self.tests[item.nodeid] = {"seconds": seconds, "functions": sorted(names)}


if __name__ == "__main__":
    del sys.path[0]  # This folder's modules are no packages of their own.
    entered = Entered(Path.cwd())
    pytest.main([*sys.argv[2:], "-q", "-p", "no:cacheprovider", "--tb=no"], plugins=[entered])
    Path(sys.argv[1]).write_text(json.dumps(entered.tests), encoding="utf-8")
