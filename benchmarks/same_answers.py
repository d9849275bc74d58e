"""Compare the answers of two versions of the code.

    python -m benchmarks.same_answers --code CHECKOUT --out old.json   answers of another checkout
    python -m benchmarks.same_answers --out new.json --against old.json

`pendpipe fit` and `pendpipe diagnose` answer every recording of
``benchmarks/shared_recordings.tsv`` and the items of a challenge set (``--set FOLDER``, made by
``pendpipe challenge make``). Answers that stand in OUT already are kept, so an interrupted run
goes on. The comparison prints each difference: exit status, verdict, names, class, and values
that moved by more than 0.1 of their errors.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
TOLERANCE = 0.1
"""Of the standard deviation of the answer before."""
LONGEST_S = 600


def sources(challenge_set: Path | None) -> Iterator[tuple[str, Path]]:
    """Each recording with a name that stays the same on another machine."""
    table = ROOT / "benchmarks" / "shared_recordings.tsv"
    rows = [line for line in table.read_text().splitlines() if not line.startswith("#")]
    for row in csv.DictReader(rows, delimiter="\t"):
        path = (ROOT / row["source"]).resolve()
        if path.exists():
            yield row["record"], path
    if challenge_set:
        for path in sorted(challenge_set.glob("**/item-*.csv")):
            yield path.stem, path


def answer(code: Path, path: Path) -> dict[str, Any]:
    """Run both commands on one recording by the code of a checkout."""
    environment = os.environ | {"PYTHONPATH": str(code / "src"), "OMP_NUM_THREADS": "1"}
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        commands = {
            "fit": ["fit", str(path), "--out", str(out / "fit.json")],
            "diagnose": ["diagnose", str(path), "--out", folder, "--figures", "none"],
        }
        for name, words in commands.items():
            command = [sys.executable, "-m", "pendpipe.cli", *words]
            try:
                done = subprocess.run(
                    command, env=environment, capture_output=True, timeout=LONGEST_S, check=False
                )
                found[f"{name} status"] = done.returncode
            except subprocess.TimeoutExpired:
                found[f"{name} status"] = "too long"
        for name in ("fit", "diagnosis"):
            made = out / f"{name}.json"
            if made.exists():
                found[name] = json.loads(made.read_text())
    return summary(found)


def summary(found: dict[str, Any]) -> dict[str, Any]:
    """Keep what is compared."""
    kept = {name: value for name, value in found.items() if name.endswith("status")}
    fit, diagnosis = found.get("fit"), found.get("diagnosis")
    if fit:
        kept["fit"] = values(fit["parameters"])
    if diagnosis:
        kept["verdict"] = diagnosis["verdict"]
        kept["effects"] = [
            {
                "id": effect["id"],
                "class": sorted(rival["id"] for rival in effect["indistinguishable_from"]),
                "values": values(effect["parameters"]),
            }
            for effect in diagnosis.get("effects", [])
        ]
        improved = diagnosis.get("improved") or {}
        kept["improved"] = values(improved.get("parameters") or {})
    return kept


def values(parameters: dict[str, Any]) -> dict[str, list[float | None]]:
    """Value and standard deviation of each parameter."""
    return {name: [entry["value"], entry["sd"]] for name, entry in parameters.items()}


def differences(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """What two answers to one recording do not share."""
    found = [
        f"{key}: {old.get(key)} -> {new.get(key)}"
        for key in ("fit status", "diagnose status", "verdict")
        if old.get(key) != new.get(key)
    ]
    names = [[(e["id"], e["class"]) for e in side.get("effects", [])] for side in (old, new)]
    if names[0] != names[1]:
        found.append(f"effects: {names[0]} -> {names[1]}")
        return found
    for key in ("fit", "improved"):
        found += moved(key, old.get(key) or {}, new.get(key) or {})
    for one, other in zip(old.get("effects", []), new.get("effects", []), strict=True):
        found += moved(one["id"], one["values"], other["values"])
    return found


def moved(name: str, old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Values that moved by more than `TOLERANCE` of their errors."""
    found = [] if old.keys() == new.keys() else [f"{name}: other parameters"]
    for key in old.keys() & new.keys():
        (before, sd), (after, _) = old[key], new[key]
        if None in (before, after):
            if before is not after:
                found.append(f"{name}.{key}: {before} -> {after}")
        elif abs(after - before) > TOLERANCE * (sd or 0.0) + 1e-12 * abs(before):
            found.append(f"{name}.{key}: {before:.6g} -> {after:.6g} (sd {sd:.2g})")
    return found


def main() -> None:
    """Answer, keep, and compare where something to compare with is given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--code", type=Path, default=ROOT, help="the checkout that answers")
    parser.add_argument("--out", type=Path, required=True, help="answers, a JSON")
    parser.add_argument("--set", type=Path, help="folder of a challenge set")
    parser.add_argument("--against", type=Path, help="answers to compare with")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    kept = json.loads(arguments.out.read_text()) if arguments.out.exists() else {}
    missing = [entry for entry in sources(arguments.set) if entry[0] not in kept]
    with ThreadPoolExecutor(arguments.workers) as pool:
        paths = [path for _, path in missing]
        answered = pool.map(lambda path: answer(arguments.code, path), paths)
        for (name, _), found in zip(missing, answered, strict=True):
            kept[name] = found
            arguments.out.parent.mkdir(parents=True, exist_ok=True)
            arguments.out.write_text(json.dumps(kept, indent=1))
            print(f"answered {name}", file=sys.stderr, flush=True)
    if arguments.against:
        before = json.loads(arguments.against.read_text())
        shared = [name for name in before if name in kept]
        changed = {name: differences(before[name], kept[name]) for name in shared}
        for name, lines in changed.items():
            for line in lines:
                print(f"{name}: {line}")
        same = sum(not lines for lines in changed.values())
        print(f"{same} of {len(shared)} recordings have the same answers")


if __name__ == "__main__":
    main()
