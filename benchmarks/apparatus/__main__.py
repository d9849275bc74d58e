"""Answer the items of a set, and score the answers."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.apparatus.draw import Item, draw
from benchmarks.apparatus.scores import line, table
from benchmarks.journal import answers, judge_parser


def truth_of(item: Item) -> dict[str, Any]:
    """All that was put into an item, as JSON takes it."""
    listed = ("number", "part", "apparatus", "noise", "present", "hidden", "outside")
    truth = {key: getattr(item, key) for key in listed}
    return truth | {"near": sorted(item.near), "allowed": sorted(item.allowed)}


def answer(key: tuple[str, int]) -> dict[str, Any]:
    """Make an item, hand the library its file, and keep what is needed of the answer."""
    import pendpipe as pp

    name, number = key
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


SOURCES = (
    *("src/pendpipe/**/*.py", "benchmarks/apparatus/[cdw]*.py", "benchmarks/null_families.py"),
    "challenge/src/pendpipe_challenge/[mt]o*.py",
)


def main() -> None:
    """Answer what has not been answered yet by this code, and print the scores."""
    parser = judge_parser(__doc__, "apparatus", 60)
    parser.add_argument("--set", default="trial", help="name of the set, its seed")
    parser.add_argument("--list", action="store_true", help="print each item")
    parser.add_argument("--export", type=Path, metavar="DIR", help="only write files and truths")
    arguments = parser.parse_args()
    name = arguments.set
    keys = [(name, number) for number in range(arguments.number)]
    if arguments.export:
        arguments.export.mkdir(parents=True, exist_ok=True)
        for key in keys:
            item, path = draw(*key), arguments.export / f"{name}-{key[1]:04d}.csv"
            item.write(path)
            path.with_suffix(".json").write_text(json.dumps(truth_of(item)), encoding="utf-8")
        return
    answered = list(answers(arguments, keys, answer, SOURCES))
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
