"""Sixty recordings, what is right to say of each, and what is said.

    python -m benchmarks.panel [--only NAME] [--processes 2]

A file of ``tests/panel`` describes a recording and what is right to say of it. Most are ``made`` by
the challenge's integrator, which shares nothing with the library: what is right follows from the
truth. Real ones are rows of `known_physics.tsv` (``record``), read in ``../shared``. `pp.fit` and
`pp.diagnose` are asked about the file, and judged by these questions, as far as a file has them:

``verdict``
    The same word; ``refused`` where there is nothing to be fitted.
``light``
    The lights that the fit may have. A green fit must be right whatever is asked: T0 within 5 %.
``one_of``
    One of these names leads, or is in the class of a name that does. With ``also`` they are all
    that may lead: other leading names are false.
``numbers``
    By a parameter's path in the answer (``frequency``, ``fit.frequency``, ``impulse.time``):
    ``[truth, sd]``. The answer is at most 4 of its own sd off, and that sd is at most this one.
    A third number says how far the truth itself is in doubt.
``known``
    Of a real recording: what its row of the table knows, and names that would be wrong.

A recording that is to be ``drawn`` has its figures and its page made, too.

What is answered wrongly today stands in ``missed``, by question, with what is said instead.
"""

from __future__ import annotations

import contextlib
import json
import math
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks import known_physics as known, null_families as nulls
from benchmarks.journal import ROOT, answers, judge_parser
from benchmarks.table import head, table_row
from pendpipe.files import finite, without_folders, write_whole
from pendpipe.report.page import render_recording
from pendpipe_challenge.causes import CATALOGUE, OUTSIDE
from pendpipe_challenge.items import recorded
from pendpipe_challenge.world import Cause, Scene

FOLDER: Final = ROOT / "tests" / "panel"
NAMES: Final = tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))
GRAVITY: Final = 9.80665
TITLES: Final = {
    "angle": "angle (rad)",
    "rate": "gyroscope (rad/s)",
    "position": "x (m)",
    "volts": "voltage (V)",
    "counts": "counts",
}
"""What a sensor shows of the motion, and the head of its column."""
OFF_SD: Final = 4.0
"""One right number in 16,000 is further off; the panel has some 200."""
GREEN: Final = 0.05
"""What a green light promises of the period."""
Content = Mapping[str, Any]


def entry_of(name: str) -> dict[str, Any]:
    """What a file says of a recording, and the row of a real one."""
    entry = tomllib.loads((FOLDER / f"{name}.toml").read_text("utf-8"))
    rows = [row for row in known.table() if row["record"] == entry.get("record")]
    return {**entry, "row": rows[0] if rows else None}


def scene_of(made: Content) -> Scene:
    """The pendulum and its sensor; Eq. 8's rates are a, b viscous, b hysteretic, c."""
    count = int(made["duration_s"] * made["rate_hz"])
    return Scene(
        apparatus=made.get("apparatus", "laboratory"),
        frequency_hz=made["frequency_hz"],
        rates=tuple(made["rates"]),
        amplitude=made["amplitude"],
        lead_s=made.get("lead_s", 0.3),
        offset=made.get("offset", 0.01 * made["amplitude"]),
        noise_rms=made["noise"],
        step=made.get("step", 0.0),
        time_s=np.arange(count) / made["rate_hz"],
        event_driven=made.get("events", False),
        place=made.get("place", 0.5),
    )


def made_of(made: Content) -> str:
    """The text of the file that the apparatus writes."""
    rng, scene = np.random.default_rng(made["seed"]), scene_of(made)
    causes = []
    for cause in made.get("causes", []):
        laws = {law.form: law for law in (CATALOGUE | OUTSIDE)[cause["effect"]]}
        law = laws[cause["form"]]
        causes.append(Cause(law.effect, law.draw(rng, scene), cause.get("size", law.size)))
    family = nulls.FAMILIES[made.get("kind_of_noise", "white")]

    def shown(r: np.random.Generator, seen: Any, y: Any, level: Any, rms: float) -> Any:
        scale = made.get("scale", 1.0)
        of = {"rate": seen.v, "position": GRAVITY / scene.omega**2 * np.sin(y)}
        value = of.get(made.get("seen", "angle"), y) * scale
        return family(r, nulls.Swing(seen.time_s, value, level * scale, rms))

    columns = recorded(rng, scene, causes, shown)
    if columns is None:
        raise ValueError("too few events, or too many")
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [f"{t:.9g},{y:.9g}" for t, y in rows]
    return "\n".join([f"time (s),{TITLES[made.get('seen', 'angle')]}", *lines, ""])


@contextlib.contextmanager
def file_of(entry: Content) -> Iterator[Path]:
    """The recording, where it lies or as it is made."""
    if entry["row"]:
        yield known.RECORDINGS / entry["row"]["file"]
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.csv"
        path.write_text(made_of(entry["made"]), encoding="utf-8")
        yield path


def absent(name: str) -> bool:
    """Whether a recording lies in ../shared, and that is not here."""
    row = entry_of(name)["row"]
    return bool(row) and not (known.RECORDINGS / row["file"]).exists()


def ask(name: str, folder: Path | None = None) -> dict[str, Any]:
    """What `pp.fit` and `pp.diagnose` answer, as JSON and in words, and CPU seconds.

    Where a recording is to be drawn, its figures and its page are written into the folder.
    """
    import pendpipe as pp

    entry, answer = entry_of(name), {}
    with file_of(entry) as path:
        before = time.process_time()
        words = known.options(entry["row"]) if entry["row"] else {}
        found: dict[str, Any] = {}
        for verb in ("fit", "diagnose"):
            try:
                recording = pp.read(path, **words)
                found[verb] = getattr(pp, verb)(recording)
                answer[verb] = finite(found[verb].to_dict()) | {"said": str(found[verb])}
            except pp.InputError as error:
                refused = {"verdict": "refused", "light": "refused"}
                answer[verb] = refused | {"said": without_folders(str(error))}
        answer["cpu_s"] = time.process_time() - before
        if "fit" in found and found["fit"].decay:
            answer["fit"]["kept_s"] = found["fit"].decay.time_s[[0, -1]].tolist()
        if folder and entry.get("drawn"):
            found["diagnose"].save(folder)
            fit = replace(found["fit"], provenance={"version": "", "input_sha256": ""})
            page = render_recording(name, recording, fit, found["diagnose"])
            (folder / "page.html").write_text(page, encoding="utf-8")
    return answer


def once(folder: Path, name: str) -> dict[str, Any]:
    """The answer about a recording, asked by the first of several processes that wants it."""
    import fcntl

    own = folder / name
    own.mkdir(parents=True, exist_ok=True)
    with (own / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        kept = own / "answer.json"
        if not kept.exists():
            write_whole(kept, json.dumps(ask(name, own)))
        return json.loads(kept.read_text("utf-8"))  # type: ignore[no-any-return]


def classes(answer: Content) -> dict[str, list[str]]:
    """By the first name of each effect that is named: its class."""
    return {
        each["id"]: [each["id"], *(other["id"] for other in each["indistinguishable_from"])]
        for each in answer["diagnose"].get("effects", [])
    }


def presumed(answer: Content) -> set[str]:
    """Effects that the fit has."""
    return {each["id"] for each in answer["diagnose"].get("effects", []) if each["presumed"]}


def estimate(answer: Content, path: str) -> tuple[float, float]:
    """Value and sd at a path; not a number where the answer has none."""
    place, _, name = path.rpartition(".")
    diagnosis = answer["diagnose"]
    effects = [each for each in diagnosis.get("effects", []) if each["id"] == place]
    holder = {"": diagnosis.get("improved", {}), "fit": answer["fit"]}.get(place)
    holder = holder or (effects[0] if effects else {})
    found = holder.get("parameters", {}).get(name, {})
    value, sd = (math.nan if found.get(key) is None else found[key] for key in ("value", "sd"))
    return value, sd


def judge(entry: Content, answer: Content) -> dict[str, str]:
    """By question: nothing if the answer is right, else what is said instead."""
    right, found = entry["right"], classes(answer)
    verdict, light = answer["diagnose"]["verdict"], answer["fit"]["light"]
    said = {}
    if "verdict" in right:
        said["verdict"] = "" if verdict == right["verdict"] else verdict
    if "light" in right:
        said["light"] = "" if light in right["light"] else light
    for names in right.get("one_of", []):
        hit = any(not set(names).isdisjoint(each) for each in found.values())
        said[f"class of {names[0]}"] = "" if hit else "not named"
    if "made" in entry:
        true = {*chain(*right.get("one_of", [])), *right.get("also", [])}
        false = {lead for lead, each in found.items() if true.isdisjoint(each)}
        said["false names"] = ", ".join(sorted(false - presumed(answer)))
        truth, value = entry["made"]["frequency_hz"], estimate(answer, "fit.frequency")[0]
        if light == "green":
            said["green"] = "" if abs(value / truth - 1.0) < GREEN else f"{value:.6g} Hz"
    for path, (truth, most, *unsure) in right.get("numbers", {}).items():
        value, sd = estimate(answer, path)
        # Where another name of the class leads there is no such number.
        if not (math.isnan(value) and path.partition(".")[0] not in ("fit", path)):
            hit = abs(value - truth) <= OFF_SD * sd + sum(unsure) and sd <= most
            said[path] = "" if hit else f"{value:.6g} ± {sd:.2g}"
    if entry["row"]:
        answers = known.Answers(
            {**answer["fit"], "content": answer["fit"]},
            {"content": answer["diagnose"], "status": 0, "said": ""},
        )
        for item in known.items(entry["row"]["known"]):
            said[item] = "" if known.is_found(item, answers) else "not found"
        said["wrong names"] = ", ".join(set(found) & set(entry["row"]["wrong"].split("/")))
    return said


def line(name: str, entry: Content, answer: Content) -> tuple[str, list[str]]:
    """What changed against what is expected, and the row of a table."""
    said, missed = judge(entry, answer), entry.get("missed", {})
    wrong = {question: words for question, words in said.items() if words}
    new = [f"**{q}: {words}**" for q, words in wrong.items() if q not in missed]
    mended = [f"mended: {q}" for q in missed if q not in wrong]
    other = [f"{q}: {words}" for q, words in wrong.items() if missed.get(q, words) != words]
    state = "worse" if new else "better" if mended else "missed" if missed else "right"
    names = "; ".join(
        f"{each['id']} {each['probability']:.2f}"
        for each in answer["diagnose"].get("effects", [])
        if not each["presumed"]
    )
    cells = [
        state,
        answer["diagnose"]["verdict"],
        names,
        answer["fit"]["light"],
        "; ".join([*new, *mended, *other] or [f"{q}: {words}" for q, words in wrong.items()]),
        f"{answer['cpu_s']:.1f}",
    ]
    return state, [name, *cells]


def main() -> None:
    """Print a row a recording: what is right, what is known to be missed, and what changed."""
    parser = judge_parser(__doc__, "panel", 0)
    parser.add_argument("--only", action="append", default=[], help="part of a name; repeatable")
    told = parser.parse_args()
    names = [n for n in NAMES if any(part in n for part in told.only or [""]) and not absent(n)]
    names = names[: told.number or None]
    sources = ("src/pendpipe/**/*.py", "benchmarks/panel.py", "tests/panel/*.toml")
    titles = ("recording", "", "verdict", "named", "light of the fit", "wrong", "CPU s")
    print(head(*titles), flush=True)
    states, cpu_s = [], 0.0
    for name, answer in zip(names, answers(told, names, ask, sources), strict=True):
        state, cells = line(name, entry_of(name), answer)
        states.append(state)
        cpu_s += answer["cpu_s"]
        print(table_row(cells[0], cells[1:]), flush=True)
    right = sum(state in ("right", "better") for state in states)
    print(f"\n{right} of {len(names)} right, {cpu_s:.0f} CPU s; worse: {states.count('worse')}")


if __name__ == "__main__":
    main()
