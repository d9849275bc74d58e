"""Whether a stated 90 % is right in 90 %, and whether the intervals of named effects hold.

    python -m benchmarks.reliability [--set NAME] [--number N] [--sized N] [--journal FILE]

`pp.judge` of the recordings of `benchmarks.apparatus`, and of others in which an effect acts by the
very law of the catalogue, so that its numbers have a truth. `--answers` adds what
`benchmarks.known_physics` has found in real recordings, from its journal.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final
from zlib import crc32

import numpy as np

from benchmarks import apparatus, known_physics
from benchmarks.journal import KEPT, answers, judge_parser
from pendpipe_challenge.causes import log_uniform
from pendpipe_challenge.items import Item, make_item
from pendpipe_challenge.score import OWN_NAMES

SIZED: Final = "sized"
Key = tuple[str, str, int]


def draw(which: str, name: str, number: int) -> Item:
    """The item of a kind, a set and a number, always the same."""
    if which != SIZED:
        return apparatus.draw(name, number)
    rng = np.random.default_rng([crc32(name.encode()), crc32(SIZED.encode()), number])
    effects = list(OWN_NAMES)
    recipe: dict[str, Any] = {"family": "single", "apparatus": "converter", "own_form": True}
    recipe |= {"effects": [effects[number % len(effects)]], "least": apparatus.EVIDENCE[0]}
    recipe["delta_chi2"] = [log_uniform(rng, *apparatus.EVIDENCE)]
    return make_item(recipe, rng)


def answer(key: Key) -> dict[str, Any]:
    """Diagnose an item; the effects that were found, beside what is there."""
    import pendpipe as pp

    item = draw(*key)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.csv"
        path.write_text(item.text, encoding="utf-8")
        try:
            effects = pp.diagnose(pp.read(path)).to_dict()["effects"]
        except pp.InputError as refusal:
            return {"effects": [], "truth": {}, "refused": str(refusal)}
    return {"effects": effects, "truth": truth_of(item.truth, {each["id"] for each in effects})}


def truth_of(told: dict[str, Any], named: Collection[str] = ()) -> dict[str, dict[str, float]]:
    """What an item's truth says, as `pp.judge` takes it, of an answer that names these effects."""
    found: dict[str, dict[str, float]] = {name: {} for name in (*told["present"], *told["allowed"])}
    for effect in told["effects"]:
        found |= {name: {} for name in effect["also"]}
        own = OWN_NAMES.get(effect["effect"], {}) if effect["own_form"] else {}
        found[effect["effect"]] = {
            name: factor * effect["parameters"][parameter]
            for name, (parameter, factor) in own.items()
            if parameter in effect["parameters"]
        }
    cube = found.get("cubic-stiffness")
    if cube and "circular-error" in found and "circular-error" not in named:
        # An answer without sin x = x - x^3/6 + ... has its cube in k3.
        cube["k3"] -= 1.0 / 6.0
    return found


def of_recordings(journal: Path) -> list[dict[str, Any]]:
    """Names of real recordings that are facts of their descriptions, or known to be wrong."""
    kept = {}
    for line in journal.read_text("utf-8").splitlines() if journal.exists() else []:
        each = json.loads(line)["answer"]
        kept[each["record"]] = each
    found = []
    for row in known_physics.table():
        if row["record"] not in kept:
            continue
        cells = [*known_physics.items(row["known"]), *known_physics.items(row["by_hand"])]
        right = {name for cell in cells for name in cell.split("/")}
        judged = right | set(row["wrong"].split("/"))
        effects = kept[row["record"]]["diagnosis"].get("content", {}).get("effects", [])
        # What nobody has told of a recording is neither right nor wrong.
        effects = [each for each in effects if each["id"] in judged]
        found.append({"effects": effects, "truth": {name: {} for name in right}})
    return found


SOURCES: Final = (*apparatus.SOURCES, "benchmarks/reliability.py")


def main() -> None:
    """Answer what has not been answered yet by this code, and print both tables."""
    import pendpipe as pp

    parser = judge_parser(__doc__, "reliability", 150)
    parser.add_argument("--set", default="reliability", help="name of the set, its seed")
    parser.add_argument("--sized", type=int, default=66, metavar="N", help="with known numbers")
    parser.add_argument("--answers", type=Path, default=KEPT / "known_physics.jsonl")
    told = parser.parse_args()
    keys = [("apparatus", told.set, number) for number in range(told.number)]
    keys += [(SIZED, told.set, number) for number in range(told.sized)]
    found = list(answers(told, keys, answer, SOURCES))
    real = of_recordings(told.answers)
    parts = {
        "names by the independent generator": found[: told.number],
        "names of real recordings": real,
        "names and numbers by the catalogue's own laws": found[told.number :],
        "all": [*found, *real],
    }
    for title, each in parts.items():
        if any(item["effects"] for item in each):
            both = [{"effects": item["effects"]} for item in each], [item["truth"] for item in each]
            print(f"\n{title}: {len(each)} recordings\n{pp.judge(*both)}")


if __name__ == "__main__":
    main()
