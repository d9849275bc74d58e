"""Twelve answers, in print before a change of the library and after it.

    python -m benchmarks.twelve --save before.json    # with that library's src on PYTHONPATH
    python -m benchmarks.twelve --before before.json  # Markdown: both, answer by answer

The recordings lie in ../shared. A last line says how long the answers are.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Final

from benchmarks.journal import ROOT

SHARED: Final = ROOT.parent / "shared"
TWELVE: Final = (
    "fit recordings/jiarui-phy180/8050.txt",
    "diagnose recordings/jiarui-phy180/8050.txt",
    "diagnose recordings/profcarter-adip/adip_pend_data.mat",
    "diagnose recordings/martin8ner-pohl-eddy/1.3_100mA.csv",
    "fit recordings/kvlcc2-roll-decay/model_test_21337.csv",
    "diagnose recordings/kvlcc2-roll-decay/model_test_21337.csv",
    "fit recordings/filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv",
    "diagnose recordings/filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv",
    "diagnose recordings/kenevich-furuta-arm2/dataset4.txt",
    "diagnose inputs4/n01_softening.csv --restoring linear",
    "diagnose inputs4/n02_ellipse.csv",
    "fit inputs4/n03_gate_speeds.csv --period 1.7 --length 0.718",
)
"""Command, recording and options."""
LINES: Final = 12
WIDTH: Final = 120
"""How long an answer may be, and a line of it."""


def ask(call: str) -> str:
    """What a command prints."""
    command, path, *options = call.split()
    words = [sys.executable, "-m", "pendpipe", command, str(SHARED / path), *options]
    done = subprocess.run(words, capture_output=True, text=True, cwd=SHARED)
    return (done.stdout.strip() or done.stderr.strip()).replace(f"{SHARED}/", "")


def main() -> None:
    """Ask all; save, or print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--save", type=Path, help="the answers, as JSON")
    parser.add_argument("--before", type=Path, help="what was saved")
    told = parser.parse_args()
    answers = {call: ask(call) for call in TWELVE}
    if told.save:
        told.save.write_text(json.dumps(answers), encoding="utf-8")
    before = json.loads(told.before.read_text("utf-8")) if told.before else {}
    for call, after in answers.items():
        command, path, *options = call.split()
        print(f"\n### `pendpipe {' '.join([command, Path(path).name, *options])}`")
        for when, said in (("Before", before.get(call)), ("After", after)):
            if said is not None:
                print(f"\n{when}\n\n```\n{said}\n```")
    lines = [answer.splitlines() for answer in answers.values()]
    wide = sum(len(each) > WIDTH for answer in lines for each in answer)
    print(f"\n{sum(len(each) > LINES for each in lines)} of {len(lines)} answers have more than")
    print(f"{LINES} lines (at most {max(map(len, lines))}); {wide} lines are wider than {WIDTH}.")


if __name__ == "__main__":
    main()
