"""The measures of the house: how much code there is, how it hangs together, what it costs.

    python -m benchmarks.house [--commit 2af5a66] [--list] [--tests]

A commit stands beside what is here; ``--tests`` runs both suites and times them.

Strings that stand alone (docstrings) are no statements. A file's importers are the other files of
the two packages that name it. A definition is unused if its name stands nowhere else in code,
templates and configuration, and no registry holds it. Lines stand twice if six or more in a row
have the shape of others. A named number (upper case, at the top of a file) has a word of origin if
a docstring follows it, or a comment stands on its line or above it. Bare numbers are those in
comparisons, but for 0, 1, -1, 2, 0.5 and 10.

``budgets.tsv`` holds the statements that each folder may have: who needs more raises its row in the
same commit and says why. ``concepts.tsv`` names the definitions that do the same thing, each its
own way; whoever joins two strikes one out.
"""

from __future__ import annotations

import argparse
import ast
import csv
import io
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from typing import Any, Final

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from benchmarks.journal import ROOT
from benchmarks.table import head, table_row

SAME_LINES, SAME_TOKENS = 6, 40
STARTS: Final = 9
USES: Final = ("*.py", "*.smk", "Snakefile", "*.html", "*.j2", "*.toml", "*.yaml", "run")
"""Files in which a name may be used."""
PLAIN: Final = frozenset({"property", "cached_property", "staticmethod", "classmethod", "cache"})
"""Decorators that enter nothing into a registry."""
PROTOCOLS: Final = frozenset(
    {"from_param", "generic_resolve", "_repr_html_", "do_GET", "log_message"}
)
"""What other code finds by name: methods; and below, all definitions of some modules."""
REGISTRIES: Final = re.compile(
    r"catalogue/|acquisition/(devices|drivers)/|formats/dialects/|entries\.py|logger_plugin"
)
LAYOUT: Final = {getattr(tokenize, k) for k in ("COMMENT", "NL", "NEWLINE", "INDENT", "DEDENT")}
Function = ast.FunctionDef | ast.AsyncFunctionDef
PLAIN_NUMBERS: Final = (0, 1, 2, -1, 0.5, 10)
"""Numbers that a comparison needs no reason for."""
SECOND: Final = {
    "fit": "pp.fit('examples/rod-pendulum.csv')",
    "diagnosis": "pp.diagnose('examples/string-pendulum.csv')",
}
ENTERED: Final = f"""
import sys
import pendpipe as pp
{SECOND["fit"]}; {SECOND["diagnosis"]}
seen = set()
def note(frame, event, argument):
    code = frame.f_code
    if event == "call" and "pendpipe" in code.co_filename and code.co_name[0] != "<":
        seen.add((code.co_filename, getattr(code, "co_qualname", code.co_name)))
sys.setprofile(note)
%s
sys.setprofile(None)
print(len({{file for file, _ in seen}}), len(seen), sep=", ")
"""
"""The first run compiles, and loads what is loaded once."""


def files_of(tree: Path) -> dict[str, list[Path]]:
    """Python files by part; in old commits the challenge lies within the library."""
    within, generated = tree / "src/pendpipe/challenge", tree / "src/pendpipe/_version.py"
    library = sorted({*(tree / "src").rglob("*.py")} - {generated})
    return {
        "library": [path for path in library if within not in path.parents],
        "challenge": sorted([*within.rglob("*.py"), *(tree / "challenge/src").rglob("*.py")]),
        "tests": sorted((tree / "tests").rglob("*.py")),
        "benchmarks": sorted((tree / "benchmarks").rglob("*.py")),
    }


def is_text(node: object) -> bool:
    """Whether a node is a string that stands alone."""
    value = node.value if isinstance(node, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def module_name(path: Path) -> str:
    """The dotted name by which a file of a package is imported."""
    parts = path.with_suffix("").parts
    start = len(parts) - parts[::-1].index("src")
    return ".".join(parts[start:]).removesuffix(".__init__")


def importers(trees: dict[Path, ast.Module]) -> dict[str, set[str]]:
    """By module: the modules that import it."""
    names = {module_name(path) for path in trees}
    found: dict[str, set[str]] = defaultdict(set)
    for path, tree in trees.items():
        for node in ast.walk(tree):
            wanted: list[str] = []
            if isinstance(node, ast.Import):
                wanted = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and (home := node.module):
                below = [f"{home}.{alias.name}" for alias in node.names]
                wanted = [name if name in names else home for name in below]
            elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
                wanted = [a.value for a in node.args if isinstance(a, ast.Constant)]
            for name in names.intersection(wanted):
                found[name].add(module_name(path))
    return found


def tops(trees: dict[Path, ast.Module]) -> dict[Path, ast.Module]:
    """Of each file what it imports when it is imported."""
    return {
        path: ast.Module([n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)], [])
        for path, tree in trees.items()
    }


def circles(*graphs: tuple[dict[str, set[str]], int]) -> int:
    """Groups of modules, or of folders at a depth, that import each other."""
    number = 0
    for by, depth in graphs:
        arrows = {
            (".".join(a.split(".")[:depth]), ".".join(b.split(".")[:depth]))
            for b, users in by.items()
            for a in users
        }
        names = sorted({name for arrow in arrows for name in arrow})
        places = [[names.index(name) for name in arrow] for arrow in arrows if arrow[0] != arrow[1]]
        if places:
            graph = csr_array((np.ones(len(places)), np.transpose(places)), [len(names)] * 2)
            _, groups = connected_components(graph, connection="strong")
            number += int(np.sum(np.bincount(groups) > 1))
    return number


def floors(trees: dict[Path, ast.Module], package: str = "pendpipe.diagnosis") -> int:
    """Longest chain of imports at the top of a package's files; 0 where there is a circle."""
    by = importers(tops(trees))
    names = [module_name(path) for path in trees]
    left = {name for name in names if name.startswith(f"{package}.")}
    needs = {name: {n for n in left if name in by[n]} for name in left}
    number = 0
    while left:
        # What stands on nothing that is left is the next floor.
        floor = {name for name in left if not needs[name] & left - {name}}
        if not floor:
            return 0
        left, number = left - floor, number + 1
    return number


def definitions(module: ast.Module) -> Iterator[tuple[str, int]]:
    """Functions, classes, methods and constants that no decorator enters anywhere."""
    classes = [node for node in module.body if isinstance(node, ast.ClassDef)]
    for node in [*module.body, *(inner for each in classes for inner in each.body)]:
        if isinstance(node, Function | ast.ClassDef):
            if PLAIN.issuperset(map(ast.unparse, node.decorator_list)):
                yield node.name, node.lineno
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node in module.body:
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Name):
                    yield target.id, node.lineno


def tokens(path: Path) -> list[tokenize.TokenInfo]:
    """A file's tokens without comments, layout and long strings."""
    found = tokenize.generate_tokens(io.StringIO(path.read_text("utf-8")).readline)
    return [t for t in found if t.string and t.type not in LAYOUT and '"""' not in t.string]


def unused(tree: Path, trees: dict[Path, ast.Module]) -> list[str]:
    """Definitions whose name stands nowhere else, as ``file:line name``."""
    words: Counter[str] = Counter()
    for path in (path for pattern in USES for path in tree.rglob(pattern)):
        code = [t.string for t in tokens(path)] if path.suffix == ".py" else [path.read_text()]
        words.update(re.findall(r"\w+", " ".join(code)))
    own = Counter(name for module in trees.values() for name, _ in definitions(module))
    return [
        f"{path.relative_to(tree)}:{line} {name}"
        for path, module in trees.items()
        for name, line in definitions(module)
        if words[name] <= own[name] and not name.startswith("__") and name not in PROTOCOLS
        if not REGISTRIES.search(path.as_posix())
    ]


def duplicates(paths: list[Path]) -> int:
    """Lines that belong to a run of `SAME_LINES` whose shape stands elsewhere as well."""
    runs: dict[tuple[object, ...], list[set[tuple[Path, int]]]] = defaultdict(list)
    for path in paths:
        rows: dict[int, list[tokenize.TokenInfo]] = defaultdict(list)
        for token in tokens(path):
            rows[token.start[0]].append(token)
        lines = [(n, row) for n, row in rows.items() if row[0].string not in ("import", "from")]
        for at in range(len(lines) - SAME_LINES + 1):
            run = lines[at : at + SAME_LINES]
            shape = shape_of([row for _, row in run])
            if len(shape) >= SAME_TOKENS:
                runs[shape].append({(path, number) for number, _ in run})
    # A table's rows repeat themselves; only runs apart from each other count.
    again = [same for same in runs.values() if any(not same[0] & other for other in same[1:])]
    return len({line for same in again for run in same for line in run})


def shape_of(rows: list[list[tokenize.TokenInfo]]) -> tuple[object, ...]:
    """Tokens of some lines, names numbered as they come, numbers and strings by kind."""
    names: dict[str, int] = {}
    shape: list[object] = []
    for token in (token for row in rows for token in row):
        kinds = {tokenize.NUMBER: "number", tokenize.STRING: "string"}
        shape.append(kinds.get(token.type, token.string))
        if token.type == tokenize.NAME:
            shape[-1] = names.setdefault(token.string, len(names))
    return tuple(shape)


def is_number(node: ast.AST) -> bool:
    """Whether a node is a number as it stands."""
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def bare(nodes: list[ast.AST]) -> int:
    """Numbers that stand in comparisons without a name."""
    sides = [s for n in nodes if isinstance(n, ast.Compare) for s in (n.left, *n.comparators)]
    return sum(is_number(s) and getattr(s, "value", 0) not in PLAIN_NUMBERS for s in sides)


def silent(path: Path, tree: ast.Module) -> int:
    """Named numbers at the top of a file that no word of origin follows or precedes."""
    lines, number = path.read_text("utf-8").splitlines(), 0
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        named = len(targets) == 1 and isinstance(targets[0], ast.Name) and targets[0].id.isupper()
        about = [lines[node.lineno - 2], lines[node.lineno - 1], lines[(node.end_lineno or 1) - 1]]
        told = is_text(after) or any("#" in line for line in about)
        number += named and not told and any(map(is_number, ast.walk(node.value)))
    return number


def statements(nodes: Iterable[ast.AST]) -> int:
    """How many statements, docstrings aside."""
    return sum(isinstance(node, ast.stmt) and not is_text(node) for node in nodes)


def rows(name: str) -> list[dict[str, str]]:
    """A table of this folder."""
    with (ROOT / "benchmarks" / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))


def by_folder(tree: Path) -> Counter[str]:
    """Statements of each folder that has a budget, its own folders included from the third on."""
    found: Counter[str] = Counter()
    for path in (path for paths in files_of(tree).values() for path in paths):
        parts = path.relative_to(tree).parent.parts
        nodes = ast.walk(ast.parse(path.read_text("utf-8")))
        found["/".join(parts[: 3 if parts[0] == "src" else 2])] += statements(nodes)
    return found


def ways(tree: Path, definitions: str) -> list[str]:
    """Which of the definitions, ``file:name``, stand in a tree; a file may stand for itself."""
    found = []
    for each in definitions.split():
        file, _, name = each.partition(":")
        text = (tree / file).read_text("utf-8") if (tree / file).exists() else ""
        if re.search(rf"^ *(def|class) {name}\b" if name else ".", text, re.MULTILINE):
            found.append(each)
    return found


def measure(tree: Path) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """All counts of a tree, by part and measure, and the definitions that nobody uses."""
    parts = files_of(tree)
    trees = {path: ast.parse(path.read_text("utf-8")) for paths in parts.values() for path in paths}
    packages = {path: trees[path] for path in parts["library"] + parts["challenge"]}
    code = {path: found for path, found in trees.items() if path not in parts["tests"]}
    by, dead = importers(packages), unused(tree, code)
    table: dict[str, dict[str, Any]] = {}
    for part, paths in parts.items():
        texts = [path.read_text("utf-8") for path in paths]
        nodes = [node for path in paths for node in ast.walk(trees[path])]
        functions = [node for node in nodes if isinstance(node, Function)]
        long = [f for f in functions if f.end_lineno and f.end_lineno - f.lineno >= 60]
        own = {path: trees[path] for path in paths if path in packages}
        among = importers(own)
        alone = [path for path in own if len(by[module_name(path)]) == 1]
        table[part] = {
            "files": len(paths),
            "statements": statements(nodes),
            "lines": sum(len(text.splitlines()) for text in texts),
            "files above 400 statements": sum(statements(ast.walk(trees[p])) > 400 for p in paths),
            "functions over 60 lines": len(long),
            "files with exactly one importer": len(alone),
            "definitions nobody uses": sum(tree / n.partition(":")[0] in paths for n in dead),
            "lines that stand twice": duplicates(paths),
            "floors of the diagnosis": floors(own),
            "circles of imports": circles((among, 2), (importers(tops(own)), 9)),
            "circles with types, and imports in functions": circles((among, 9)),
            "named numbers without a word of origin": sum(silent(p, trees[p]) for p in paths),
            "bare numbers in comparisons": bare(nodes),
        }
    return table, dead


def costs(tree: Path, *, tests: bool) -> dict[str, str]:
    """What starting costs beyond the bare interpreter, and the tests."""
    environment = {**os.environ, "PYTHONPATH": str(tree / "src")}

    def cpu_ms(*words: str) -> float:
        before = getrusage(RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *words], env=environment, capture_output=True)
        after = getrusage(RUSAGE_CHILDREN)
        return 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)

    def start(*words: str) -> str:
        return f"{median(cpu_ms(*words) - cpu_ms('-c', 'pass') for _ in range(STARTS)):.0f} ms"

    found = {
        "CPU of `import pendpipe`": start("-c", "import pendpipe"),
        "CPU of `pendpipe --version`": start("-m", "pendpipe.cli", "--version"),
    }
    for what, again in SECOND.items():
        call = [sys.executable, "-c", ENTERED % again]
        run = subprocess.run(call, cwd=tree, env=environment, capture_output=True, text=True)
        found[f"files, functions entered by a second {what}"] = run.stdout.strip() or "none"
    if tests:
        call = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist", "worksteal"]
        paths = os.pathsep.join(str(tree / part) for part in ("src", "challenge/src", "."))
        run = subprocess.run(
            call, cwd=tree, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True
        )
        found["tests"] = (run.stdout.strip().splitlines() or ["none"])[-1]
    return found


def git(*words: str) -> bytes:
    """What git prints."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, check=True).stdout


def copy_of(commit: str | None, folder: Path) -> Path:
    """A commit's files, or the working tree's that are tracked, in a new folder."""
    found = commit or git("stash", "create").decode().strip() or "HEAD"
    with tarfile.open(fileobj=io.BytesIO(git("archive", found))) as archive:
        archive.extractall(folder / str(commit), filter="data")
    return folder / str(commit)


def main() -> None:
    """Print the tables; a commit's beside the working tree's."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--commit", metavar="REF", help="a commit to set beside the working tree")
    parser.add_argument("--list", action="store_true", help="name the definitions nobody uses")
    parser.add_argument("--tests", action="store_true", help="run the suites, on two cores")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        trees = {"here": copy_of(None, Path(folder))}
        if arguments.commit:
            trees = {arguments.commit: copy_of(arguments.commit, Path(folder)), **trees}
        found = {name: measure(tree) for name, tree in trees.items()}
        prices = {name: costs(tree, tests=arguments.tests) for name, tree in trees.items()}
        sizes = {name: by_folder(tree) for name, tree in trees.items()}
        several = [
            (row["concept"], [len(ways(tree, row["definitions"])) for tree in trees.values()])
            for row in rows("concepts.tsv")
        ]
    parts = list(found["here"][0])
    heads = [f"{part}, {name}" for part in parts for name in trees]
    print(head("", *heads))
    for what in found["here"][0]["library"]:
        print(table_row(what, [found[n][0][part][what] for part in parts for n in trees]))
    print("", head("", *trees), sep="\n")
    for what in prices["here"]:
        print(table_row(what, [prices[name][what] for name in trees]))
    print("", head("ways to the same thing", *trees), sep="\n")
    for concept, numbers in several:
        print(table_row(concept, numbers))
    print("", head("statements of", "f501561d", "budget", *trees), sep="\n")
    for row in rows("budgets.tsv"):
        here = [sizes[name][row["folder"]] for name in trees]
        print(table_row(row["folder"], [row["f501561d"], row["budget"], *here]))
    if arguments.list:
        print("\nNobody uses:", *found["here"][1], sep="\n- ")


if __name__ == "__main__":
    main()
