"""Answer the items of a set, and score the answers."""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.apparatus.draw import Item, draw
from benchmarks.apparatus.scores import line, table
from benchmarks.null_families import ROOT, code_digest


def truth_of(item: Item) -> dict[str, Any]:
    """All that was put into an item, as JSON takes it."""
    listed = ("number", "part", "apparatus", "noise", "present", "hidden", "outside")
    truth = {key: getattr(item, key) for key in listed}
    return truth | {"near": sorted(item.near), "allowed": sorted(item.allowed)}


def answer(name: str, number: int) -> dict[str, Any]:
    """Make an item, hand the library its file, and keep what is needed of the answer."""
    import pendpipe as pp

    item = draw(name, number)
    kept: dict[str, Any] = {"set": name, "number": number, "truth": truth_of(item), "effects": []}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}-{number:04d}.csv"
        item.write(path)
        before = time.process_time()
        try:
            content = pp.diagnose(pp.read(path)).to_dict()
        except Exception as error:
            spent = time.process_time() - before
            return kept | {"verdict": "failed", "reason": repr(error), "cpu_s": spent}
    kept |= {"verdict": content["verdict"], "cpu_s": time.process_time() - before}
    if content["verdict"] == "not-analysable":
        return kept | {"reason": content["reason"]}
    effects = [
        (each["id"], each["probability"], [other["id"] for other in each["indistinguishable_from"]])
        for each in content["effects"]
        if not each["presumed"]
    ]
    presumed = [each["id"] for each in content["effects"] if each["presumed"]]
    over = float(content["improved"]["chi2_per_dof"]) ** 0.5
    kept |= {"effects": effects, "presumed": presumed}
    return kept | {"p_value": content["p_value"], "over_noise": over}


def digest() -> str:
    """Of the library and of the generator."""
    found = hashlib.sha256(code_digest().encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if path.name != "scores.py":
            found.update(path.read_bytes())
    return found.hexdigest()[:12]


def main() -> None:
    """Answer what has not been answered yet by this code, and print the scores."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--set", default="trial", help="name of the set, its seed")
    parser.add_argument("--number", type=int, default=60, help="items")
    parser.add_argument("--journal", type=Path, default=ROOT / ".evidence/apparatus.jsonl")
    parser.add_argument("--processes", type=int, choices=(1, 2), default=1)
    parser.add_argument("--list", action="store_true", help="print each item")
    parser.add_argument("--export", type=Path, metavar="DIR", help="only write files and truths")
    arguments = parser.parse_args()
    name, code = arguments.set, digest()
    if arguments.export:
        arguments.export.mkdir(parents=True, exist_ok=True)
        for number in range(arguments.number):
            item, path = draw(name, number), arguments.export / f"{name}-{number:04d}.csv"
            item.write(path)
            path.with_suffix(".json").write_text(json.dumps(truth_of(item)), encoding="utf-8")
        return
    known = {}
    arguments.journal.parent.mkdir(parents=True, exist_ok=True)
    if arguments.journal.exists():
        for text in arguments.journal.read_text("utf-8").splitlines():
            kept = json.loads(text) if text.endswith("}") else {}
            if kept.get("code") == code and kept["set"] == name:
                known[kept["number"]] = kept
    left = [number for number in range(arguments.number) if number not in known]
    ask = partial(answer, name)
    with (
        arguments.journal.open("a", encoding="utf-8") as stream,
        ProcessPoolExecutor(arguments.processes) as pool,
    ):
        for kept in pool.map(ask, left):
            stream.write(json.dumps(kept | {"code": code}) + "\n")
            stream.flush()
            known[kept["number"]] = kept
    answered = [json.loads(json.dumps(known[number])) for number in range(arguments.number)]
    if arguments.list:
        print(
            "| item | apparatus | there | answer | wrong | over noise | CPU s |",
            "|---" * 7 + "|",
            sep="\n",
        )
        print("\n".join(map(line, answered)), "", sep="\n")
    print(table(answered))


if __name__ == "__main__":
    main()
