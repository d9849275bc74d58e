"""`make bench`, `evidence` and `integrity`: the benchmarks by what they ask, one after the other.

    python -m benchmarks [speed|judge|robustness] ...

Each is callable by its own name (`python -m benchmarks.NAME --help`). The status is 1 where one of
them missed what is asked of it.
"""

from __future__ import annotations

import subprocess
import sys

GROUPS = {
    "speed": ("speed --campaign",),
    "judge": (
        *("consistency", "null_families --number 15", "known_physics", "campaign_challenge"),
        *("apparatus", "acquisition faults"),
    ),
    "robustness": ("acquisition flips kill disk", "kills", "hostile", "fuzz"),
}


def main() -> int:
    """Run the groups that are named; speed without a name."""
    failed = []
    for name in [each for group in sys.argv[1:] or ["speed"] for each in GROUPS[group]]:
        print(f"\n## {name}\n", flush=True)
        module, *words = name.split()
        call = [sys.executable, "-m", f"benchmarks.{module}", *words]
        if subprocess.run(call, check=False).returncode:
            failed.append(name)
    print(f"\nmissed: {', '.join(failed) or 'none'}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
