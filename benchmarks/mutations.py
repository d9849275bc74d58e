"""Whether the tests notice when the library is wrong: mutations drawn from a commit's hash.

    pip install "pendpipe[mutations]"
    python -m benchmarks.mutations [--number 30] [--commit HEAD] [--place DIR] [--of TEXT] [--all]

Of all mutations of `src/pendpipe` that cosmic-ray lists some are drawn, for one commit always the
same (with ``--of`` those of modules whose path holds a text). Each is tried in a clone until a test
fails with the mutation and passes without: first by the test files that import the module, then by
those of its folder, and with ``--all`` by the others. A mutation that leaves the syntax tree as it
is but for annotations and texts changes no result: the next one replaces it, as it replaces those
of ``equivalent_mutations.tsv``, which stand there with the reason. A broken run goes on where it
was.
"""

from __future__ import annotations

import ast
import difflib
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from benchmarks.house import git
from benchmarks.journal import KEPT, ROOT, answers, judge_parser

EQUIVALENT: Final = Path(__file__).with_name("equivalent_mutations.tsv")
TEST_S: Final = 900
"""What a test may take, by the clock; more counts as noticed."""
FOLDERS: Final = {"commands": "cli", "stages": "workflow", "configuration": "workflow"}
"""Tests of a folder whose name is another one."""


class Mutation(NamedTuple):
    """One of the tool's list."""

    path: str
    operator: str
    occurrence: int
    line: int

    def __str__(self) -> str:
        return f"{self.path}:{self.line} {self.operator.rpartition('/')[2]} {self.occurrence}"

    def applied(self, tree: Path) -> tuple[str, str]:
        """The module's text without and with the change."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        source = (tree / self.path).read_text("utf-8")
        return source, str(mutate_code(source, get_operator(self.operator)(), self.occurrence))

    def difference(self, tree: Path) -> str:
        """The lines that it changes."""
        texts = (text.splitlines() for text in self.applied(tree))
        lines = list(difflib.unified_diff(*texts, lineterm="", n=0))[3:]
        return " ".join(f"`{line[0]} {line[1:].strip()}`" for line in lines).replace("|", "\\|")


def listed(tree: Path) -> list[Mutation]:
    """All that the tool knows of a tree, in order."""
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator, operator_names

    kinds = {name: get_operator(name) for name in sorted(operator_names())}
    operators = {name: kind() for name, kind in kinds.items() if not kind.arguments()}
    return [
        Mutation(path.relative_to(tree).as_posix(), name, number, at[0])
        for path in sorted((tree / "src/pendpipe").rglob("*.py"))
        for nodes in [list(ast_nodes(get_ast_from_path(path)))]
        for name, operator in operators.items()
        for number, (at, _) in enumerate(
            place for node in nodes for place in operator.mutation_positions(node)
        )
    ]


def meaning(source: str) -> str:
    """The syntax tree without annotations and strings that stand alone."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            if getattr(node, name, None) is not None:
                setattr(node, name, ast.Constant(0))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value = ast.Constant(0)
    return ast.dump(tree)


def drawn(tree: Path, every: list[Mutation], commit: str) -> Iterator[tuple[Mutation, str]]:
    """The mutations in the commit's order, each with why it changes no result, or nothing."""
    lines = EQUIVALENT.read_text("utf-8").splitlines() if EQUIVALENT.exists() else []
    reasons = dict(line.split("\t", 1) for line in lines if "\t" in line)
    for mutation in random.Random(commit).sample(every, len(every)):
        source, changed = mutation.applied(tree)
        try:
            same = meaning(source) == meaning(changed)
        except SyntaxError:
            continue
        why = "the syntax tree is the same but for annotations and texts" if same else ""
        yield mutation, reasons.get(str(mutation), why)


def clone(commit: str, place: Path) -> Path:
    """A tree of a commit, as it was committed; recordings of others beside it."""
    tree, shared = place / "pendpipe", ROOT.parent / "shared"
    if not tree.exists():
        place.mkdir(parents=True, exist_ok=True)
        git("clone", "--quiet", "--shared", str(ROOT), str(tree))
        if shared.exists():
            (place / "shared").symlink_to(shared.resolve())
    git("-C", str(tree), "checkout", "--quiet", "--force", commit)
    return tree


def test_files(tree: Path, path: str) -> list[list[str]]:
    """Test files that import a module; others of the folder of its name; the rest."""
    parts = Path(path).with_suffix("").parts[1:]
    module, home = ".".join(parts).removesuffix(".__init__"), parts[1]
    parent, _, name = module.rpartition(".")
    wanted = re.compile(rf"\b{re.escape(module)}\b|from {re.escape(parent)} import .*\b{name}\b")
    names = {FOLDERS.get(home, home if len(parts) > 2 else "core"), name}
    folders = {tree / "tests" / each for each in names}  # a command's, also those of its own name
    found: list[list[str]] = [[], [], []]
    for file in sorted((tree / "tests").rglob("test_*.py")):
        place = (
            0 if wanted.search(file.read_text("utf-8")) else 2 - bool(folders & set(file.parents))
        )
        found[place].append(file.relative_to(tree).as_posix())
    return found


def run_tests(tree: Path, words: list[str]) -> tuple[int, str]:
    """Status and output of pytest in a tree, which ends where a test exceeds its time."""
    paths = os.pathsep.join([f"{tree / 'src'}", f"{tree / 'challenge/src'}", str(tree)])
    call = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--tb=no"]
    call += ["-o", f"faulthandler_timeout={TEST_S}", "-o", "faulthandler_exit_on_timeout=true"]
    # What a test leaves running would hold a pipe open.
    with tempfile.TemporaryFile("w+", encoding="utf-8") as printed:
        done = subprocess.run(
            [*call, *words],
            cwd=tree,
            env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            check=False,
        )
        printed.seek(0)
        return done.returncode, printed.read()


def caught(key: tuple[str, str, Mutation], tree: Path) -> str:
    """The test that notices a mutation, or nothing."""
    _, tests, mutation = key
    path, (source, changed) = tree / mutation.path, mutation.applied(tree)
    near, area, rest = test_files(tree, mutation.path)
    for files in (near, area) if tests == "near" else (rest,):
        excused: list[str] = []
        while files:
            path.write_text(changed, encoding="utf-8")
            try:
                status, output = run_tests(tree, [*files, *excused])
            finally:
                path.write_text(source, encoding="utf-8")
            if status in (0, 5):
                break
            if "Timeout (" in output:
                return f"the time of one of {' '.join(files)}"
            names = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.M)[:1]
            if run_tests(tree, names or files)[0] == 0:
                return names[0] if names else "pytest's end"
            # It fails without the mutation as well.
            excused += [f"--deselect={names[0]}"] if names else []
            files = [file for file in files if names and file != names[0]]
    return ""


def main() -> None:
    """Draw, try what the journal does not hold, print the table."""
    parser = judge_parser(__doc__, "mutations", 30)
    parser.add_argument("--commit", default="HEAD", help="whose library is mutated (%(default)s)")
    parser.add_argument("--place", type=Path, default=KEPT / "mutations", help="of the clone")
    parser.add_argument("--of", default="", metavar="TEXT", help="in the path of the module")
    parser.add_argument("--all", action="store_true", help="try survivors by every other test")
    arguments = parser.parse_args()
    arguments.processes = 1
    # A shell's background ignores Ctrl-C, and a test that interrupts a recording would hang.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    commit = git("rev-parse", arguments.commit).decode().strip()
    tree = clone(commit, arguments.place.resolve())
    every = [each for each in listed(tree) if arguments.of in each.path]
    print(f"{len(every)} mutations of {commit[:12]}", flush=True)
    chosen: list[Mutation] = []
    for mutation, why in drawn(tree, every, commit):
        if len(chosen) == arguments.number:
            break
        if why:
            print(f"{mutation}: changes no result: {why}; replaced", flush=True)
        else:
            chosen.append(mutation)
    found: dict[Mutation, str] = {}
    for tests in ("near", "all") if arguments.all else ("near",):
        left = [(commit, tests, each) for each in chosen if not found.get(each)]
        tried = answers(arguments, left, partial(caught, tree=tree), ())
        for (*_, mutation), by in zip(left, tried, strict=True):
            found[mutation] = by
            print(f"{mutation} {tests}: {by or 'not caught'}", flush=True)
    print("\n| mutation | change | noticed by |\n|---|---|---|")
    for mutation, by in found.items():
        print(f"| {mutation} | {mutation.difference(tree)} | {by or '**nothing**'} |")
    print(f"\n{sum(map(bool, found.values()))} of {len(found)} caught at {commit[:12]}")


if __name__ == "__main__":
    main()
