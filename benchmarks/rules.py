"""Each rule beside the score removed in turn, on the recordings where a log says that it acts.

    python -m benchmarks.rules [--challenge SET SEALED] [--apparatus 66] [--journal FILE] [--print]

The rules stood at the commit `AT`; ``rules.patch`` makes each of them a question there that is
noted, and answered with no where the rule is taken away. The set is opened and frozen: items of
`benchmarks.apparatus`, the short recordings of `benchmarks.known_physics`, and a challenge set (its
folder and that of its truth, as ``pendpipe challenge make`` was given them). An answer is worth 1
for each cause (or known fact) in a named class, less 1 for each false name (1/2 if its probability
is below 50 %) and for each curve where no cause lies outside. A rule goes unless the sign test
speaks for it, which it cannot where fewer than five answers differ.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from benchmarks.house import ROOT, copy_of

AT: Final = "a6956ec"
"""The commit at which the rules stood."""
MOST: Final = 12
"""Recordings on which a rule is tried."""
SIGNIFICANT: Final = 0.05
LONG_S: Final = 8.0
"""CPU seconds from which a recording is left out."""
SHORT: Final = 60_000
"""Bytes of a real recording that is asked: a longer one takes too long."""
RECORDINGS: Final = ROOT.parent / "shared/recordings"
PROCESSES: Final = 2
Answer = dict[str, Any]


def worth(
    effects: list[Mapping[str, Any]], true: set[str], causes: list[set[str]], out: bool
) -> float:
    """What the effects of an answer are worth; `causes` are sets of right names each."""
    value = 0.0
    groups = [{e["id"], *(o["id"] for o in e["indistinguishable_from"])} for e in effects]
    value += sum(any(cause & group for group in groups) for cause in causes)
    for effect, group in zip(effects, groups, strict=True):
        if effect["kind"] == "unnamed":
            value -= 0.0 if out else 1.0
        elif not group & true and not effect["presumed"]:
            value -= 1.0 if effect["probability"] >= 0.5 else 0.5
    return value


def items(apparatus: int, challenge: list[Path]) -> Iterator[str]:
    """Names of the recordings of the set."""
    if challenge:
        truths = sorted((challenge[1] / "truth").glob("*.json"))
        yield from (f"challenge {path.stem}" for path in truths)
    with (ROOT / "benchmarks/known_physics.tsv").open(encoding="utf-8", newline="") as stream:
        rows = csv.DictReader(stream, delimiter="\t", quoting=csv.QUOTE_NONE)
        files = {row["record"]: RECORDINGS / row["file"] for row in rows if row["answer"] == "free"}
    short = [each for each, file in files.items() if file.exists() and file.stat().st_size < SHORT]
    yield from (f"real {record}" for record in short)
    yield from (f"apparatus {number}" for number in range(apparatus))


def judged(name: str, challenge: list[Path]) -> float:
    """Diagnose one recording; what the answer is worth."""
    import pendpipe as pp

    kind, _, which = name.partition(" ")
    if kind == "apparatus":
        from benchmarks.apparatus.draw import draw
        from benchmarks.apparatus.scores import catalogue

        item = draw("rules", int(which))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.csv"
            item.write(path)
            effects = pp.diagnose(pp.read(path)).to_dict()["effects"]
        true = set(item.present) | set(item.near) | set(item.allowed)
        causes = [{each} for each in item.hidden]
        causes += [{"circular-error"}] if "circular-error" in item.present else []
        return worth(
            effects, true, causes, bool(item.outside) or bool(set(item.hidden) - catalogue())
        )
    if kind == "challenge":
        truth = json.loads((challenge[1] / f"truth/{which}.json").read_text("utf-8"))
        place = challenge[0] / "recordings" / f"{which}.csv"
        found = pp.diagnose(pp.read(place), baseline=truth["baseline"]).to_dict()["effects"]
        causes = [{each["effect"], *each["also"]} for each in truth["effects"]]
        out = any(each["effect"].startswith("unnamed") for each in truth["effects"])
        return worth(found, {*set().union(*causes), "coloured-noise"}, causes, out)
    from benchmarks import known_physics

    with known_physics.TABLE.open(encoding="utf-8", newline="") as stream:
        rows = csv.DictReader(stream, delimiter="\t", quoting=csv.QUOTE_NONE)
        row = next(row for row in rows if row["record"] == which)
    words = row["options"].split()
    options = dict(
        zip((each[2:].replace("-", "_") for each in words[::2]), words[1::2], strict=True)
    )
    recording = pp.read(known_physics.RECORDINGS / row["file"], **options)
    content = pp.diagnose(recording).to_dict()
    answers = known_physics.Answers({}, {"content": content, "status": 0})
    facts = known_physics.items(row["known"])
    wrong = [each["id"] for each in answers.effects if each["id"] in row["wrong"].split("/")]
    return sum(known_physics.is_found(each, answers) for each in facts) - float(len(wrong))


def work(challenge: list[Path]) -> None:
    """Answer what standard input asks for, ``rule<tab>recording`` a line, by the patched code."""
    import time

    from pendpipe import rule  # type: ignore[attr-defined]

    for line in sys.stdin:
        rule.without, name = line.rstrip("\n").split("\t")
        rule.acted.clear()
        before = time.process_time()
        try:
            value: float | None = judged(name, challenge)
        except Exception as error:
            print(f"{name}: {error!r}", file=sys.stderr)
            value = None
        spent = time.process_time() - before
        answer = {"without": rule.without, "item": name, "worth": value, "cpu_s": spent}
        print(json.dumps(answer | {"acted": sorted(rule.acted)}), flush=True)


def ask(tree: Path, wanted: list[tuple[str, str]], challenge: list[Path]) -> Iterator[Answer]:
    """Have some recordings answered by the patched code."""
    paths = os.pathsep.join(str(tree / each) for each in ("src", "challenge/src"))
    words = [sys.executable, "-m", "benchmarks.rules", "--work"]
    words += ["--challenge", *map(str, challenge)] if challenge else []
    environment = {**os.environ, "PYTHONPATH": paths}
    # Both write whole lines into one pipe.
    reading, writing = os.pipe()
    for number in range(PROCESSES):
        some = wanted[number::PROCESSES]
        run = subprocess.Popen(
            words, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=writing, text=True
        )
        assert run.stdin is not None
        run.stdin.write("".join(f"{rule}\t{name}\n" for rule, name in some))
        run.stdin.close()
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as stream:
        yield from map(json.loads, stream)


def table(known: Mapping[tuple[str, str], Answer]) -> Iterator[str]:
    """A row for each rule that acts somewhere."""
    from scipy.stats import binomtest

    whole = {name: each for (rule, name), each in known.items() if not rule}
    tried: dict[str, list[float]] = defaultdict(list)
    for (rule, name), each in known.items():
        if rule and None not in (each["worth"], whole[name]["worth"]):
            tried[rule].append(each["worth"] - whole[name]["worth"])
    acted: dict[str, int] = defaultdict(int)
    for each in whole.values():
        for rule in each["acted"]:
            acted[rule] += 1
    yield "| rule | acts on | tried | without it better | worse | equal | p | verdict |"
    yield "|---" * 8 + "|"
    for rule in sorted(acted, key=lambda each: -acted[each]):
        found = tried[rule]
        better, worse = sum(d > 0 for d in found), sum(d < 0 for d in found)
        p_value = (
            binomtest(worse, better + worse, alternative="greater").pvalue
            if found and better + worse
            else 1.0
        )
        verdict = "stays" if p_value < SIGNIFICANT else "goes" if found else "not tried"
        cells = [rule, acted[rule], len(found), better, worse, len(found) - better - worse]
        yield f"| {' | '.join(map(str, cells))} | {p_value:.2g} | {verdict} |"


def main() -> None:
    """Answer what has not been answered yet, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--apparatus", type=int, default=66, help="items")
    parser.add_argument("--challenge", type=Path, nargs=2, default=[], metavar=("SET", "SEALED"))
    parser.add_argument("--journal", type=Path, default=ROOT / ".evidence/rules.jsonl")
    parser.add_argument("--print", action="store_true", help="only print what is answered")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    challenge = [each.resolve() for each in arguments.challenge]
    if arguments.work:
        work(challenge)
        return
    arguments.journal.parent.mkdir(parents=True, exist_ok=True)
    arguments.journal.touch()
    lines = arguments.journal.read_text("utf-8").splitlines()
    kept = [json.loads(line) for line in lines if line.endswith("}")]
    known = {(each["without"], each["item"]): each for each in kept}
    with tempfile.TemporaryDirectory() as folder, arguments.journal.open("a") as stream:

        def answer(wanted: list[tuple[str, str]]) -> None:
            left = [each for each in wanted if each not in known]
            for each in ask(tree, left, challenge) if left and not arguments.print else ():
                stream.write(json.dumps(each) + "\n")
                stream.flush()
                known[each["without"], each["item"]] = each

        tree = Path(folder) if arguments.print else copy_of(AT, Path(folder))
        if not arguments.print:
            patch = Path(__file__).with_suffix(".patch")
            subprocess.run(["git", "apply", str(patch)], cwd=tree, check=True)
        names = list(items(arguments.apparatus, challenge))
        answer([("", name) for name in names])
        by_rule: dict[str, list[str]] = defaultdict(list)
        for name in names:
            each = known.get(("", name))
            if each and each["worth"] is not None and each["cpu_s"] < LONG_S:
                for rule in each["acted"]:
                    by_rule[rule].append(name)
        # What acts seldom is decided first.
        seldom = sorted(by_rule.items(), key=lambda each: len(each[1]))
        answer([(rule, name) for rule, some in seldom for name in some[:MOST]])
    print("\n".join(table(known)))


if __name__ == "__main__":
    main()
