"""How often `pendpipe diagnose` is right: nulls, single effects, pairs, and what is outside.

The recordings come from the challenge's generator, which shares no code with what it judges;
its oracle knows nuisances, noise and catalogue, and pays the same look-elsewhere. Every
recording's outcome is kept under ``.evidence/diagnosis.jsonl`` with a digest of the code, so
that a run can be broken off and taken up, and is begun anew where the code has changed;
`python -m benchmarks.diagnosis` makes what is missing and writes the table
to ``docs/diagnosis.md``. ``--part 0.1`` makes a tenth of it, ``--nulls 500`` that many nulls.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

import pendpipe_challenge
from benchmarks.diagnosis_table import BESIDE, table
from pendpipe.provenance import code_version
from pendpipe_challenge.sets import process_pool

if TYPE_CHECKING:
    from pendpipe.diagnosis.refine import Fit
    from pendpipe.diagnosis.run import Outcome


def over_one(outcome: Outcome, truths: Sequence[str]) -> float:
    """By how much chi^2 (two a free value counted) two effects are better than the best single.

    Singles are the baseline alone, each true effect, all that the search refitted first, and
    its answer where that is one effect; pairs are the true ones, each found behind the other,
    and the answer where it holds two. Infinite where the true pair can't be fitted: it counts
    as needed then.
    """
    from pendpipe.diagnosis.weighing import refitted

    found, held = outcome.search, outcome.beginning.held
    singles, pairs = [found.baseline, *_answer(outcome, 1)], _answer(outcome, 2)
    for first, second in permutations(truths, 2):
        alone = _added(outcome, found.baseline, first)
        singles += alone
        pairs += [both for one in alone for both in _added(outcome, one, second)]
    rivals = found.steps[0].rivals if found.steps else ()
    fits = [refitted(found.baseline, found, held, rival) for rival in rivals]
    singles += [fit for fit in fits if fit is not None]

    def cost(fit: Fit) -> float:
        return fit.chi2 + 2.0 * len(fit.free)

    return min(map(cost, singles)) - min(map(cost, pairs), default=-math.inf)


def _answer(outcome: Outcome, effects: int) -> list[Fit]:
    found = outcome.search
    return [found.improved] if len(found.steps) == effects else []


def _added(outcome: Outcome, base: Fit, name: str) -> list[Fit]:
    """The fit with one more effect of a given name, at the shape its scan finds, if it moves."""
    from pendpipe.diagnosis.detect import detect, prepare
    from pendpipe.diagnosis.refits import refit_leads
    from pendpipe.diagnosis.state import is_gross
    from pendpipe.effects.catalogue import by_identifier

    found = outcome.search
    scanner = prepare(base, found.data, found.noise, [by_identifier(name)])
    lead = detect(scanner, base, seed=0, known=found.detection)
    rivals = refit_leads(
        base,
        found.data,
        found.noise,
        lead,
        held=outcome.beginning.held,
        phase_lost=is_gross(base, found.data),
    )
    return [rival.fit for rival in rivals]


JOURNAL: Final = Path(".evidence/diagnosis.jsonl")
PAGE: Final = Path("docs/diagnosis.md")
MARK: Final = "These tables are made by `make evidence`."
EFFECTS: Final = (
    "circular-error",
    "cubic-stiffness",
    "quadratic-stiffness",
    "power-law-damping",
    "stribeck-friction",
    "presliding-friction",
    "second-mode",
    "plane-coupling",
    "periodic-drive",
    "frequency-drift",
    "damping-drift",
    "equilibrium-creep",
    "equilibrium-step",
    "impulse",
    "sensor-quadratic",
    "sensor-cubic",
    "offset-drift",
    "tone-pickup",
    "jitter",
    "glitches",
)
SIZES: Final = (9.0, 16.0, 25.0, 50.0, 100.0)
PAIRS: Final = (
    ("cubic-stiffness", "tone-pickup"),
    ("cubic-stiffness", "frequency-drift"),
    ("quadratic-stiffness", "offset-drift"),
    ("sensor-cubic", "circular-error"),
    ("equilibrium-step", "second-mode"),
    ("sensor-quadratic", "impulse"),
)


class Case(NamedTuple):
    """One recording to be made and diagnosed."""

    family: str
    names: tuple[str, ...]
    size: float
    number: int

    @property
    def key(self) -> str:
        """What it is known by in the journal."""
        return f"{self.family}:{'+'.join(self.names)}:{self.size:g}:{self.number}"


def cases(part: float, nulls: int | None = None) -> Iterator[Case]:
    """All recordings of the evidence, or a part of each kind (nulls may be given by number)."""
    from pendpipe_challenge.items import outside_names

    def numbers(whole: int) -> range:
        return range(max(1, round(part * whole)))

    for number in numbers(1000) if nulls is None else range(nulls):
        yield Case("null", (), 0.0, number)
    for number in numbers(20):
        for name in EFFECTS:
            for size in SIZES:
                yield Case("single", (name,), size, number)
    for number in numbers(20):
        for pair in PAIRS:
            yield Case("pair", pair, 400.0, number)
            yield Case(BESIDE, pair, 400.0, number)
        for name in outside_names():
            yield Case("outside", (name,), 200.0, number)


def seed_of(case: Case) -> list[int]:
    """What a recording is drawn from."""
    return [case.number, round(case.size), *map(ord, case.family + "".join(case.names))]


def made(case: Case) -> Any:
    """Make a recording, with its truth."""
    from pendpipe_challenge.items import make_null, make_outside, make_pair, make_single

    random = np.random.default_rng(seed_of(case))
    if case.family == "null":
        return make_null(random)
    if case.family == "single":
        return make_single(random, case.names[0], case.size, oracle=True)
    if case.family in ("pair", BESIDE):
        sizes, beside = (case.size, case.size), case.family == BESIDE
        own_form = True if beside else None
        return make_pair(random, *case.names, sizes, marginal=beside, own_form=own_form)
    return make_outside(random, case.names[0], case.size)


def diagnosed(case: Case) -> dict[str, Any]:
    """Make and diagnose one recording."""
    import tempfile

    from pendpipe.diagnosis.run import diagnose_recording
    from pendpipe.dynamics.any_law import NoMotionError
    from pendpipe.errors import InputError
    from pendpipe.process import keep_memory
    from pendpipe.recording import read_plain
    from pendpipe_challenge.recordings import write_recording

    keep_memory()  # as the command does
    entry: dict[str, Any] = {
        "key": case.key,
        "family": case.family,
        "names": case.names,
        "size": case.size,
    }
    try:
        item = made(case)
    except ValueError as fault:
        return {**entry, "not_made": str(fault)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "recording.csv")
        write_recording(path, item.scenario, item.codes)
        recording = read_plain(path).as_motion()
    began = time.process_time()
    try:
        outcome = diagnose_recording(recording, baseline=item.truth["baseline"], seed=case.number)
    except (InputError, NoMotionError) as fault:
        return {**entry, "refused": str(fault)}
    cpu_s, found = time.process_time() - began, outcome.diagnosis
    oracle = item.truth.get("oracle") or {}
    return {
        **entry,
        "cpu_s": cpu_s,
        "p_value": found.p_value,
        "effects": [
            [effect.identifier, effect.probability, [name for name, _ in effect.indistinguishable]]
            for effect in found.effects
        ],
        "right": [[each["effect"], *(each.get("also") or [])] for each in item.truth["effects"]],
        "oracle": {name: oracle.get(name) for name in ("detected", "named", "class")},
        **({"over_one": over_one(outcome, case.names)} if len(case.names) == 2 else {}),
        "inside": _inside(item.truth, found.effects),
        **({"peers": _peers(item)} if _beside_peers(case) else {}),
    }


def _inside(truth: dict[str, Any], effects: Any) -> list[bool]:
    """Whether 95 % intervals hold the parameters, where the catalogue's own law was named."""
    from pendpipe_challenge.measures import expected

    if truth["family"] != "single" or not truth["effects"][0]["own_form"] or not effects:
        return []
    if effects[0].identifier != truth["effects"][0]["effect"]:
        return []
    told = effects[0].parameters
    return [
        told[name].interval95[0] <= true <= told[name].interval95[1]
        for name, true in expected(truth).items()
        if name in told and told[name].interval95 is not None
    ]


def _beside_peers(case: Case) -> bool:
    """Recordings that the peers judge as well: they take longer than the diagnosis."""
    if case.family == "null":
        return case.number < 20
    return case.number < 2 and (case.family == "outside" or case.size in (50.0, 100.0))


def _peers(item: Any) -> dict[str, Any]:
    """What others' ways make of the same recording: [something is missing, its name]."""
    from benchmarks import peers_diagnosis as peers

    nuisances = item.truth["nuisances"]
    time_s = np.arange(len(item.codes)) * item.scenario.interval_s
    kept = time_s <= nuisances["judged_until_s"]
    time_s, angle = time_s[kept], item.angle_rad[kept]
    noise = float(np.hypot(nuisances["white_sd_rad"], nuisances["step_rad"] / 12.0**0.5))
    try:
        base = peers.fit_eq8(time_s, angle, noise)
    except (ValueError, np.linalg.LinAlgError) as fault:
        return {"failed": str(fault)}
    white = nuisances["alpha"] == 0.0
    return {
        "AIC": peers.by_criterion(base, noise, white=white, criterion="aic"),
        "BIC": peers.by_criterion(base, noise, white=white, criterion="bic"),
        "whiteness": peers.by_whiteness(base),
        "pysindy": peers.by_sindy(time_s, angle, base.omega),
    }


@cache
def code() -> str:
    """Digest of what makes the recordings, diagnoses them, and says what is right."""
    digest = hashlib.sha256(code_version("pendpipe.diagnosis.run").encode())
    here = [Path(__file__), Path(__file__).with_name("peers_diagnosis.py")]
    for path in [*here, *sorted(Path(pendpipe_challenge.__file__).parent.glob("*.py"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def kept() -> dict[str, dict[str, Any]]:
    """Outcomes of this very code, by key."""
    if not JOURNAL.exists():
        return {}
    entries = map(json.loads, JOURNAL.read_text(encoding="utf-8").splitlines())
    return {entry["key"]: entry for entry in entries if entry.get("code") == code()}


def run(part: float, processes: int, nulls: int | None = None) -> list[dict[str, Any]]:
    """Make what is missing; return all outcomes."""
    JOURNAL.parent.mkdir(exist_ok=True)
    known, version = kept(), code()
    wanted = list(cases(part, nulls))
    todo = [case for case in wanted if case.key not in known]
    with process_pool(processes) as pool, JOURNAL.open("a", encoding="utf-8") as journal:
        made_by = [pool.submit(diagnosed, case) for case in todo]
        for done, outcome in enumerate(as_completed(made_by), start=1):
            entry = {**outcome.result(), "code": version}
            known[entry["key"]] = entry
            journal.write(json.dumps(entry, default=float) + "\n")
            journal.flush()
            if done % 20 == 0:
                print(f"{done} of {len(todo)}", flush=True)
    return [known[case.key] for case in wanted if case.key in known]


def main() -> None:
    """Run and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", type=float, default=1.0)
    parser.add_argument("--nulls", type=int, help="this many nulls, whatever the part")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--table", action="store_true", help="write the table of what there is")
    arguments = parser.parse_args()

    if arguments.table:
        outcomes = list(kept().values())
    else:
        outcomes = run(arguments.part, arguments.processes, arguments.nulls)
    text = table(outcomes)
    print(text)
    page = PAGE.read_text(encoding="utf-8")
    head = page[: page.index(MARK) + len(MARK)]
    PAGE.write_text(f"{head}\n\n{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
