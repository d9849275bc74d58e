"""Recordings with concealed effects, made as apparatus makes them, and what is answered about them.

    python -m benchmarks.apparatus --set trial --number 60 [--list] [--journal FILE]

Encoders, cameras and converters, torsion wheels and pendulums that swing up to 2.6 rad with sin x,
of the challenge's generator: laws of the catalogue, laws out of it, faults of sensors and clocks,
each worth 100 to 100,000 of an oracle's Delta chi^2.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from statistics import median
from typing import Any, Final
from zlib import crc32

import numpy as np

from benchmarks import null_families as nulls
from benchmarks.journal import answers, judge_parser
from pendpipe_challenge.causes import log_uniform
from pendpipe_challenge.items import Item, make_item
from pendpipe_challenge.score import Solved, asked, read_item, table

PARTS: Final = {"null": 0.2, "single": 0.45, "combination": 0.15, "outside": 0.2}
"""Of a set, by what is hidden in an item beside sin x."""
SHARES: Final = {"encoder": 1 / 3, "camera": 1 / 3, "converter": 0.23, "wheel": 0.31 / 3}
"""Of a set, by the apparatus."""
EVIDENCE: Final = (100.0, 1e5)
NOISES: Final = ("white", "memory", "red", "changing", "heavy-tails", "smoothed")
"""Families of `benchmarks.null_families` that some nulls have."""
KEPT: Final = ("id", "presumed", "probability", "indistinguishable_from")
"""Of each effect of a diagnosis."""


def draw(
    name: str,
    number: int,
    parts: Mapping[str, float] = PARTS,
    shares: Mapping[str, float] = SHARES,
) -> Item:
    """The item of a set and a number, always the same."""
    rng = np.random.default_rng([crc32(name.encode()), number])
    # The parts stand evenly over the numbers; all the rest is drawn.
    place = (number * 0.6180339887498949) % 1.0
    family = list(parts)[int(np.searchsorted(np.cumsum(list(parts.values())), place, "right"))]
    apparatus = str(rng.choice(list(shares), p=list(shares.values())))
    recipe = {"family": family, "apparatus": apparatus, "least": EVIDENCE[0]}
    recipe["delta_chi2"] = [log_uniform(rng, *EVIDENCE) for _ in range(2)]
    if family != "null" or apparatus == "encoder" or rng.uniform() < 0.3:
        return make_item(recipe, rng)
    noise = nulls.FAMILIES[str(rng.choice(NOISES))]
    return make_item(recipe, rng, lambda r, seen, *told: noise(r, nulls.Swing(seen.time_s, *told)))


def answer(key: tuple[str, int]) -> dict[str, Any]:
    """Make an item, hand the library its file, and keep what is needed of the answer."""
    import pendpipe as pp

    name, number = key
    item = draw(name, number)
    kept: dict[str, Any] = {"set": name, "number": number, "truth": item.truth, "diagnosis": {}}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}-{number:04d}.csv"
        path.write_text(item.text, encoding="utf-8")
        before = time.process_time()
        try:
            content = pp.diagnose(pp.read(path)).to_dict()
        except Exception as error:
            return kept | {"failed": repr(error), "cpu_s": time.process_time() - before}
    effects = [{key: effect[key] for key in KEPT} for effect in content["effects"]]
    kept["diagnosis"] = {"verdict": content["verdict"], "effects": effects}
    return kept | {"cpu_s": time.process_time() - before}


def solved(kept: dict[str, Any]) -> Solved:
    """What the journal keeps, as the scores read it."""
    return read_item(f"{kept['number']}", kept["truth"], kept["diagnosis"])


def line(item: Solved) -> tuple[str, ...]:
    """One item's truth and answer."""
    there = "; ".join(f"{each['law']} {each['delta_chi2']:.2g}" for each in item.hidden)
    said = "; ".join(
        f"{name} {effect.get('probability') or 0:.2f} {list(others) or ''}"
        for (name, *others), effect in zip(item.classes, item.effects, strict=True)
    )
    number = f"{item.name} {item.family}"
    said = said or item.content.get("verdict", "no answer")
    return number, item.truth["apparatus"], there, said, "false" * bool(item.false)


SOURCES: Final = (
    *("src/pendpipe/**/*.py", "benchmarks/apparatus.py", "benchmarks/null_families.py"),
    "challenge/src/pendpipe_challenge/*.py",
)


def main() -> None:
    """Answer what has not been answered yet by this code, and print the scores."""
    parser = judge_parser(__doc__, "apparatus", 60)
    parser.add_argument("--set", default="trial", help="name of the set, its seed")
    parser.add_argument("--list", action="store_true", help="print each item")
    parser.add_argument("--export", type=Path, metavar="DIR", help="only write files and truths")
    arguments = parser.parse_args()
    keys = [(arguments.set, number) for number in range(arguments.number)]
    if arguments.export:
        arguments.export.mkdir(parents=True, exist_ok=True)
        for key in keys:
            item, path = draw(*key), arguments.export / f"{key[0]}-{key[1]:04d}.csv"
            path.write_text(item.text, encoding="utf-8")
            path.with_suffix(".json").write_text(json.dumps(item.truth), encoding="utf-8")
        return
    kept = list(answers(arguments, keys, answer, SOURCES))
    items = [solved(each) for each in kept]
    if arguments.list:
        print("\n".join(table("item | apparatus | there | answer | ", map(line, items))))
    print("\n".join(table("what | share (95 % interval)", asked(items))))
    cpu_s = [each["cpu_s"] for each in kept]
    print(f"| CPU s, median and largest | {median(cpu_s):.1f}, {max(cpu_s):.1f} |")


if __name__ == "__main__":
    main()
