"""Whether every number that fit and diagnose quote is what they say, whatever the law lacks.

    python -m benchmarks.numbers [--number 150] [--set NAME] [--list] [--fits] [--processes 2]

Recordings of the challenge's integrator as `benchmarks.apparatus` draws them, a quarter each with
nothing hidden, one effect of the catalogue, two, or one outside it; the torsion wheels among them
are written as springs (`displacement_m`). `pp.read`, `pp.fit` and `pp.diagnose` answer, and of
their JSON every T0, Q at an amplitude, a, b, c, and time to half and to 1/e is compared with the
generator's truth. Where a diagnosis quotes no number, those of the fit stand.

What is true, of the motion that was integrated, without its sensor's and its clock's faults:

T0
    Period of small swings by the whole torque: the motion is integrated at a millionth of its
    amplitude, without losses, pushes and creep, along the recording; where the frequency drifts
    or jumps the mean over it, by its own clock where that drifts (nobody can tell a clock that
    drifts from a pendulum that does). Of a fluid's memory the undamped one, as 2 pi/omega is.
    There is none where small swings have another spring (dead zones, bristles, hysteretic
    cables) or two frequencies (planes that exchange their swing, sloshing).
Q, times to 1/2 and 1/e
    The motion is integrated from its release without pushes, touches, kicks and beats until it is
    that small. Q is pi over the period times the relative loss of amplitude in the cycle in whose
    middle is a turning point of y, as in docs/fit.md, on average over both sides; the period is
    that without losses (but of springs that slip or relax). There is none where two coordinates
    exchange their swing; and no time, where the loss changes with time, beyond the last reading.
a, b, c
    Of Eq. 8 as it was simulated. Of a motion with another loss they say nothing, unless the
    diagnosis names it and the law is the catalogue's own; b says nothing where the loss drifts.

An error is the distance from the value to the end of the 95 % interval on the truth's side, over
1.96. The oracle fits the true law, hidden effects included, to the same readings, and knows the
noise (not asked where the noise is foreign to it).
"""

# The name is that of the command that was asked for.
# ruff: noqa: A005

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import newton

from benchmarks.apparatus import SOURCES, draw
from benchmarks.journal import answers, judge_parser
from benchmarks.table import head, table_row
from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.score import CONFIDENT
from pendpipe_challenge.torques import BOOK
from pendpipe_challenge.world import SHARE, Bench, Cause, Scene, World

GROUPS: Final = {"null": "none", "single": "one", "combination": "two", "outside": "outside"}
APPARATUS: Final = {"encoder": 0.25, "camera": 0.25, "converter": 0.25, "wheel": 0.25}
QUANTITIES: Final = ("T0", "Q", "1/2", "1/e", "a", "b", "c")
FAR: Final = 5.0
"""Errors beyond which a number is wrong."""
HALF_WIDTH: Final = 1.96
"""Of a 95 % interval, in standard deviations."""
Number = dict[str, Any]


# ---------------------------------------------------------------- what is true

SPRINGS: Final = (
    *("omega", "sine", "cubic", "square", "sided", "stiffening", "stiffening_scale", "lopsided"),
    *("lopsided_scale", "play", "omega_drift", "omega_drift_time", "omega_jump", "omega_jump_at"),
    *("maxwell", "maxwell_time", "basset"),
)
"""Parameters on which the period of a swing without losses depends."""
SPRINGY: Final = tuple(
    BOOK[name]
    for name in (
        *("magnet-below", "cogging", "vibrated-pivot", "winding-string", "rolling-edge"),
        *("bumper", "elastic-string"),
    )
)
"""The same, of the laws of the book."""
BRISTLES: Final = ("dahl", "iwan"), (BOOK["cable-hysteresis"],)
TWOFOLD: Final = ("coupling",), (BOOK["sloshing-bob"],)
"""Springs that slip, and two coordinates that exchange their swing."""
PUSHES: Final = (
    *("drive", "impulse", "scaling", "rub", "parametric", "creep", "creep_log", "rest_jump"),
)
"""What moves a pendulum and is no loss."""
IN_TIME: Final = ("gamma_drift", "gamma_jump", "pulsed", "release", "release_finger")
"""Losses that change with time."""
LOSSES: Final = (
    *("power", "energy", "reynolds", "rayleigh", "van_der_pol", "eddy", "stribeck", "dahl"),
    *("iwan", "maxwell", "basset", "shedding", "rough", "kink", *IN_TIME),
)
LOSSY: Final = tuple(
    BOOK[name]
    for name in (
        *("eddy-peak", "local-brake", "wind", "one-way-drag", "ageing-friction"),
        *("cable-hysteresis", "sloshing-bob", "squeeze-film"),
    )
)
"""Other losses than those of Eq. 8, and those of the book."""
TINY: Final = 1e-6
A_CYCLE: Final = 128
"""Samples along which a decay is followed."""
RELEASED: Final = 0.01
"""Relative noise of an amplitude by which it may exceed that of the release."""
PATIENCE: Final = 64
"""Recordings after which an amplitude that is not reached is given up."""


def has(motion: Motion, names: Sequence[str], laws: Sequence[int] = ()) -> bool:
    """Whether any of some parameters acts, or one of some laws of the book."""
    return any(motion.value(name) for name in names) or motion.value("book") in laws


def springs(motion: Motion, amplitude: float) -> Motion:
    """A motion with its springs alone, released at an amplitude."""
    kept = {name: motion.value(name) for name in SPRINGS}
    if motion.value("book") in SPRINGY:
        kept |= {name: motion.value(name) for name in motion.parameters if "book" in name}
    return Motion(kept | {"step_phase": 0.1}, amplitude)


def small_period(motion: Motion, stamps: Array, times: Array) -> float:
    """Mean period of small swings, s, by the clock that says `stamps` at `times`."""
    if has(motion, ["play"]) or has(motion, *BRISTLES) or has(motion, *TWOFOLD):
        return math.nan
    span, omega = float(times[-1] - times[0]), motion.value("omega")
    small = springs(motion, TINY * abs(motion.angle_rad))
    track = small.run(np.linspace(times[0], times[-1], int(span * omega) + 16))
    ends = np.abs(track.angle_rad + 1j * track.rate_rad_s / omega)[[0, -1]]
    for _ in range(3):
        # The phase is even in time where the speed is in units of the true frequency.
        phase = np.unwrap(np.arctan2(-track.rate_rad_s / omega, track.angle_rad))
        omega = float(phase[-1] - phase[0]) / span
    if motion.value("basset"):
        omega = math.hypot(omega, math.log(ends[0] / ends[1]) / span)
    return 2 * np.pi / omega * float(stamps[-1] - stamps[0]) / span


def turning_points(
    motion: Motion, start_s: float, until_s: float, a_cycle: int = A_CYCLE
) -> tuple[Array, Array]:
    """When a motion that is released at rest turns (to a tenth of a sample), and where."""
    tick = 2 * np.pi / motion.value("omega") / a_cycle
    track = motion.run(start_s + tick * np.arange(int((until_s - start_s) / tick)))
    turn, v = track.turn_rad, track.rate_rad_s
    (new,) = np.nonzero(np.diff(turn))
    at = track.time_s[new] + tick * v[new] / (v[new] - v[new + 1])
    return np.r_[start_s, at], turn[np.r_[0, new + 1]]


class Decay:
    """Amplitudes of a motion that is left alone, and when it has them.

    Parameters
    ----------
    motion
        At the release.
    start_s, duration_s
        When that is, and until when there are readings.
    smallest
        Amplitude until which it is followed.
    """

    def __init__(self, motion: Motion, start_s: float, duration_s: float, smallest: float) -> None:
        free = replace(motion, kicks_rad_s=np.empty(0))
        self.motion = free.changed(**dict.fromkeys(PUSHES, 0.0))
        span, amplitudes = duration_s, np.ones(1)
        while amplitudes[-1] > smallest and span < PATIENCE * duration_s:
            span *= 2
            self.times, turns = turning_points(self.motion, start_s, start_s + span)
            amplitudes = np.abs(turns)
            if not np.isfinite(amplitudes).all():
                break
        falls = np.r_[True, True, amplitudes[2:] < amplitudes[:-2]] & (amplitudes > 0)
        until = len(falls) if falls.all() else int(np.argmin(falls))
        if has(motion, *TWOFOLD):
            until = 0
        self.times, self.logs = self.times[:until], np.log(amplitudes[:until])
        self.end = duration_s if has(motion, IN_TIME) else math.inf

    def quality(self, amplitude: float) -> float:
        """Q at an amplitude: of the cycles, one from each side, in whose middle it is."""
        cycles = self.times[2:] - self.times[:-2]
        loss = self._at(amplitude, 1, (self.logs[:-2] - self.logs[2:]) / cycles)
        start, period = self._at(amplitude, 0, self.times), self._at(amplitude, 1, cycles)
        slips = has(self.motion, *BRISTLES) or has(self.motion, ["maxwell", "basset"])
        if math.isfinite(loss) and not slips:
            # A table of few cycles does not give the last place.
            sides = [self._loss(start, side * amplitude, loss * period) for side in (-1, 1)]
            losses, weights = np.transpose(sides)
            loss = float(np.average(losses, weights=weights))
            at, _ = turning_points(
                springs(self.motion, amplitude), start, start + 3 * period, 8 * A_CYCLE
            )
            period = float(at[2] - at[0])
        return math.pi / (period * loss)

    def _loss(self, when_s: float, middle: float, fall: float) -> tuple[float, float]:
        """Relative loss of the cycle that turns at `middle` near an instant, 1/s, and its weight.

        A one-sided motion swings unequally far, and loses of each side in proportion.
        """
        half = math.pi / self.motion.value("omega")

        def cycle(log: float) -> tuple[Array, Array]:
            released = replace(self.motion, angle_rad=-middle * math.exp(log))
            at, turns = turning_points(released, when_s - half, when_s + 9 * half, 8 * A_CYCLE)
            return at[:3], np.log(np.abs(turns[:3] / middle))

        log = float(newton(lambda log: cycle(log)[1][1], 0.5 * fall, x1=0.51 * fall, tol=1e-9))
        at, logs = cycle(log)
        return float((logs[0] - logs[2]) / (at[2] - at[0])), math.exp(log)

    def time_to(self, share: float, amplitude: float) -> float:
        """Time in which an amplitude falls to a share, s."""
        first = self._at(amplitude, 0, self.times)
        last = self._at(share * amplitude, 0, self.times)
        return last - first if last < self.end else math.nan

    def _at(self, amplitude: float, first: int, of: Array) -> float:
        """Mean of both sides, which a one-sided motion lets swing unequally far."""
        sides = [(-self.logs[first:][k : len(of) : 2], of[k::2]) for k in (0, 1)]
        place, ends = -math.log(amplitude), -self.logs[[0, -1]] if len(self.logs) else (0.0, 0.0)
        if min(len(at) for at, _ in sides) < 4 or not ends[0] - RELEASED <= place <= ends[1]:
            return math.nan
        return float(np.mean([CubicSpline(*side)(place) for side in sides]))


def truths(
    scene: Scene,
    causes: Sequence[Cause],
    asked: Sequence[tuple[str, float]],
    change: Callable[[World], None] | None = None,
) -> Array:
    """What is true of quantities at amplitudes (0 for none); not a number where nothing is."""
    world = scene.world(list(causes))
    if change:
        change(world)
    motion, times = world.motion, scene.time_s
    drifting = scene.world([each for each in causes if each.name == "clock-drift"]).clock
    instants = np.asarray(sum((late(times) for late in drifting), times))
    smallest = 0.9 / math.e * min([y for _, y in asked if y], default=1.0)
    decay = Decay(motion, -scene.lead_s, scene.duration_s, smallest)
    omega, value = motion.value("omega"), motion.value
    known: dict[str, Callable[[float], float]] = {
        "T0": lambda y: small_period(motion, times, instants),
        "Q": decay.quality,
        "1/2": lambda y: decay.time_to(0.5, y),
        "1/e": lambda y: decay.time_to(1 / math.e, y),
        "a": lambda y: 2 * omega / math.pi * (value("quadratic") + value("drag") / 1.5),
        "b": lambda y: value("gamma") / 2 + value("hysteretic") * 2 / math.pi,
        "c": lambda y: value("coulomb") * 2 / (math.pi * omega),
    }
    return np.array([known[quantity](y) for quantity, y in asked])


def oracle(bench: Bench, known: int, asked: Sequence[tuple[str, float]]) -> Array:
    """Standard deviation of each quantity by the true law, the first causes `known`."""
    scene, causes, there = bench.scene, bench.causes, truths(bench.scene, bench.causes, asked)
    moved = [truths(scene, causes, asked, partial(each, by=1.0)) - there for each in bench.changes]
    hidden = range(known, len(causes))
    moved += [(truths(scene, bench.less(each), asked) - there) / -SHARE for each in hidden]
    first = 2 + len(bench.changes)
    columns = np.delete(bench.tangent, np.s_[first : first + known], axis=1)
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0] = 1.0
    inverse = np.linalg.pinv(columns / sizes, rcond=1e-9)
    slopes = np.stack(moved, axis=1) / sizes[2:]
    return np.asarray(np.linalg.norm(slopes @ inverse[2:], axis=1))


# ---------------------------------------------------------------- what is quoted

ALLOWED: Final = {"T0": "period", "Q": "Q", "1/2": "Q", "1/e": "Q"}
"""By quantity: what `quotable` of a fit calls it."""
CALLED: Final = {"period": "T0", "half_life_s": "1/2", "damping_time_s": "1/e"}


def quoted_by_fit(fit: Mapping[str, Any]) -> Iterator[Number]:
    """Every number of `fit.json` that is printed, and whether it is withheld."""
    numbers = [("T0", 0.0, fit["period"])]
    numbers += [("Q", each["amplitude_rad"], each) for each in fit["quality_factors"]]
    numbers += [(name, 0.0, fit["parameters"][name]) for name in "abc"]
    if damping := fit.get("damping"):
        y = damping["amplitude_rad"]["value"]
        numbers += [(CALLED[name], y, damping[name]) for name in CALLED if damping.get(name)]
    lawless = fit["light"] == "red" or "quote a, b, c" in fit["light_reason"]
    for quantity, y, number in numbers:
        withheld = lawless if quantity in "abc" else ALLOWED[quantity] not in fit["quotable"]
        yield _number(quantity, y, number, withheld)


def quoted_by_diagnosis(content: Mapping[str, Any]) -> Iterator[Number]:
    """The same of `diagnosis.json`, by its better model; nothing where that is the fit's."""
    summary = content["summary"]
    withheld = re.findall(r"[abc]\b", summary["quote"].partition("; not ")[2])
    for each in summary["consequence"]:
        quantity = CALLED.get(each["quantity"], each["quantity"])
        better = each.get("with_missing") or each["fitted"]
        yield _number(quantity, each["amplitude_rad"] or 0.0, better, quantity in withheld)


def _number(
    quantity: str, amplitude: float, number: Mapping[str, Any] | None, withheld: bool
) -> Number:
    number = number or {}
    value, (low, high) = number.get("value"), number.get("interval95") or (None, None)
    ends = {"value": value, "low": low, "high": high, "bound": bool(number.get("at_bound"))}
    nothing = None in (value, low, high)
    return {"quantity": quantity, "y": amplitude, "withheld": withheld or nothing, **ends}


def answer(key: tuple[str, int, bool]) -> dict[str, Any]:
    """Make an item, hand the library its file, and set what it quotes beside the truth.

    The key is a set, a number, and whether to diagnose.
    """
    import pendpipe as pp

    item = draw(*key[:2], dict.fromkeys(GROUPS, 1 / len(GROUPS)), APPARATUS)
    assert item.bench is not None
    text = item.text
    if item.truth["apparatus"] == "wheel":
        text = text.replace("angle_rad", "displacement_m", 1)
    kept: dict[str, Any] = {"number": key[1], "truth": item.truth, "said": {}, "named": {}}
    said: dict[str, list[Number]] = {} if key[2] else {"diagnose": []}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{key[0]}-{key[1]:04d}.csv"
        path.write_text(text, encoding="utf-8")
        try:
            recording = pp.read(path)
            fit = pp.fit(recording).to_dict()
            said["fit"] = list(quoted_by_fit(fit))
            kept["said"]["fit"] = f"{fit['light']}: {fit['light_reason']}"
            if key[2]:
                content = pp.diagnose(recording).to_dict()
                said["diagnose"] = list(quoted_by_diagnosis(content)) or said["fit"]
                kept["said"]["diagnose"] = content["summary"]["headline"]
                kept["named"] = {each["id"]: each["probability"] for each in content["effects"]}
        except Exception as error:
            kept["said"] = {"fit": repr(error), "diagnose": repr(error)} | kept["said"]
    refused = [_number(each, 0.0, None, withheld=True) for each in ("T0", "Q", *"abc")]
    kept["numbers"] = [
        number | {"by": by} for by in ("fit", "diagnose") for number in said.get(by, refused)
    ]
    asked = [(each["quantity"], each["y"]) for each in kept["numbers"]]
    true, sds = truths(item.bench.scene, item.bench.causes, asked), np.full(len(asked), math.nan)
    if "coloured-noise" not in item.truth["allowed"]:
        sds = oracle(item.bench, len(item.truth["present"]), asked)
    motion = item.bench.scene.world(item.bench.causes).motion
    for number, truth, sd in zip(kept["numbers"], true.tolist(), sds.tolist(), strict=True):
        if number["quantity"] in "abc" and has(motion, LOSSES, LOSSY):
            named = all(map(partial(sure, kept), item.truth["effects"]))
            drifts = number["quantity"] == "b" and has(motion, IN_TIME[:3])
            truth = truth if named and number["by"] == "diagnose" and not drifts else math.nan
        number |= {"truth": truth, "oracle": sd}
    return kept


def sure(kept: Mapping[str, Any], hidden: Mapping[str, Any]) -> bool:
    """Whether an effect that acts by the catalogue's law is named without doubt."""
    names = (hidden["effect"], *hidden["also"])
    return hidden["own_form"] and max(kept["named"].get(each, 0.0) for each in names) >= CONFIDENT


# ---------------------------------------------------------------- what is counted


def pull(number: Number) -> float:
    """Errors by which a number is off: its interval's on the side of the truth, over 1.96."""
    off = number["truth"] - number["value"]
    end = number["high"] if off > 0 else number["low"]
    reach = abs(end - number["value"]) / HALF_WIDTH
    return off / reach if reach > 0 else math.copysign(math.inf, off) if off else 0.0


class Count:
    """Of some numbers: what is wanted of them, and what they come to."""

    def __init__(self, numbers: Sequence[Number]) -> None:
        there = [each for each in numbers if each["withheld"] or not _unknown(each)]
        self.left_out = len(numbers) - len(there)
        self.of, judged = len(there), [each for each in there if not each["withheld"]]
        self.withheld = 1 - len(judged) / len(there) if there else math.nan
        self.n, pulls = len(judged), [pull(each) for each in judged]
        held = [each["low"] <= each["truth"] <= each["high"] for each in judged]
        self.held = float(np.mean(held)) if held else math.nan
        self.far = float(np.mean([abs(each) > FAR for each in pulls])) if pulls else math.nan
        free = [p for p, each in zip(pulls, judged, strict=True) if not each["bound"]]
        self.rms = float(np.sqrt(np.mean(np.square(free)))) if free else math.nan
        ratios = [
            (each["high"] - each["low"]) / (2 * HALF_WIDTH * each["oracle"])
            for each in judged
            if each["sure"] and each["oracle"] and math.isfinite(each["oracle"])
        ]
        self.width = median(ratios) if ratios else math.nan

    def cells(self) -> list[str]:
        """Of a row of the table."""
        shares = [_word(100 * each, 3) for each in (self.held, self.far, self.withheld)]
        return [str(self.n), *shares, _word(self.width), _word(self.rms), str(self.left_out)]


def _word(value: float, digits: int = 2) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}g}"


def _unknown(number: Number) -> bool:
    return number["truth"] is None or not math.isfinite(number["truth"])


def wanted(count: Callable[..., Count], asked: Sequence[str]) -> Iterator[tuple[str, float, bool]]:
    """What is wanted of the numbers, what they come to, and whether that is enough."""
    for by in asked:
        for group in GROUPS.values():
            all_ = count(by=by, group=group)
            yield f"{by}, {group}: 95 % intervals hold 90 %", all_.held, all_.held >= 0.9
            yield f"{by}, {group}: beyond five errors 1 %", all_.far, all_.far <= 0.01
            most = 0.1 if group in ("none", "one") else 1 / 3
            yield f"{by}, {group}: withheld {most:.2g}", all_.withheld, all_.withheld <= most
            if group == "none" or (group, by) == ("one", "diagnose"):
                yield f"{by}, {group}: width over the oracle's 1.5", all_.width, all_.width <= 1.5
        for name in "abc":
            rms = count(by=by, group="none", quantity=name).rms
            yield f"{by}, none: rms pull of {name} 0.7 to 1.1", rms, 0.7 <= rms <= 1.1


def line(number: Number) -> str:
    """One number, what is true, and what was said beside it."""
    y = f" at {number['y']:.4g}" if number["y"] else ""
    ends = f"{number['value']:.8g} ({number['low']:.8g} to {number['high']:.8g})"
    return (
        f"{number['number']} {number['group']} [{number['laws']}] {number['by']}:"
        f" {number['quantity']}{y} {ends}, true {number['truth']:.8g}: {pull(number):+.1f};"
        f" {number['said']}"
    )


def main() -> int:
    """Answer what has not been answered by this code, and print what the numbers are worth."""
    parser = judge_parser(__doc__, "numbers", 150)
    parser.add_argument("--set", default="trial", help="name of the set, its seed")
    parser.add_argument("--list", action="store_true", help="print each number that misses")
    parser.add_argument("--fits", action="store_true", help="no diagnoses")
    told = parser.parse_args()
    numbers = []
    keys = [(told.set, number, not told.fits) for number in range(told.number)]
    for kept in answers(told, keys, answer, (*SOURCES, "benchmarks/numbers.py")):
        hidden = kept["truth"]["effects"]
        about = {
            "number": kept["number"],
            "group": GROUPS[kept["truth"]["family"]],
            "laws": "; ".join(each["law"] for each in hidden),
            "sure": all(sure(kept, each | {"own_form": True}) for each in hidden),
        }
        numbers += [each | about | {"said": kept["said"][each["by"]]} for each in kept["numbers"]]

    def count(**of: str) -> Count:
        return Count([each for each in numbers if of.items() <= each.items()])

    titles = ("95 % hold, %", "beyond five errors, %", "withheld, %", "width / oracle's")
    print(head("quoted", "n", *titles, "rms pull", "no truth"))
    asked = ("fit", "diagnose")[: 2 - told.fits]
    for by in asked:
        for group in GROUPS.values():
            print(table_row(f"**{by}, {group}**", count(by=by, group=group).cells()))
            for name in QUANTITIES:
                cells = count(by=by, group=group, quantity=name).cells()
                print(table_row(f"{by}, {group}, {name}", cells))
    known = [each for each in numbers if not (each["withheld"] or _unknown(each))]
    known.sort(key=lambda each: -abs(pull(each)))
    shown = [each for each in known if abs(pull(each)) > 2] if told.list else known[:10]
    print("", *map(line, shown), sep="\n")
    found = list(wanted(count, asked))
    for title, met in (("met", True), ("missed", False)):
        print(
            f"\n{title}:",
            "; ".join(f"{what} ({is_:.3g})" for what, is_, holds in found if holds is met)
            or "none",
        )
    return int(not all(holds for *_, holds in found))


if __name__ == "__main__":
    raise SystemExit(main())
