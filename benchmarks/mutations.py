"""Whether the tests notice when the library is wrong: mutations drawn from a commit's hash.

    python -m benchmarks.mutations --count 40

A statement's module is drawn by its number of statements, and in it an operator, a comparison, a
constant, a sign or a statement that is changed or dropped. A clone of the commit in
``.evidence/mutations`` gets one mutation at a time. The test files whose names match the mutated
file or its package run first, then those nearest to it by imports; what they miss meets the whole
suite, unless ``--near`` says that it is only listed. A test counts if it fails twice with the
mutation and passes without; so do tests that take too long with the mutation only. Each outcome is
kept in a journal beside the clone, so that a run can be broken off and taken up.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from benchmarks.house import ROOT, git, importers, is_text, module_name

PLACE: Final = ROOT / ".evidence" / "mutations"
NEAREST: Final = 8
"""Test files that run before the whole suite."""
NEAR_S, ALL_S = 600.0, 3600.0
"""Seconds after which the nearest tests, or all, count as noticing (an endless loop)."""
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
        return f"{self.path}:{self.node.lineno} {old}{ast.unparse(self.node)}{new}"

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
        found.setdefault(f"{mutation.text} {mutation.node.col_offset}", mutation)
    return list(found.values())


def nearest_tests(tree: Path) -> dict[str, list[str]]:
    """By module: the test files that reach it by the fewest imports."""
    sources = {p: ast.parse(p.read_text("utf-8")) for p in (tree / "src").rglob("*.py")}
    by = importers(sources)
    tests: dict[str, set[str]] = defaultdict(set)
    for path in sorted((tree / "tests").rglob("test_*.py")):
        for name in re.findall(
            r"^\s*(?:from|import) (pendpipe[\w.]*)", path.read_text("utf-8"), re.M
        ):
            tests[name].add(path.relative_to(tree).as_posix())
    found = {}
    for name in map(module_name, sources):
        seen, level, files = {name}, {name}, list[str]()
        while level and len(files) < NEAREST:
            near = {file for module in level for file in tests[module]} - set(files)
            # Of equally near ones those of the same room first.
            room = f"tests/{name.split('.')[1] if '.' in name else ''}/"
            files += sorted(near, key=lambda file: (not file.startswith(room), file))
            level = {each for module in level for each in by.get(module, ())} - seen
            seen |= level
        found[name] = files[:NEAREST]
    return found


def matching_tests(tree: Path, module: str) -> list[str]:
    """The test files named like the module or its package."""
    _, *rooms, name = module.split(".")
    words = [word.rstrip("s") for word in (*rooms[1:], name)]
    folder = tree / "tests" / (rooms[0] if rooms else "core")
    # Commands and stages have no folder of their own.
    files = sorted((folder if folder.is_dir() else tree / "tests").rglob("test_*.py"))
    named = [path for path in files if any(word in path.stem for word in words)]
    return [path.relative_to(tree).as_posix() for path in named]


def run_tests(tree: Path, words: list[str], seconds: float) -> tuple[int, str]:
    """Run tests in the clone; status -1 where they ran out of their time."""
    environment = {
        **os.environ,
        "PYTHONPATH": f"{tree / 'src'}{os.pathsep}{tree / 'challenge/src'}",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    call = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=no", *words]
    try:
        run = subprocess.run(
            call, cwd=tree, env=environment, timeout=seconds, capture_output=True, text=True
        )
    except subprocess.TimeoutExpired:
        return -1, "time"
    return run.returncode, run.stdout


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
    parser.add_argument("--near", action="store_true", help="without the whole suite")
    arguments = parser.parse_args()
    commit = git("rev-parse", arguments.commit).decode().strip()
    tree, journal = PLACE / commit, PLACE / f"{commit}.jsonl"
    if not tree.exists():
        git("clone", "--quiet", "--shared", str(ROOT), str(tree))
        git("-C", str(tree), "checkout", "--quiet", commit)
    git("-C", str(tree), "checkout", "--quiet", "--", "src")
    entries = journal.read_text("utf-8").splitlines() if journal.exists() else []
    known: dict[str, Any] = {entry["mutation"]: entry for entry in map(json.loads, entries)}
    spoilt = {name for entry in known.values() for name in entry["spoilt"]}
    tests, chosen = nearest_tests(tree), drawn(tree, commit, arguments.count)
    caught = 0
    for mutation in chosen:
        entry = known.get(mutation.text)
        if entry is None:
            began = time.monotonic()
            module = module_name(tree / mutation.path)
            near = [files for files in (matching_tests(tree, module), tests[module]) if files]
            stages = [(files, NEAR_S) for files in near]
            stages += [] if arguments.near else [(["tests"], ALL_S)]
            by = outcome(tree, mutation, stages, spoilt)
            entry = {
                "mutation": mutation.text,
                "by": by,
                "spoilt": sorted(spoilt),
                "seconds": time.monotonic() - began,
            }
            with journal.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(entry) + "\n")
        caught += bool(entry["by"])
        how = f"caught by {entry['by']}" if entry["by"] else "**survived**"
        print(f"{mutation.text}: {how} ({entry['seconds']:.0f} s)", flush=True)
    print(f"{caught} of {len(chosen)} caught at {commit[:12]}")
    if spoilt:
        print("Tests that fail without any:", *sorted(spoilt), sep="\n- ")


if __name__ == "__main__":
    main()
