"""Two versions' answers to the same items of `benchmarks.apparatus`, side by side.

    python -m benchmarks.apparatus --set fresh --journal before.jsonl    # at each commit
    python -m benchmarks.beside before.jsonl after.jsonl

What differs is set beside chance by the sign test.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from statistics import median
from typing import Any, Final

from scipy.stats import binomtest

from benchmarks.apparatus.scores import rows

GOOD: Final = ("circular", "detected", "first", "a hidden", "class", "both", "outside: a curve")
"""How the rows begin in which yes is right; in the others it is wrong."""


def answers(journal: Path) -> dict[tuple[str, int], dict[str, Any]]:
    """A journal's answers by set and number."""
    kept = map(json.loads, journal.read_text("utf-8").splitlines())
    answered = (each.get("answer", each) for each in kept)
    return {(each["set"], each["number"]): each for each in answered}


def main() -> None:
    """Print the table of both journals' common items."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    arguments = parser.parse_args()
    sides = [answers(each) for each in (arguments.before, arguments.after)]
    common = sorted(sides[0].keys() & sides[1].keys())
    found = [[side[key] for key in common] for side in sides]
    print(f"{len(common)} items\n\n| what | before | after | better | worse | p of worse |")
    print("|---" * 6 + "|")
    for what, olds in rows(found[0]).items():
        # Each row asks the same items of both.
        news = rows(found[1])[what]
        sign = 1 if what.startswith(GOOD) else -1
        moved = [sign * (new - old) for old, new in zip(olds, news, strict=True)]
        better, worse = moved.count(1), moved.count(-1)
        p = binomtest(worse, better + worse, alternative="greater").pvalue if any(moved) else 1.0
        cells = (f"{sum(olds)} of {len(olds)}", sum(news), better, worse, f"{p:.2g}")
        print(f"| {what} | {' | '.join(map(str, cells))} |")
    cpu = [median(each["cpu_s"] for each in side) for side in found]
    print(f"| CPU s, median | {cpu[0]:.1f} | {cpu[1]:.1f} | | | |")


if __name__ == "__main__":
    main()
