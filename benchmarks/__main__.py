"""`make bench`: every benchmark, one after the other; `python -m benchmarks NAME` for one."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path


def main() -> None:
    """Run those named, or all that there are: modules of this package with a ``main``."""
    here = Path(__file__).parent
    known = (
        "engine",
        "estimators",
        "workflow",
        "many_fits",
    )
    there = [name for name in known if (here / f"{name}.py").exists()]
    for name in sys.argv[1:] or there:
        print(f"\n## {name}\n", flush=True)
        importlib.import_module(f"benchmarks.{name}").main()


if __name__ == "__main__":
    main()
