"""`make bench`, `evidence` and `integrity`: the benchmarks by what they ask, one after the other.

    python -m benchmarks speed|judge|robustness [SET ...] [--number N] ...

A group runs whole, or the sets that are named; options are those of each, so that ``--number 3``
makes a small run of all. Each is callable by its own name (`python -m benchmarks.NAME --help`). The
status is 1 where one of them missed what is asked of it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

GROUPS = {
    "speed": ("speed", "workflow"),
    "judge": (
        *("consistency", "null_families --number 15", "known_physics", "campaign_challenge"),
        *("apparatus", "numbers", "acquisition faults"),
    ),
    "robustness": ("acquisition flips", "kills", "hostile", "fuzz"),
}


def main() -> int:
    """Run a group."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("group", choices=GROUPS)
    parser.add_argument("sets", nargs="*", help="of the group; all, if none is named")
    told, options = parser.parse_known_args()
    missed = []
    for name in GROUPS[told.group]:
        module, *words = name.split()
        if told.sets and module not in told.sets:
            continue
        print(f"\n## {name}\n", flush=True)
        call = [sys.executable, "-m", f"benchmarks.{module}", *words, *options]
        if subprocess.run(call, check=False).returncode:
            missed.append(name)
    print(f"\nmissed: {', '.join(missed) or 'none'}")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
