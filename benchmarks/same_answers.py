"""Compare the answers of two versions of the code.

    python -m benchmarks.same_answers --code CHECKOUT --out old.json   answers of another checkout
    python -m benchmarks.same_answers --out new.json --against old.json

`pendpipe fit` and `pendpipe diagnose` answer every recording of
``benchmarks/shared_recordings.tsv`` and the items of a challenge set (``--set FOLDER``). Answers
that stand in OUT already are kept, so an interrupted run goes on. Printed are exit statuses,
verdicts, names and classes that differ, and values that moved by more than 0.1 of their errors.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.journal import ROOT

TOLERANCE = 0.1
"""Of the standard deviation of the answer before."""
LONGEST_S = 600


def sources(challenge_set: Path | None) -> Iterator[tuple[str, Path]]:
    """Each recording with a name that stays the same on another machine."""
    table = (ROOT / "benchmarks/shared_recordings.tsv").read_text().splitlines()
    rows = [line for line in table if not line.startswith("#")]
    for row in csv.DictReader(rows, delimiter="\t"):
        if (path := (ROOT / row["source"]).resolve()).exists():
            yield row["record"], path
    if challenge_set:
        yield from ((path.stem, path) for path in sorted(challenge_set.glob("**/item-*.csv")))


def answer(code: Path, path: Path) -> dict[str, Any]:
    """What both commands of a checkout say of one recording, a line each."""
    environment = os.environ | {"PYTHONPATH": str(code / "src"), "OMP_NUM_THREADS": "1"}
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, options in (("fit", ["--out", f"{folder}/fit.json"]), ("diagnose", ["--json"])):
            call = [sys.executable, "-m", "pendpipe.cli", name, str(path), *options]
            if name == "diagnose":
                call.append("--no-figures")
            try:
                done = subprocess.run(
                    call, env=environment, capture_output=True, timeout=LONGEST_S, check=False
                )
            except subprocess.TimeoutExpired:
                found[f"{name} status"] = "too long"
                continue
            found[f"{name} status"] = done.returncode
            made = Path(folder) / "fit.json"
            text = made.read_text() if name == "fit" and made.exists() else done.stdout
            found |= lines_of(name, json.loads(text) if text.strip()[:1] in ("{", b"{") else {})
    return found


def lines_of(name: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Verdict and names of an answer, and each value with its error."""
    effects = content.get("effects") or []
    found: dict[str, Any] = {"verdict": content["verdict"]} if "verdict" in content else {}
    found |= {
        f"effect {number}": [each["id"], sorted(r["id"] for r in each["indistinguishable_from"])]
        for number, each in enumerate(effects)
    }
    best = (content.get("improved") or content).get("parameters") or {}
    for home, parameters in ((name, best), *((e["id"], e["parameters"]) for e in effects)):
        for key, entry in parameters.items():
            found[f"{home}.{key}"] = [entry["value"], entry["sd"]]
    return found


def differs(old: Any, new: Any) -> bool:
    """Whether two lines differ, values by more than `TOLERANCE` of the error."""
    numbers = [v for v in (old, new) if isinstance(v, list) and isinstance(v[0], int | float)]
    if len(numbers) < 2:
        return bool(old != new)
    (before, sd), (after, _) = numbers
    return abs(after - before) > TOLERANCE * (sd or 0.0) + 1e-12 * abs(before)


def main() -> None:
    """Answer, keep, and compare where something to compare with is given."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--code", type=Path, default=ROOT, help="the checkout that answers")
    parser.add_argument("--out", type=Path, required=True, help="answers, a JSON")
    parser.add_argument("--set", type=Path, help="folder of a challenge set")
    parser.add_argument("--against", type=Path, help="answers to compare with")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    kept = json.loads(arguments.out.read_text()) if arguments.out.exists() else {}
    missing = [entry for entry in sources(arguments.set) if entry[0] not in kept]
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(arguments.workers) as pool:
        answered = pool.map(lambda entry: answer(arguments.code, entry[1]), missing)
        for (name, _), found in zip(missing, answered, strict=True):
            kept[name] = found
            arguments.out.write_text(json.dumps(kept, indent=1))
            print(f"answered {name}", file=sys.stderr, flush=True)
    if arguments.against:
        before, same = json.loads(arguments.against.read_text()), 0
        shared = [name for name in before if name in kept]
        for name in shared:
            old, new = before[name], kept[name]
            lines = [key for key in {**old, **new} if differs(old.get(key), new.get(key))]
            same += not lines
            for key in lines:
                print(f"{name}: {key}: {old.get(key)} -> {new.get(key)}")
        print(f"{same} of {len(shared)} recordings have the same answers")


if __name__ == "__main__":
    main()
