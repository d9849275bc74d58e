"""Several recordings of one pendulum against one: what three amplitudes settle.

    python -m benchmarks.joint --sets 40 --journal FILE      three amplitudes, simulated
    python -m benchmarks.joint --real --journal FILE         pendulums of ../shared/recordings
    python -m benchmarks.joint --page docs/several.md --journal FILE

Simulated sets come from the integrator of `benchmarks.apparatus`, which shares no code with the
library. An effect has the size at which an oracle, who knows the law and all other values, gains
Delta chi^2 of 60 to 600: in one half of the sets from the three recordings together, in the other
from the largest release alone. The oracle's class: the kinds among the
eight whose best size leaves no more than 6 of that. Finished sets are kept in the journal.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.interpolate import CubicHermiteSpline

import pendpipe as pp
from benchmarks.apparatus.motion import PARAMETERS, TIMES, Array, P, T, integrate
from pendpipe.diagnosis.several import diagnose_several
from pendpipe.errors import InputError
from pendpipe.recording import Recording

AMPLITUDES: Final = (0.05, 0.15, 0.4)
KINDS: Final = {
    "nothing": "",
    "cubic-damping": "d",
    "power-law-damping": "f",
    "stribeck-friction": "f",
    "damping-drift": "t",
    "frequency-drift": "t",
    "cubic-stiffness": "k",
    "quadratic-stiffness": "k",
    "sensor-cubic": "s",
}
"""What is hidden, by the identifier of the catalogue."""
_START_SIZES: Final = {
    "cubic-damping": 1e-2,
    "power-law-damping": 1e-5,
    "stribeck-friction": 1e-4,
    "damping-drift": 1e-7,
    "frequency-drift": 1e-7,
    "cubic-stiffness": 1e-3,
    "quadratic-stiffness": 1e-3,
    "sensor-cubic": 1e-3,
}
_SAME: Final = 6.0
_STRONGEST: Final = 1e5
"""Largest Delta chi^2 of all three: beyond, the law itself would be another."""
_MARK: Final = "<!-- measured -->"
_STEPS: Final = 200
_REAL: Final = "../shared/recordings"


def drawn(seed: int) -> dict[str, Any]:
    """Draw a pendulum, its sampling, what is hidden and how strong it is."""
    rng = np.random.default_rng([24, seed])
    kind = list(KINDS)[seed % len(KINDS)]
    return {
        "kind": kind,
        "frequency_hz": float(rng.uniform(0.6, 1.3)),
        "viscous": float(np.exp(rng.uniform(np.log(3e-3), np.log(1e-2)))),
        "coulomb": float(np.exp(rng.uniform(np.log(5e-5), np.log(4e-4)))),
        "drag": float(np.exp(rng.uniform(np.log(1e-3), np.log(2e-2)))),
        "noise_rad": float(np.exp(rng.uniform(np.log(6e-5), np.log(2e-4)))),
        "gain": float(np.exp(rng.uniform(np.log(60.0), np.log(600.0)))),
        "sized_by": "alone" if seed // len(KINDS) % 2 else "together",
        "duration_s": 120.0,
        "rate_hz": 12.0,
    }


def reading(scene: dict[str, Any], amplitude: float, kind: str, size: float) -> Array:
    """Return what a noiseless sensor reads, shape (n,); a name of `_TANGENT` varies a value."""
    f = scene["frequency_hz"]
    h, k = 1.0 / (_STEPS * f), np.zeros(PARAMETERS)
    n = int(scene["duration_s"] / h) + 8
    k[P.OMEGA] = 2.0 * np.pi * f
    k[P.B_VISCOUS], k[P.C], k[P.A] = scene["viscous"], scene["coulomb"], scene["drag"]
    times = np.zeros((2 * n + 1, TIMES))
    times[:, T.STIFF] = times[:, T.LOSS] = 1.0
    half = 0.5 * h * np.arange(2 * n + 1)
    start = np.array([amplitude, 0.0, 0.0, 0.0, 0.0])
    place = {
        "cubic-damping": P.CUBIC,
        "power-law-damping": P.POWER,
        "stribeck-friction": P.STRIBECK,
        "cubic-stiffness": P.K3,
        "quadratic-stiffness": P.K2,
        "omega": P.OMEGA,
        "viscous": P.B_VISCOUS,
        "coulomb": P.C,
        "drag": P.A,
    }
    if kind in place:
        k[place[kind]] += size
    k[P.EXPONENT], k[P.STRIBECK_V] = 1.5, 0.1
    if kind == "damping-drift":
        times[:, T.BRAKE] = size * half
    if kind == "frequency-drift":
        times[:, T.STIFF] = 1.0 + 2.0 * size * half
    if kind == "start":
        start[0] += size
    states, _ = integrate(start, h, k, 0, times, np.zeros(n + 1))
    grid = h * np.arange(n + 1)
    stamps = np.arange(0.0, scene["duration_s"], 1.0 / scene["rate_hz"])
    shift = size if kind == "instant" else 0.0
    angle = CubicHermiteSpline(grid, states[:, 0], states[:, 1], extrapolate=True)(stamps + shift)
    return np.asarray(angle + (size * angle**3 if kind == "sensor-cubic" else 0.0))


def _columns(scene: dict[str, Any], kinds: Sequence[str]) -> tuple[list[Array], list[Array]]:
    """Return derivatives by what is each recording's own and shared, and by effects, whitened."""
    tangents, effects = [], []
    for amplitude in AMPLITUDES:
        there = reading(scene, amplitude, "", 0.0)
        steps = {
            "omega": 1e-6,
            "viscous": 1e-3 * scene["viscous"],
            "coulomb": 1e-3 * scene["coulomb"],
            "drag": 1e-2 * scene["drag"],
            "start": 1e-4 * amplitude,
            "instant": 1e-5,
        }
        own = [(reading(scene, amplitude, n, s) - there) / s for n, s in steps.items()]
        tangents.append(np.column_stack([*own, np.ones_like(there)]) / scene["noise_rad"])
        changes = [
            (reading(scene, amplitude, kind, _START_SIZES[kind]) - there) / _START_SIZES[kind]
            for kind in kinds
        ]
        effects.append(np.column_stack(changes) / scene["noise_rad"])
    return tangents, effects


def oracle(scene: dict[str, Any]) -> dict[str, Any]:
    """Return the hidden size, and the oracle's classes: of the largest release, and of all."""
    kinds = [kind for kind in KINDS if kind != "nothing"]
    tangents, effects = _columns(scene, kinds)
    count, width = len(AMPLITUDES), tangents[0].shape[1]
    shared = 4
    rows = []
    for number, each in enumerate(tangents):
        row = np.zeros((len(each), shared + count * (width - shared)))
        row[:, :shared] = each[:, :shared]
        first = shared + number * (width - shared)
        row[:, first : first + width - shared] = each[:, shared:]
        rows.append(row)
    found: dict[str, Any] = {}
    if scene["kind"] == "nothing":
        return {"size": 0.0, "alone": [], "together": []}
    here = kinds.index(scene["kind"])
    seen = {}
    for name, model, change in (
        ("together", np.concatenate(rows), np.concatenate(effects)),
        ("alone", tangents[-1], effects[-1]),
    ):
        basis = np.linalg.qr(model / np.linalg.norm(model, axis=0))[0]
        left = change - basis @ (basis.T @ change)
        length = np.linalg.norm(left, axis=0)
        seen[name] = (length[here], (left.T @ left[:, here]) / (length * length[here]))
    size = float(np.sqrt(scene["gain"]) / seen[scene["sized_by"]][0])
    found["size"] = min(size, float(np.sqrt(_STRONGEST) / seen["together"][0]))
    for name, (length, cosine) in seen.items():
        gain = (found["size"] * length) ** 2
        lost = gain * (1.0 - cosine**2)
        found[name] = [kind for kind, each in zip(kinds, lost, strict=True) if each < _SAME]
        found[f"gain_{name}"] = float(gain)
    return found


def _classes(effects: Sequence[Any]) -> list[str]:
    if not effects:
        return []
    first = effects[0]
    return [first.identifier, *(name for name, _ in first.indistinguishable)]


def solved(seed: int) -> dict[str, Any]:
    """Make one set, diagnose it, and say what was found alone and together."""
    scene = drawn(seed)
    known = oracle(scene)
    rng = np.random.default_rng([25, seed])
    stamps = np.arange(0.0, scene["duration_s"], 1.0 / scene["rate_hz"])
    releases = []
    for amplitude in AMPLITUDES:
        angle = reading(scene, amplitude, scene["kind"], known["size"])
        noise = scene["noise_rad"] * rng.standard_normal(angle.size)
        releases.append(Recording(stamps, angle + noise, "angle_rad"))
    began = time.process_time()
    found = diagnose_several(releases, ["50 mrad", "150 mrad", "400 mrad"])
    alone = [outcome.effects for outcome in found.outcomes]
    most = max(range(len(alone)), key=lambda k: found.outcomes[k].diagnosis.p_value * -1.0)
    return {
        "seed": seed,
        "kind": scene["kind"],
        "gain": scene["gain"] if known["size"] else 0.0,
        "oracle": known,
        "alone": _classes(alone[most]),
        "named_alone": [_classes(each)[:1] for each in alone],
        "together": _classes(found.effects),
        "effects": [each.identifier for each in found.effects],
        "within_95": [
            r["prediction"]["within_95"] for r in found.content["recordings"] if r["prediction"]
        ],
        "pulls": _pulls(found.content, scene),
        "cpu_s": time.process_time() - began,
    }


def _pulls(content: dict[str, Any], scene: dict[str, Any]) -> dict[str, float]:
    """Return (value - truth)/sd of the shared values."""
    truth = {"b": scene["viscous"], "c": scene["coulomb"], "frequency": scene["frequency_hz"]}
    values = content["improved"]["parameters"]
    return {
        name: (values[name]["value"] - true) / values[name]["sd"]
        for name, true in truth.items()
        if name in values and values[name]["sd"] > 0.0
    }


def _real_sets() -> dict[str, tuple[dict[str, tuple[str, dict[str, Any]]], tuple[str, ...]]]:
    """Return the pendulums: recordings with the options of reading, and what was changed."""
    eddy, water = "martin8ner-pohl-eddy/1.3_{}.csv", "vicber507-water/{}1.csv"
    runs = (1, 2, 3)
    # A pendulum of length L has a ~ L^(1/2), c ~ L^(-3/2), and a b that follows its frequency:
    # lengths share the effects alone.
    lengths = ("a", "b", "c", "frequency")
    return {
        "eddy-current brake": (
            {f"{n} mA": (eddy.format(f"{n}mA"), {"start": 10}) for n in (100, 200)},
            ("b",),
        ),
        "two releases": ({n: (f"yfysiks-encoder/{n}.csv", {}) for n in ("data32", "data33")}, ()),
        "bob in air": (
            {f"air {n}": (water.format("Aire"), {"column": f"t{n}:theta{n}"}) for n in runs},
            (),
        ),
        "bob in water": (
            {f"water {n}": (water.format("Agua"), {"column": f"t{n}:theta{n}"}) for n in runs},
            (),
        ),
        "string pendulum": (
            {n: (f"jiarui-phy180/{n}.txt", {}) for n in ("8050", "8053", "8055")},
            lengths,
        ),
        "four lengths": (
            {f"data2_{n}": (f"yfysiks-encoder/data2_{n}.csv", {}) for n in (12, 14, 20, 22)},
            lengths,
        ),
    }


def real(name: str) -> dict[str, Any]:
    """Diagnose the recordings of one pendulum."""
    recordings, own = _real_sets()[name]
    read = {
        label: pp.read(Path(_REAL) / path, **options).as_motion(None, label)
        for label, (path, options) in recordings.items()
    }
    began = time.process_time()
    try:
        found = diagnose_several(list(read.values()), list(read), own=own)
    except InputError as error:
        return {"real": name, "refused": str(error)}
    return {
        "real": name,
        "statement": str(found),
        "recordings": found.content["recordings"],
        "cpu_s": time.process_time() - began,
    }


def _table(rows: Sequence[dict[str, Any]]) -> list[str]:
    lines = [
        "| hidden | sets | in the class alone, of those found | class alone | oracle's |"
        " found together | in the class together | class together | oracle's | named first |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]

    def mean(sizes: Sequence[int]) -> str:
        return f"{np.mean(sizes):.1f}" if len(sizes) else "-"

    kinds = [kind for kind in KINDS if kind != "nothing"]
    for kind in [*kinds, "all"]:
        mine = [r for r in rows if r["kind"] == kind or (kind == "all" and r["kind"] in kinds)]
        if not mine:
            continue
        alone = [r for r in mine if r["alone"]]
        both = [r for r in mine if r["together"]]
        lines.append(
            f"| {kind} | {len(mine)} | {sum(r['kind'] in r['alone'] for r in alone)} of"
            f" {len(alone)} | {mean([len(r['alone']) for r in alone])} |"
            f" {mean([len(r['oracle']['alone']) for r in mine])} | {len(both)} |"
            f" {sum(r['kind'] in r['together'] for r in both)} |"
            f" {mean([len(r['together']) for r in both])} |"
            f" {mean([len(r['oracle']['together']) for r in mine])} |"
            f" {sum(r['together'][:1] == [r['kind']] for r in both)} |"
        )
    nulls = [r for r in rows if r["kind"] == "nothing"]
    alarms = sum(bool(r["effects"]) for r in nulls)
    within = [each for r in rows for each in r["within_95"]]
    pulls = [pull for r in rows for pull in r["pulls"].values()]
    lines += [
        "",
        f"Nothing hidden: {alarms} of {len(nulls)} sets reported something. The band of 95 % held"
        f" {100 * np.mean(within):.1f} % of the readings predicted from the others (median of"
        f" recordings {100 * np.median(within):.1f} %)."
        if within
        else "",
        f"Shared b, c and frequency: {len(pulls)} pulls, mean {np.mean(pulls):.2f}, sd"
        f" {np.std(pulls):.2f}. CPU: median {np.median([r['cpu_s'] for r in rows]):.0f} s a set."
        if pulls
        else "",
    ]
    return lines


def page(rows: Sequence[dict[str, Any]]) -> str:
    """Return the measured part of the page."""
    text = [_MARK, "", "## Three amplitudes against one", ""]
    text += [
        "`python -m benchmarks.joint`: releases of 50, 150 and 400 mrad, 120 s at 12 Hz each, of a"
        " drawn pendulum, from an integrator that shares no code with the library; the effect is"
        " so strong that an oracle gains 60 to 600 in chi^2: from all three in one half of the"
        " sets, from the largest alone in the other. *Alone* is the recording that says most by"
        " itself.",
        "",
        *_table([r for r in rows if "seed" in r]),
        "",
    ]
    shown = [r for r in rows if "real" in r]
    if shown:
        text += ["## Real pendulums", ""]
    for row in shown:
        text += [f"**{row['real']}.** {row.get('statement', row.get('refused'))}", ""]
        if row.get("recordings"):
            text += ["| recording | alone | band of 95 % holds | error, rms (expected) |"]
            text += ["|---|---|---|---|"]
        for each in row.get("recordings", []):
            classes = "; ".join(", ".join(one) for one in each["alone"]["classes"]) or "nothing"
            told = each["prediction"]
            held = f"{100 * told['within_95']:.0f} %" if told else "not predicted"
            sizes = (told["rms_rad"], told["expected_rms_rad"]) if told else ()
            error = " (".join(f"{1e3 * size:.3g} mrad" for size in sizes) + ")" * bool(told)
            text.append(f"| {each['name']} | {classes} | {held} | {error} |")
        text.append("")
    return "\n".join(text).rstrip() + "\n"


def main() -> None:
    """Make sets until there are as many as asked for; write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=0)
    parser.add_argument("--real", nargs="*", metavar="PENDULUM")
    parser.add_argument("--journal", type=Path, default=Path("joint.jsonl"))
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    lines = given.journal.read_text().splitlines() if given.journal.exists() else []
    rows = [json.loads(line) for line in lines]
    done = {row.get("seed", row.get("real")) for row in rows}

    def keep(row: dict[str, Any]) -> None:
        rows.append(row)
        with given.journal.open("a") as stream:
            stream.write(json.dumps(row) + "\n")
        print(json.dumps({k: v for k, v in row.items() if k != "recordings"}), flush=True)

    if given.real is not None:
        if not Path(_REAL).is_dir():
            print(f"left out: {_REAL} is not there")
        else:
            for name in given.real or _real_sets():
                if name not in done:
                    keep(real(name))
    for seed in range(given.sets):
        if seed not in done:
            keep(solved(seed))
    if given.page is not None:
        before = given.page.read_text().split(_MARK)[0].rstrip()
        given.page.write_text(f"{before}\n\n{page(rows)}")
    elif rows:
        print(page(rows))


if __name__ == "__main__":
    main()
