"""Whether the tests notice when the library is wrong: mutations drawn from a commit's hash.

    pip install "pendpipe[mutations]"
    python -m benchmarks.mutations [--count 30] [--commit HEAD] [--workers 2] [--near]

cosmic-ray lists all mutations of `src/pendpipe`; of these some are drawn, the same whenever they
are drawn. Each is tried in a clone of its own: first by the tests that import the module and by
those of its folder, then (unless ``--near``) by the whole suite. A test counts that fails with the
mutation and passes without; a run that takes ten minutes counts as noticed. A mutation
that leaves the syntax tree as it is but for annotations and texts changes no result: it is listed
and replaced by the next, as are those of `equivalent_mutations.tsv`, each with its reason. The
journal lies in ``.evidence/mutations``, so that a run can be broken off.
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
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import Final, NamedTuple

from benchmarks.house import ROOT, git

PLACE: Final = ROOT / ".evidence" / "mutations"
EQUIVALENT: Final = Path(__file__).parent / "equivalent_mutations.tsv"
NEAR_S, ALL_S = 600.0, 1800.0
CONFIGURATION: Final = """[cosmic-ray]
module-path = "src/pendpipe"
timeout = 1000.0
excluded-modules = []
test-command = "pytest"
[cosmic-ray.distributor]
name = "local"
"""
FOLDERS: Final = {"commands": "cli", "stages": "workflow", "configuration": "workflow"}
"""Tests of a folder whose name is another one."""


class Mutation(NamedTuple):
    """One of the tool's list."""

    path: str
    operator: str
    arguments: str
    occurrence: int
    line: int

    def __str__(self) -> str:
        operator = self.operator.rpartition("/")[2]
        return f"{self.path}:{self.line} {operator} {self.occurrence}"

    def applied(self, tree: Path) -> str:
        """The module's text with the change."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        operator = get_operator(self.operator)(**json.loads(self.arguments))
        found = mutate_code((tree / self.path).read_text("utf-8"), operator, self.occurrence)
        return str(found)


def changed_line(tree: Path, mutation: Mutation) -> str:
    """The first line that a mutation changes, before and after."""
    pairs = zip(
        (tree / mutation.path).read_text("utf-8").splitlines(),
        mutation.applied(tree).splitlines(),
        strict=False,
    )
    before, after = next(((old, new) for old, new in pairs if old != new), ("", ""))
    return f"`{before.strip()}` → `{after.strip()}`".replace("|", "\\|")


def listed(tree: Path, session: Path) -> list[Mutation]:
    """All that the tool knows of a tree, in order."""
    from cosmic_ray.work_db import WorkDB, use_db

    if not session.exists():
        configuration = session.with_suffix(".toml")
        configuration.write_text(CONFIGURATION, encoding="utf-8")
        words = [sys.executable, "-m", "cosmic_ray.cli", "init"]
        made = session.with_suffix(".new")
        subprocess.run([*words, str(configuration), str(made)], cwd=tree, check=True)
        made.replace(session)
    with use_db(session, WorkDB.Mode.open) as database:
        specs = [spec for item in database.work_items for spec in item.mutations]
    return sorted(
        Mutation(
            Path(spec.module_path).as_posix(),
            spec.operator_name,
            json.dumps(spec.operator_args),
            spec.occurrence,
            spec.start_pos[0],
        )
        for spec in specs
    )


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


def clone(commit: str, name: str) -> Path:
    """A tree of a commit for one worker, as it was committed."""
    tree = PLACE / name / "pendpipe"
    if not tree.exists():
        git("clone", "--quiet", "--shared", str(ROOT), str(tree))
        shared = ROOT.parent / "shared"
        if shared.exists():
            (tree.parent / "shared").symlink_to(shared.resolve())
    git("-C", str(tree), "checkout", "--quiet", "--force", commit)
    return tree


def near(tree: Path, path: str) -> list[str]:
    """Test files that import a module, and the folder of tests that bears its folder's name."""
    parts = Path(path).with_suffix("").parts[1:]
    module, home = ".".join(parts).removesuffix(".__init__"), parts[1]
    parent, _, name = module.rpartition(".")
    wanted = re.compile(rf"\b{re.escape(module)}\b|from {re.escape(parent)} import .*\b{name}\b")
    tests = sorted((tree / "tests").rglob("test_*.py"))
    found = [p.relative_to(tree).as_posix() for p in tests if wanted.search(p.read_text("utf-8"))]
    folder = f"tests/{FOLDERS.get(home, home if len(parts) > 2 else 'core')}"
    return [*found, folder] if (tree / folder).is_dir() else [*found, "tests/core"]


def run_tests(tree: Path, words: list[str], seconds: float) -> tuple[int, str]:
    """Run pytest in a tree; status -1 where it ran out of its time, with all it started."""
    paths = os.pathsep.join([f"{tree / 'src'}", f"{tree / 'challenge/src'}", str(tree)])
    call = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--tb=no"]
    with subprocess.Popen(
        [*call, *words],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
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
            return -1, ""
    return process.returncode, output


def caught(tree: Path, mutation: Mutation, words: list[str], seconds: float) -> str:
    """The test that notices a mutation, or nothing."""
    path, excused = tree / mutation.path, list[str]()
    source, changed = path.read_text("utf-8"), mutation.applied(tree)
    while True:
        path.write_text(changed, encoding="utf-8")
        try:
            status, output = run_tests(tree, [*words, *excused], seconds)
        finally:
            path.write_text(source, encoding="utf-8")
        if status in (0, 5):
            return ""
        names = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.M)[:1]
        if not names or run_tests(tree, names, seconds)[0] == 0:
            return names[0] if names else "the time it takes" if status < 0 else "pytest's end"
        # It fails without the mutation as well.
        excused.append(f"--deselect={names[0]}")


def drawn(tree: Path, every: list[Mutation], commit: str) -> Iterator[tuple[Mutation, str]]:
    """The mutations in the commit's order, each with why it changes no result, or nothing."""
    lines = EQUIVALENT.read_text("utf-8").splitlines() if EQUIVALENT.exists() else []
    reasons = dict(line.split("\t", 1) for line in lines if "\t" in line)
    order = random.Random(commit).sample(every, len(every))
    for mutation in order:
        source, changed = (tree / mutation.path).read_text("utf-8"), mutation.applied(tree)
        try:
            same = meaning(source) == meaning(changed)
        except SyntaxError:
            continue
        why = "the syntax tree is the same but for annotations and texts" if same else ""
        yield mutation, reasons.get(str(mutation), why)


def main() -> None:
    """Draw, try what the journal does not hold, print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--commit", default="HEAD", help="whose library is mutated (%(default)s)")
    parser.add_argument("--count", type=int, default=30, help="how many (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="clones at work (%(default)s)")
    parser.add_argument("--near", action="store_true", help="without the whole suite")
    arguments = parser.parse_args()
    # A shell's background ignores Ctrl-C, and a test that interrupts a recording would hang.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    commit = git("rev-parse", arguments.commit).decode().strip()
    PLACE.mkdir(parents=True, exist_ok=True)
    trees: Queue[Path] = Queue()
    for number in range(arguments.workers):
        trees.put(clone(commit, f"worker-{number}"))
    first, journal = trees.queue[0], PLACE / f"{commit}.jsonl"
    every = listed(first, PLACE / f"{commit}.sqlite")
    lines = journal.read_text("utf-8").splitlines() if journal.exists() else []
    known: dict[str, str] = dict(map(json.loads, lines))
    chosen: list[Mutation] = []
    print(f"{len(every)} mutations of {commit[:12]}", flush=True)
    for mutation, why in drawn(first, every, commit):
        if why:
            print(f"{mutation}: changes no result: {why}; replaced", flush=True)
        else:
            chosen.append(mutation)
        if len(chosen) == arguments.count:
            break

    def meets(mutation: Mutation, words: list[str] | None, stage: str) -> None:
        key = f"{mutation} {stage}"
        if key not in known:
            tree = trees.get()
            limit_s = ALL_S if words else NEAR_S
            by = caught(tree, mutation, words or near(tree, mutation.path), limit_s)
            trees.put(tree)
            known[key] = by
            with journal.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps([key, by]) + "\n")
        print(f"{key}: {known[key] or 'not caught'}", flush=True)

    with ThreadPoolExecutor(arguments.workers) as pool:
        list(pool.map(lambda each: meets(each, None, "near"), chosen))
    left = [each for each in chosen if not known[f"{each} near"]]
    for mutation in [] if arguments.near else left:
        meets(mutation, ["-n", str(arguments.workers), "--dist", "worksteal", "tests"], "all")
    print("\n| mutation | change | noticed by |\n|---|---|---|")
    for mutation in chosen:
        by = known[f"{mutation} near"] or known.get(f"{mutation} all", "")
        print(f"| {mutation} | {changed_line(first, mutation)} | {by or '**nothing**'} |")
    missed = sum(not (known[f"{m} near"] or known.get(f"{m} all")) for m in chosen)
    print(f"\n{len(chosen) - missed} of {len(chosen)} caught at {commit[:12]}")


if __name__ == "__main__":
    main()
