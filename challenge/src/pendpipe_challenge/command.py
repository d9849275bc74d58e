"""Conceal effects in recordings, have `pendpipe diagnose` solve them, open, and score.

    pendpipe challenge make SET --sealed ELSEWHERE --items 600
    pendpipe challenge solve SET
    pendpipe challenge open SET --sealed ELSEWHERE
    pendpipe challenge score SET --out SCORES --page PROOF.md

`make` and `solve` go on where they were interrupted. The seed is drawn at run time unless it
is given, and is sealed with the truth.
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe challenge``."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser("make", help="make a set and seal its truth")
    _set(make, sealed=True)
    make.add_argument("--items", type=_count, default=600, help="how many (%(default)s)")
    make.add_argument("--seed", type=int, metavar="N", help="drawn where it is not given")
    make.add_argument("--ledger", type=Path, metavar="FILE", help="of every item ever made")
    make.add_argument("--workers", type=_count, default=1, help="processes")
    solve = actions.add_parser("solve", help="solve a set by pendpipe diagnose")
    _set(solve, sealed=False)
    solve.add_argument("--workers", type=_count, default=1, help="recordings at a time")
    opened = actions.add_parser("open", help="check the seals and open the truth, once")
    _set(opened, sealed=True)
    score = actions.add_parser("score", help="score an opened set")
    _set(score, sealed=False)
    score.add_argument("--out", type=Path, required=True, metavar="DIR", help="scores")
    score.add_argument("--page", type=Path, metavar="MD", help="write the page here")


def _set(parser: argparse.ArgumentParser, *, sealed: bool) -> None:
    parser.add_argument("set", metavar="SET", type=Path, help="the set's folder")
    if sealed:
        parser.add_argument(
            "--sealed", type=Path, required=True, metavar="DIR", help="the truth's folder, apart"
        )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of 1 or more")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Do one of the four."""
    return {"make": _make, "solve": _solve, "open": _open, "score": _score}[arguments.action](
        arguments
    )


def _make(arguments: argparse.Namespace) -> int:
    from pendpipe_challenge.sets import Places, make_set

    make_set(
        Places(arguments.set, arguments.sealed),
        arguments.items,
        seed=arguments.seed,
        workers=arguments.workers,
        ledger=arguments.ledger,
    )
    print(f"{arguments.set}: made and sealed; the truth is in {arguments.sealed}")
    return 0


def _solve(arguments: argparse.Namespace) -> int:
    from pendpipe_challenge.sets import solve_set

    solve_set(arguments.set, workers=arguments.workers)
    print(f"{arguments.set}: solved; the answers are hashed in answers.json")
    return 0


def _open(arguments: argparse.Namespace) -> int:
    from pendpipe_challenge.sets import Places, open_set

    print(f"{open_set(Places(arguments.set, arguments.sealed))}: opened, every hash holds")
    return 0


def _score(arguments: argparse.Namespace) -> int:
    from pendpipe.errors import InputError
    from pendpipe.files import read_json, replaced, write_json
    from pendpipe_challenge.score import page, score

    path = arguments.set / "opened.json"
    if not path.exists():
        raise InputError(path, "this set is not opened", "run pendpipe challenge open first")
    scores = score(read_json(path))
    write_json(arguments.out / "scores.json", scores)
    text = page(scores)
    with replaced(arguments.page or arguments.out / "proof.md") as stream:
        stream.write(text)
    print(text)
    return 0
