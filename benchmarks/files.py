"""Are others' files read right, are their periods right, is a green light ever false.

    python -m benchmarks.files [--only NAME] [--number N]
    python -m benchmarks.files --drawn 300
    python -m benchmarks.files --why

Four collections beside the project, in ../shared, each with what is known of it: the files of
`tests/formats/shared_files.tsv`; `strangers/second` and `third`, whose raw files are read there in
a simple way of their own and have a period found by hand, or by the crossings of the level; and
`inputs4`, whose answers stand in `files.tsv`. A green light is false where the period, or a Q that
is known, lies outside its band.

``--drawn`` asks tables in dialects instead, as `tests/formats/test_dialects.py` draws them from the
hash of the commit at work, and ``--why`` prints how five of that folder's samples are understood.
"""

from __future__ import annotations

import csv
import hashlib
import importlib
import json
import re
import sys
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final
from unittest.mock import patch

import numpy as np

from benchmarks.house import git
from benchmarks.journal import ROOT, answers, judge_parser
from benchmarks.known_physics import run
from benchmarks.table import head, share, table_row
from pendpipe.formats import inspect

SHARED: Final = ROOT.parent / "shared"
KINDS: Final = Path(__file__).with_suffix(".tsv")
LIMIT_S: Final = 120.0
"""CPU seconds of a fit, as in the third collection's own judge."""
Row = dict[str, Any]


@cache
def judge_of(place: str, name: str) -> Any:
    """The module that a collection of others brings."""
    sys.path.insert(0, str(SHARED / "strangers" / place))
    return importlib.import_module(name)


def rows() -> list[tuple[str, str]]:
    """Every file: its collection, and its name there; of `second` those that are in no other."""
    taken = {
        hashlib.sha256(path.read_bytes()).digest()
        for path in (SHARED / "recordings").rglob("*")
        if path.is_file()
    }
    second = judge_of("second", "cases")
    files = dict.fromkeys(case["file"] for case in second.CASES)
    others = [
        name
        for name in files
        if hashlib.sha256(Path(second.p(name)).read_bytes()).digest() not in taken
    ]
    return [
        *(("recordings", row["file"]) for row in of_shared_files()),
        *(("second", name) for name in others),
        *(("third", case["id"]) for case in of_third()),
        *(("inputs4", row["file"]) for row in kinds()),
    ]


def of_shared_files() -> list[Row]:
    """What is known of ../shared/recordings and inputs."""
    return list(importlib.import_module("tests.formats.test_shared_recordings").FILES)


def of_third() -> list[Row]:
    """What is known of ../shared/strangers/third."""
    text = (SHARED / "strangers/third/cases.json").read_text("utf-8")
    return list(json.loads(text)["cases"])


def kinds() -> list[Row]:
    """What is known of ../shared/inputs4."""
    with KINDS.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream, delimiter="\t", quoting=csv.QUOTE_NONE))


def ask(row: tuple[str, str]) -> Row:
    """Judge one file: `read` and `period` (none where nothing is known), `light`, and why."""
    return dict(ASKED[row[0]](row[1]))


def _recording(name: str) -> Row:
    tests = importlib.import_module("tests.formats.test_shared_recordings")
    known = next(row for row in of_shared_files() if row["file"] == name)
    try:
        tests.test_a_shared_file_is_read_right_or_refused_for_its_reason(known)
    except BaseException as fault:  # pytest's failures are no exceptions of the usual kind
        return {"read": False, "why": " ".join(str(fault).split())[:200]}
    return {"read": True}


def _second(name: str) -> Row:
    cases = [case for case in judge_of("second", "cases").CASES if case["file"] == name]
    first = cases[0]
    is_none = first["expect"] in ("not-analysable", "cut-or-refuse")
    case = {"file": judge_of("second", "cases").p(name), "outcome": "right", "loader": {}}
    case |= {"fit": "period or none" if is_none else "period", "period_s": (0.0, np.inf)}
    if not is_none:
        bands = [_band(*each["load"](), each["start"], each["stop"]) for each in cases]
        case |= {"period_s": (min(low for low, _ in bands), max(high for _, high in bands))}
    readings = [_wanted(*each) for each in _also_right(name)]
    readings += [_wanted(*each["load"](), each["unit"]) for each in cases]
    return _by_third(case, readings)


def _also_right(name: str) -> list[tuple[Any, Any, str]]:
    """What else may be read of a file: another run, the position itself, the header's unit."""
    second = judge_of("second", "cases")
    if name.startswith("Sven"):
        text = Path(second.p(name)).read_text("utf-8-sig").partition("\n")[0]
        runs = sorted(set(re.findall(r"Angle, Ch 1\+2 \(rad\) Run #(\d+)", text)))
        return [(*second.capstone(name, int(run)), "rad") for run in runs]
    if name.endswith("QFactorGraph2.txt"):
        # Stamps of three digits: by a line through all, where the collection's judge takes 30 Hz.
        stamps, values = second.table(name, (1, 0))
        rows = np.arange(len(stamps))
        return [(np.polynomial.Polynomial.fit(rows, stamps, 1)(rows), values, "m")]
    if name.endswith("10deg_long.txt"):
        # Stamps of three digits: where the collection's judge counts at 30 Hz, six are missing.
        return [(*_with_lost_frames(*second.table(name, (0, 1)), 30.0), "deg")]
    unit = {"data3.txt": "px", "pendulum_lab_1_data.txt": "px", "angles.txt": "deg"}
    asked = unit.get(Path(name).name)
    return [(*second.table(name, (0, 1)), asked)] if asked else []


def _with_lost_frames(time: Any, values: Any, rate_hz: float) -> tuple[Any, Any]:
    """Count rows at a rate, and frames that are lost in the middle of periods that they shorten."""
    rest = values - np.median(values)
    up = np.flatnonzero((rest[:-1] < 0.0) & (rest[1:] >= 0.0))
    lasted = np.diff(up - rest[up] / (rest[up + 1] - rest[up]))
    short = np.median(lasted) - lasted
    # Periods scatter by half a frame.
    lost, count = np.where(short > 0.75, np.rint(short), 0.0), np.zeros(len(time))
    count[up[:-1] + round(float(np.median(lasted)) / 2)] = lost
    return time[0] + (np.arange(len(time)) + np.cumsum(count)) / rate_hz, values


def _wanted(time: Any, values: Any, unit: str) -> tuple[Any, ...]:
    known = judge_of("", "check_third").BASE
    free = {"any_scale": unit not in known, "units_ok": ["rad", "1"]}
    return ("it", time, values, unit if unit in known else None, free)


def _band(time: Any, values: Any, start: float | None, stop: float | None) -> tuple[float, float]:
    """The shortest and longest period of most cycles, by the crossings of the median."""
    inside = (time >= (start or -np.inf)) & (time <= (stop or np.inf))
    time, rest = time[inside], values[inside] - np.median(values[inside])
    out = np.flatnonzero(np.abs(rest) > 0.25 * np.std(rest))
    up = out[:-1][(rest[out[:-1]] < 0.0) & (rest[out[1:]] > 0.0)]
    low, high = np.percentile(np.diff(time[up]), (5, 95))
    return 0.98 * float(low), 1.02 * float(high)


_BETTER_KNOWN: Final[dict[str, Row]] = {
    # One row a turning point, with its time in the third column, shows a decay, and no period.
    "amplitude-list": {
        "outcome": "right",
        "loader": {"kind": "text", "skip": 0, "t": 2, "sep": "\t"},
        "accept": [{"col": 0, "unit": "rad"}],
        "period_s": (0.0, 0.0),
    },
    # The app's 1.301 s is that of swings of 31 degrees, 1.9 % longer than that of small ones.
    "phyphox-pendulum-xls": {"period_s": [1.263, 1.311]},
}
"""What the third collection's judge does not know of its files."""


def _third(identifier: str) -> Row:
    case = next(case for case in of_third() if case["id"] == identifier)
    return _by_third(case | _BETTER_KNOWN.get(identifier, {}), None)


def _by_third(case: Row, readings: list[Any] | None) -> Row:
    """Ask the third collection's own judge, with readings of another's."""
    judge = judge_of("", "check_third")
    wanted = judge.wanted if readings is None else lambda _case: readings
    executable = str(Path(sys.executable).with_name("pendpipe"))
    plain = judge.read_plain

    def in_volts(path: str) -> tuple[Any, ...]:
        """Give the unit that the name of the plain form's column states."""
        name, unit, *rest = plain(path)
        return (name, "V" if name == "volts" else unit, *rest)

    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(judge, "wanted", wanted),
        patch.object(judge, "read_plain", in_volts),
    ):
        read, fit, why, told, *_ = judge.check(executable, case, folder)
    light = [*re.findall(r"\b(green|amber|red)\b", told), "none"][0]
    fit = None if fit is None or case["fit"] == "none" else bool(fit)
    return {"read": bool(read), "period": fit, "light": light, "why": f"{why} | {told}"[:300]}


def _kind(name: str) -> Row:
    known = next(row for row in kinds() if row["file"] == name)
    done = run("fit", [str(SHARED / "inputs4" / name), *known["options"].split()], LIMIT_S)
    said = f"{json.dumps(done['content'], ensure_ascii=False)} {done['said']}"
    odd = known["silent_of"] and re.search(known["silent_of"], said)
    right = bool(re.search(known["says"], said)) and not odd
    light, period = done["content"].get("light", "none"), _value(done["content"].get("period"))
    quality = _value(([*(done["content"].get("quality_factors") or []), None])[0])
    bands = [
        not band or float(band[0]) * 0.995 <= found <= float(band[-1]) * 1.005
        for band, found in (
            (known["period_s"].split(), period),
            (known["quality"].split(), quality),
        )
    ]
    numbers, shown = (
        all(bands),
        f"T {period:.6g} s, Q {quality:.4g}, {light}; {done['said'].strip()[-160:]}",
    )
    return {
        "read": right,
        "period": numbers and known["light"] in ("any", light),
        "light": light,
        "why": shown,
    }


def _value(estimate: Any) -> float:
    value = (estimate or {}).get("value")
    return float("nan") if value is None else float(value)


ASKED: Final = {"recordings": _recording, "second": _second, "third": _third, "inputs4": _kind}


WHY: Final = (
    "plain_table/a_clock_begins_again_beside_three_digits.csv",
    "plain_table/nul_bytes_and_two_rows_in_one.txt",
    "windaq/swing.wdh",
    "seismograph/sac.txt",
    "swings/matlab-a-clock-that-is-infinite-twice.mat",
)
"""Samples of `tests/formats` whose clocks, damage, scale and units are found in different ways."""


def why() -> int:
    """Print the facts of five files."""
    for name in WHY:
        print(name, *inspect(ROOT / "tests/formats" / name).why, sep="\n  ")
    return 0


def drawn(number: int) -> int:
    """Read tables in dialects drawn from the commit's hash; none may be wrong without a word."""
    dialects = importlib.import_module("tests.formats.test_dialects")
    hash_at_work = git("rev-parse", "HEAD").decode().strip()
    random, counts = Random(hash_at_work), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        for place in range(1, number + 1):
            sample = dialects.draw(random)
            found, said = dialects.outcome(Path(folder) / "recording.txt", sample)
            counts[found] += 1
            if found == "wrong":
                print(f"* {place}: {sample.story}: {said}")
    print(f"{number} tables of commit {hash_at_work[:8]}: {dict(counts)}")
    return int(counts["wrong"] > 0)


def main() -> int:
    """Ask what was not asked of this code yet; print the rows that fail and a line a collection."""
    parser = judge_parser(__doc__, "files", 0)
    parser.add_argument("--only", default="", help="part of a name")
    parser.add_argument("--drawn", type=int, default=0, help="tables of dialects")
    parser.add_argument("--why", action="store_true", help="the facts of five files")
    told = parser.parse_args()
    if told.why or told.drawn:
        return why() if told.why else drawn(told.drawn)
    wanted = [row for row in rows() if told.only in "/".join(row)][: told.number or None]
    judged = list(
        zip(
            wanted,
            answers(told, wanted, ask, ("src/pendpipe/**/*.py", "benchmarks/files.*")),
            strict=True,
        )
    )
    for (place, name), found in judged:
        false = found.get("light") == "green" and found.get("period") is False
        if not found["read"] or found.get("period") is False:
            marks = " ".join(
                word
                for word, bad in (
                    ("READ", not found["read"]),
                    ("PERIOD", found.get("period") is False),
                    ("GREEN AND FALSE", false),
                )
                if bad
            )
            print(f"* {place} {name}: {marks}: {found.get('why', '')}")
    titles = ("collection", "read right", "periods right", "green", "green and false")
    print("", head(*titles), sep="\n")
    for place in ASKED:
        here = [found for (where, _), found in judged if where == place]
        fits = [found for found in here if found.get("period") is not None]
        green = [found for found in fits if found["light"] == "green"]
        false = sum(not found["period"] for found in green)
        right = share(sum(found["read"] for found in here), len(here))
        periods = share(sum(found["period"] for found in fits), len(fits))
        print(table_row(place, (right, periods, len(green), false)))
    return int(any(f.get("light") == "green" and f.get("period") is False for _, f in judged))


if __name__ == "__main__":
    sys.exit(main())
