"""What the default campaign costs: planned, run from nothing, and planned again.

A clock of a busy machine says nothing: two free cores take a little more than half of the CPU
seconds, since the jobs are spread over both.
"""

from __future__ import annotations

import os
import tempfile

from benchmarks.scale import ROOT, cost


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as results:
        where = ("--", "--nolock", "--config", f"results={results}")
        for what, words in (("plan", ["-n"]), ("run", []), ("plan when done", ["-n"])):
            spent = cost(ROOT, "--cores", "2", *words, *where)
            print(
                f"{what}: {spent.cpu_s:.1f} s of CPU, {spent.clock_s:.0f} s by the clock at load"
                f" {os.getloadavg()[0]:.0f}, {spent.memory_mb:.0f} MB in the largest process"
            )


if __name__ == "__main__":
    main()
