"""Whether the tests notice when the library is wrong: mutations drawn from a commit's hash.

    python -m benchmarks.mutations --count 40

A statement's module is drawn by its number of statements, and in it an operator, a comparison, a
constant, a sign or a statement that is changed or dropped. A clone of the commit in
``.evidence/mutations`` gets one mutation at a time. Once per commit the suite is followed
(`benchmarks.entered`): a mutation meets the tests that enter its function, those that enter the
fewest others first, as many as run in `NEAR_S`. What no test enters, since it is compiled or stands
outside functions, meets the tests of what names it. What they miss meets the whole suite, unless
``--near SECONDS`` says how long to look; it is printed how many of the tests it met. A test counts
if it fails twice with the mutation and passes without; so do tests that take too long with the
mutation only. Each outcome is kept in a journal beside the clone, so that a run can be broken off
and taken up.

Not drawn are annotations, texts and decorators that only speed things up: the library answers the
same without them. All else is, whether its mutant can be told from the library or not.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from benchmarks.house import ROOT, git, is_text

PLACE: Final = ROOT / ".evidence" / "mutations"
NEAR_S, ALL_S = 120.0, 3600.0
"""Seconds of the tests that run before the whole suite, and of all of them."""
SLOWER, START_S = 3.0, 60.0
"""So many times their seconds, and what starts and compiles, are an endless loop: it is noticed."""
_PAIRS: Final = (
    *((ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.Lt, ast.LtE), (ast.Gt, ast.GtE)),
    *((ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn), (ast.And, ast.Or)),
)
OTHER: Final[dict[type[ast.AST], type[ast.AST]]] = {
    **dict(_PAIRS),
    **{second: first for first, second in _PAIRS},
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.FloorDiv,
}
"""What each operator becomes."""


class Mutation(NamedTuple):
    """One change of a file: what stands between two positions is replaced."""

    path: str
    node: ast.expr | ast.stmt
    new: str

    @property
    def text(self) -> str:
        """Where and what, in a line."""
        old = "dropped: " if self.new == "pass" else ""
        new = "" if self.new == "pass" else f" -> {self.new}"
        place = f"{self.path}:{self.node.lineno}:{self.node.col_offset}"
        return f"{place} {old}{ast.unparse(self.node)}{new}"

    def applied(self, source: str) -> str:
        """The file's text with the change; positions count bytes."""
        lines = source.encode().splitlines(keepends=True)
        first, last = self.node.lineno - 1, (self.node.end_lineno or 0) - 1
        head = lines[first][: self.node.col_offset]
        tail = lines[last][self.node.end_col_offset :]
        return b"".join(
            [*lines[:first], head, self.new.encode(), tail, *lines[last + 1 :]]
        ).decode()


def mutations(path: str, module: ast.Module) -> Iterator[Mutation]:
    """All mutations of a file."""
    for node in mutable(module):
        match node:
            case ast.BinOp(left, op, right) if type(op) in OTHER:
                changed: ast.expr = ast.BinOp(left, OTHER[type(op)](), right)  # type: ignore[arg-type]
            case ast.Compare(left, [op, *ops], comparators):
                changed = ast.Compare(left, [OTHER[type(op)](), *ops], comparators)  # type: ignore[list-item]
            case ast.BoolOp(op, values):
                changed = ast.BoolOp(OTHER[type(op)](), values)  # type: ignore[arg-type]
            case ast.UnaryOp(ast.USub() | ast.Not(), operand):
                changed = operand
            case ast.Constant(bool(value)):
                changed = ast.Constant(not value)
            case ast.Constant(int(value)):
                changed = ast.Constant(value + 1)
            case ast.Constant(float(value)):
                changed = ast.Constant(2.0 * value or 1.0)
            case ast.Expr(ast.Call()) | ast.AugAssign() | ast.Raise():
                yield Mutation(path, node, "pass")
                continue
            case _:
                continue
        yield Mutation(path, node, f"({ast.unparse(changed)})")


def mutable(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes that run: no annotations, no text, nothing of f-strings (they have no position).

    Of decorators those only that declare something (`enters` and `follows` of the effects).
    """
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for child in value if isinstance(value, list) else [value]:
            skipped = isinstance(child, ast.JoinedStr | ast.pattern) or is_text(child)
            if name == "decorator_list":
                skipped = not ast.unparse(child).startswith(("enters(", "follows("))
            if isinstance(child, ast.AST) and not skipped:
                yield child
                yield from mutable(child)


def drawn(tree: Path, commit: str, count: int) -> list[Mutation]:
    """The commit's mutations, the same whenever they are drawn."""
    pools, weights = [], []
    for path in sorted((tree / "src/pendpipe").rglob("*.py")):
        module = ast.parse(path.read_text("utf-8"))
        pool = list(mutations(path.relative_to(tree).as_posix(), module))
        if pool:
            pools.append(pool)
            weights.append(
                sum(isinstance(n, ast.stmt) and not is_text(n) for n in ast.walk(module))
            )
    dice = random.Random(commit)
    found: dict[str, Mutation] = {}
    while len(found) < count:
        mutation = dice.choice(dice.choices(pools, weights)[0])
        found.setdefault(mutation.text, mutation)
    return list(found.values())


class Definition(NamedTuple):
    """A function, method or constant, or what else stands in a class or a module."""

    path: str
    name: str
    first: int
    last: int
    mentions: frozenset[str]

    @classmethod
    def of(cls, path: str, home: str, node: ast.stmt) -> Definition:
        """What a statement of a module or class defines."""
        words = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        words |= {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)}
        match node:
            case ast.Assign(targets=[ast.Name(name), *_]) | ast.AnnAssign(target=ast.Name(name)):
                pass
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                pass
            case _:
                name = ""
        first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", ()))])
        last = node.end_lineno or first
        return cls(path, f"{home}.{name}".strip("."), first, last, frozenset(words))


def definitions(tree: Path) -> list[Definition]:
    """The library's definitions: of classes what stands in them."""
    found = []
    for path in sorted((tree / "src").rglob("*.py")):
        name = path.relative_to(tree).as_posix()
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                found += [Definition.of(name, node.name, inner) for inner in node.body]
            found.append(Definition.of(name, "", node))
    return found


def entering(mutation: Mutation, known: list[Definition], tests: dict[str, Any]) -> set[str]:
    """The tests that enter what is mutated, else what names it, however far off."""
    line, path = mutation.node.lineno, mutation.path
    level = [d for d in known if d.path == path and d.first <= line <= d.last][:1]
    seen = set(level)
    while level:
        keys = {f"{each.path}:{each.name}" for each in level}
        if found := {test for test, of in tests.items() if not keys.isdisjoint(of["functions"])}:
            return found
        words = {each.name.strip(".").split(".")[-1] for each in level} - {""}
        level = [d for d in known if d not in seen and not words.isdisjoint(d.mentions)]
        seen.update(level)
    return set()


def nearest_tests(found: set[str], tests: dict[str, Any], most_s: float) -> tuple[list[str], float]:
    """Of these tests those that enter the fewest functions, and the seconds that they take."""
    chosen, seconds = [], 0.0
    for test in sorted(found, key=lambda test: (len(tests[test]["functions"]), test)):
        if not chosen or seconds + tests[test]["seconds"] <= most_s:
            chosen.append(test)
            seconds += tests[test]["seconds"]
    return chosen, seconds


def followed(tree: Path, record: Path) -> dict[str, Any]:
    """Which functions each test of a commit enters; the suite is followed once."""
    if not record.exists():
        run([str(ROOT / "benchmarks/entered.py"), str(record), "tests"], tree, SLOWER * ALL_S)
    return json.loads(record.read_text("utf-8"))  # type: ignore[no-any-return]


def run(words: list[str], tree: Path, seconds: float) -> tuple[int, str]:
    """Run Python in the clone; status -1 where it ran out of its time, with all it started."""
    environment = {
        **os.environ,
        "PYTHONPATH": f"{tree / 'src'}{os.pathsep}{tree / 'challenge/src'}",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    with subprocess.Popen(
        [sys.executable, *words],
        cwd=tree,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            output, _ = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return -1, "time"
    return process.returncode, output


def run_tests(tree: Path, words: list[str], seconds: float) -> tuple[int, str]:
    """Run tests in the clone."""
    return run(["-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=no", *words], tree, seconds)


def failed(output: str) -> list[str]:
    """The tests that pytest lists as failed."""
    return re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.M)


def outcome(
    tree: Path, mutation: Mutation, stages: list[tuple[list[str], float]], spoilt: set[str]
) -> str:
    """The test that noticed a mutation, or nothing; tests that fail by themselves are added."""
    path = tree / mutation.path
    source, stamp = path.read_text("utf-8"), path.stat()

    def with_it(*words: str, seconds: float) -> tuple[int, str]:
        path.write_text(mutation.applied(source), encoding="utf-8")
        try:
            return run_tests(tree, list(words), seconds)
        finally:
            path.write_text(source, encoding="utf-8")
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))

    for words, seconds in stages:
        while True:
            without = [f"--deselect={name}" for name in sorted(spoilt)]
            status, output = with_it("-x", *without, *words, seconds=seconds)
            if status == 0:
                break
            names = failed(output)[:1]
            alone = names or ["-x", *without, *words]
            # On a busy machine a test may fail by chance: it has to fail twice.
            again = with_it(*alone, seconds=seconds)[0] if names else status
            if again and run_tests(tree, alone, seconds)[0] == 0:
                return names[0] if names else "the time it takes" if status < 0 else "pytest's end"
            if not names:
                break  # As slow, or as broken, without the mutation.
            spoilt.add(names[0])
    return ""


def main() -> None:
    """Draw, try what the journal does not hold, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--commit", default="HEAD", help="whose library is mutated (%(default)s)")
    parser.add_argument("--count", type=int, default=40, help="how many (%(default)s)")
    parser.add_argument("--near", type=float, metavar="SECONDS", help="without the whole suite")
    parser.add_argument("--seed", help="draw from this instead of the commit's hash")
    arguments = parser.parse_args()
    # A shell's background has Ctrl-C ignored, and a test that interrupts a recording would hang.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    commit = git("rev-parse", arguments.commit).decode().strip()
    tree, journal = PLACE / commit, PLACE / f"{commit}.jsonl"
    if not tree.exists():
        git("clone", "--quiet", "--shared", str(ROOT), str(tree))
        git("-C", str(tree), "checkout", "--quiet", commit)
    git("-C", str(tree), "checkout", "--quiet", "--", "src")
    entries = journal.read_text("utf-8").splitlines() if journal.exists() else []
    known: dict[str, Any] = {entry["mutation"]: entry for entry in map(json.loads, entries)}
    spoilt = {name for entry in known.values() for name in entry["spoilt"]}
    tests, known_names = followed(tree, PLACE / f"{commit}.json"), definitions(tree)
    chosen = drawn(tree, arguments.seed or commit, arguments.count)
    caught = 0
    for mutation in chosen:
        entry = known.get(mutation.text)
        if entry is None:
            began = time.monotonic()
            found = entering(mutation, known_names, tests)
            near, seconds = nearest_tests(found, tests, arguments.near or NEAR_S)
            stages = [(near, SLOWER * seconds + START_S)] if near else []
            stages += [] if arguments.near else [(["tests"], SLOWER * ALL_S)]
            by = outcome(tree, mutation, stages, spoilt)
            entry = {
                "mutation": mutation.text,
                "by": by,
                "met": f"{len(near)} of {len(found)} tests" if arguments.near else "all tests",
                "spoilt": sorted(spoilt),
                "seconds": time.monotonic() - began,
            }
            with journal.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(entry) + "\n")
        caught += bool(entry["by"])
        how = f"caught by {entry['by']}" if entry["by"] else f"**survived** {entry['met']}"
        print(f"{mutation.text}: {how} ({entry['seconds']:.0f} s)", flush=True)
    print(f"{caught} of {len(chosen)} caught at {commit[:12]}")
    if spoilt:
        print("Tests that fail without any:", *sorted(spoilt), sep="\n- ")


if __name__ == "__main__":
    main()
