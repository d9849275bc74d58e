"""Scores of answers beside their truths, and beside the oracle: alarms, power, names, places.

A name is right where the effect is hidden, or its law may be called so; a class is a name with what
the answer calls indistinguishable from it, and a class that holds what is there is right, whichever
of its names leads. Shares have exact 95 % intervals, other figures those of items drawn anew.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe_challenge.causes import kind_of
from pendpipe_challenge.sets import UNRECORDED

Score = dict[str, Any]
LIKELY: Final = 0.5
"""A probability from which a name is meant."""
CONFIDENT: Final = 0.8
"""A probability above which a name is given without doubt."""
PROMISED: Final = 1.3
"""By how much a size or a class may be larger than the oracle's."""
DRAWS: Final = 300
LEVELS: Final = (0.0, 6.0, 12.0, 20.0, 35.0, 70.0, 200.0, 1e3, np.inf)
BANDS: Final = {"all": (0.0, np.inf), "50": (35.0, 70.0), "100": (70.0, 200.0), "400": (200.0, 1e3)}
"""Of Delta chi^2, by the size that was wanted."""


# ---------------------------------------------------------------- what was answered


@dataclass(frozen=True)
class Solved:
    """One item: its truth, and its answer as classes; without a diagnosis it is not solved.

    Parameters
    ----------
    effects
        Of the diagnosis. What was presumed counts where it was hidden, and elsewhere is no claim.
    presumed
        What was presumed.
    """

    name: str
    truth: dict[str, Any]
    content: dict[str, Any]
    effects: tuple[dict[str, Any], ...] = ()
    presumed: frozenset[str] = frozenset()
    solved: bool = False

    @property
    def family(self) -> str:
        """What was hidden."""
        return str(self.truth["family"])

    @property
    def hidden(self) -> list[dict[str, Any]]:
        """The effects hidden."""
        return list(self.truth["effects"])

    @property
    def effect(self) -> dict[str, Any]:
        """The first effect hidden."""
        return self.hidden[0]

    @property
    def size(self) -> float:
        """Its Delta chi^2."""
        return float(self.effect["delta_chi2"])

    @property
    def oracle(self) -> dict[str, Any]:
        """The oracle's figures; empty where it was not asked."""
        return self.truth.get("oracle") or {}

    @property
    def detected(self) -> bool:
        """Missing physics, or noise alone."""
        return self.content.get("verdict") == "missing-physics" or bool(self.effects)

    @property
    def classes(self) -> list[tuple[str, ...]]:
        """Of each effect the name and its rivals, the likeliest first."""
        found = []
        for effect in self.effects:
            rivals = effect.get("indistinguishable_from") or []
            rivals = sorted(rivals, key=lambda rival: -(rival.get("probability") or 0))
            found.append((effect["id"], *(rival["id"] for rival in rivals)))
        return found

    @property
    def members(self) -> tuple[str, ...]:
        """The first name's class, itself first."""
        return self.classes[0] if self.effects else ()

    @property
    def lead(self) -> str:
        """The first name, or nothing."""
        return self.members[0] if self.members else ""

    @property
    def probability(self) -> float:
        """Of the first name; NaN where none is stated."""
        stated = self.effects[0].get("probability") if self.effects else None
        return math.nan if stated is None else float(stated)

    def holds(self, effect: dict[str, Any]) -> bool:
        """Whether a class has a name that is true of an effect."""
        return any(true_of(members, effect) for members in self.classes)

    @property
    def held(self) -> bool:
        """Whether the first class holds what was hidden first."""
        return true_of(self.members, self.effect)

    @property
    def oracle_held(self) -> bool:
        """Whether the oracle detected the effect and its class holds it."""
        return bool(self.oracle.get("detected")) and true_of(self.oracle["class"], self.effect)

    @property
    def false(self) -> list[float]:
        """Probabilities of the names that are true of nothing that is there."""
        true = {*self.truth.get("present", ()), *self.truth.get("allowed", ())}
        true |= {name for effect in self.hidden for name in (effect["effect"], *effect["also"])}
        return [
            float(effect.get("probability") or 0.0)
            for effect, members in zip(self.effects, self.classes, strict=True)
            if not members[0].startswith("unnamed-") and true.isdisjoint(members)
        ]

    @property
    def curve(self) -> bool:
        """Whether something is said to be there that has no name."""
        return any(effect["id"].startswith("unnamed-") for effect in self.effects)

    @property
    def alarmed(self) -> bool:
        """Of a null: called something; what is true of its noise or its sensor is no alarm."""
        return self.detected and (self.curve or bool(self.false) or not self.effects)


def true_of(names: Iterable[str], effect: dict[str, Any]) -> bool:
    """Whether one of the names is true of an effect."""
    return not {effect["effect"], *effect.get("also", [])}.isdisjoint(names)


def read_item(name: str, truth: dict[str, Any], content: dict[str, Any] | None) -> Solved:
    """One item with what was diagnosed of it."""
    if not content or content.get("verdict") in (None, "not-analysable"):
        return Solved(name, truth, {})
    hidden = {each for e in truth["effects"] for each in (e["effect"], *e.get("also", []))}
    found = content.get("effects") or []
    effects = [each for each in found if not each.get("presumed") or each["id"] in hidden]
    presumed = frozenset(each["id"] for each in found if each.get("presumed"))
    return Solved(name, truth, content, tuple(effects), presumed, solved=True)


# ---------------------------------------------------------------- figures with their intervals


def share(truths: Sequence[bool] | BoolArray) -> Score:
    """How many are true, with the exact 95 % interval (Clopper and Pearson)."""
    from scipy.stats import binomtest

    hits, count = int(sum(truths)), len(truths)
    if not count:
        return {"hits": 0, "of": 0, "value": None, "interval95": [None, None]}
    low, high = binomtest(hits, count).proportion_ci()
    return {"hits": hits, "of": count, "value": hits / count, "interval95": [low, high]}


def figure(
    what: Callable[..., Any], *samples: Sequence[float] | FloatArray, paired: bool = False
) -> Score:
    """A figure of samples, with the middle 95 % of those of items drawn anew."""
    from scipy.stats import DegenerateDataWarning, bootstrap

    count = min(map(len, samples))
    value = float(what(*samples)) if count > 1 else math.nan
    if not math.isfinite(value):
        return {"value": None, "interval95": [None, None], "of": count}
    with warnings.catch_warnings():
        # A ratio of two means is none where the drawn items have no second one.
        warnings.simplefilter("ignore", DegenerateDataWarning)
        drawn = bootstrap(
            [np.asarray(each, np.float64) for each in samples],
            what,
            paired=paired,
            vectorized=False,
            n_resamples=DRAWS,
            method="percentile",
            rng=np.random.default_rng(1),
        ).bootstrap_distribution
    low, high = np.quantile(drawn[np.isfinite(drawn)], [0.025, 0.975])
    return {"value": value, "interval95": [float(low), float(high)], "of": count}


def ratio(above: Sequence[float], below: Sequence[float]) -> float:
    """Of two means."""
    bottom = float(np.mean(below))
    return float(np.mean(above)) / bottom if bottom else math.nan


def found_at(sizes: FloatArray, found: FloatArray, sds: float) -> float:
    """The size at which Phi(`sds`) are found: P = Phi((sqrt(size) - m)/s) by maximum likelihood."""
    from scipy.optimize import minimize
    from scipy.special import ndtr

    root = np.sqrt(sizes)

    def cost(p: FloatArray) -> float:
        chance = np.clip(ndtr((root - p[0]) / np.exp(p[1])), 1e-4, 1 - 1e-4)
        # A weak rein on the width, so that perfectly separated data have an answer.
        rein = 0.5 * (p[1] / 1.5) ** 2
        return float(rein - np.sum(np.where(found > 0, np.log(chance), np.log1p(-chance))))

    m, width = minimize(cost, [5.0, 0.0], method="Nelder-Mead").x
    return float(max(m + sds * np.exp(width), 1e-3) ** 2)


def calibration_error(stated: FloatArray, true: FloatArray) -> float:
    """Mean distance of the stated probabilities from what came true, over ten bins."""
    place = np.minimum(10.0 * np.asarray(stated), 9).astype(int)
    gap = np.bincount(place, weights=np.asarray(stated) - true, minlength=10)
    return float(np.abs(gap).sum() / len(stated))


# ---------------------------------------------------------------- the scores


def questions(items: Sequence[Solved]) -> dict[str, list[bool]]:
    """What is asked of items one by one, with the answer for each of which it is asked."""

    def of(*families: str) -> list[Solved]:
        return [item for item in items if item.family in families]

    null, outside, pairs = of("null"), of("outside"), of("combination")
    inside = of("single", "combination", "tie", "withheld")
    plain = [item for item in pairs if not item.truth.get("cancelling")]
    ties = [item for item in of("tie") if item.detected]
    large = [i for i in outside if i.effect.get("left_by_catalogue", 0.0) > 70.0]
    leads = [item for item in of("single", "tie") if item.lead]
    return {
        "without a diagnosis": [not item.solved for item in items],
        "circular error named or in a class, where there is sin x": [
            any("circular-error" in members for members in (item.presumed, *item.classes))
            for item in items
            if "circular-error" in item.truth.get("present", ())
        ],
        "nulls with a false name": [bool(item.false) for item in null],
        "nulls with a false name or a curve": [item.alarmed for item in null],
        "detected": [item.detected for item in of("single", "combination", "tie")],
        "first name is there": [
            any(true_of([item.lead], effect) for effect in item.hidden) for item in inside
        ],
        "class holds the hidden one": [item.holds(item.effect) for item in of("single", "tie")],
        "both of two": [all(map(item.holds, item.hidden)) for item in plain],
        "two that hide each other: detected": [i.detected for i in pairs if i not in plain],
        "dynamics or measurement": [kind_of(i.lead) == i.effect["kind"] for i in leads],
        "ties: the class and what decides": [
            i.held and len(i.members) > 1 and bool(i.effects[0].get("deciding_measurement"))
            for i in ties
        ],
        "ties: a lone name without doubt": [
            len(i.members) == 1 and i.probability > CONFIDENT for i in ties
        ],
        "withheld: detected": [item.detected for item in of("withheld")],
        "false name beside what is hidden": [bool(item.false) for item in inside],
        "the same, with 50 % or more": [any(p >= LIKELY for p in i.false) for i in inside],
        "the same, confident": [any(p > CONFIDENT for p in i.false) for i in inside],
        "outside: a false name with 50 % or more": [
            any(p >= LIKELY for p in i.false) for i in outside
        ],
        "outside: confidently wrong": [any(p > CONFIDENT for p in i.false) for i in outside],
        "outside: a curve, or no name but true ones": [i.curve or not i.false for i in outside],
        "outside, large: unnamed, of the right kind": [i.holds(i.effect) for i in large],
        "numbers of a named effect: the 95 % interval holds": covered(items),
        **{f"place: {what}": held for what, held in places(items).items()},
    }


def detection(singles: list[Solved]) -> Score:
    """Power against Delta chi^2, beside the oracle by its largest score."""
    sizes = np.array([item.size for item in singles])
    found = np.array([float(item.detected) for item in singles])
    oracle = np.array([float(item.oracle["detected"]) for item in singles])
    levels = []
    for low, high in pairwise(LEVELS):
        here = (sizes >= low) & (sizes < high)
        if here.any():
            both = {"solver": share(found[here] > 0), "oracle": share(oracle[here] > 0)}
            levels.append({"delta_chi2": float(np.median(sizes[here])), **both})
    ratios = {}
    for key, sds in (("half", 0.0), ("nine tenths", 1.2816)):

        def over_oracle(*drawn: FloatArray, sds: float = sds) -> float:
            return found_at(drawn[0], drawn[1], sds) / found_at(drawn[0], drawn[2], sds)

        few = slice(0, 0 if len(singles) < 10 else None)
        ratios[key] = figure(over_oracle, sizes[few], found[few], oracle[few], paired=True)
    return {"levels": levels, **ratios}


def naming(items: list[Solved]) -> Score:
    """First name and class of what each judge detected; class sizes."""
    solver = [item for item in items if item.detected]
    oracle = [item for item in items if item.oracle.get("detected")]
    sizes = [len(item.members) for item in solver]
    ceilings = [len(item.oracle["class"]) for item in oracle]
    return {
        "top1": share([true_of([i.lead], i.effect) for i in solver]),
        "class": share([i.held for i in solver]),
        "oracle_top1": share([true_of([i.oracle["named"]], i.effect) for i in oracle]),
        "oracle_class": share([i.oracle_held for i in oracle]),
        "class_size": float(np.mean(sizes)) if sizes else None,
        "oracle_class_size": float(np.mean(ceilings)) if ceilings else None,
        "class_size_ratio": figure(ratio, sizes, ceilings),
        "share_of_the_oracle": figure(
            ratio, [i.held for i in items], [i.oracle_held for i in items], paired=True
        ),
    }


def places(items: Sequence[Solved]) -> dict[str, list[bool]]:
    """Whether the place reported of a local effect that was named holds the true one."""
    found: dict[str, list[bool]] = {"instants": [], "tones": []}
    for item in items:
        for effect in item.hidden:
            same = (e for e in item.effects if e["id"] == effect["effect"])
            entry = next(same, None)
            if entry is None:
                continue
            if "instant_s" in effect:
                ends = (entry.get("location") or {}).get("time_s")
                # A reading's place is known to a reading.
                slack = effect.get("tick_s", 0.0)
                if ends:
                    held = ends[0] - slack <= effect["instant_s"] <= ends[1] + slack
                    found["instants"].append(held)
            elif "tone_hz" in effect:
                hertz = [
                    e for e in (entry.get("parameters") or {}).values() if e.get("unit") == "Hz"
                ]
                if hertz and hertz[-1].get("interval95"):
                    low, high = hertz[-1]["interval95"]
                    found["tones"].append(low <= effect["tone_hz"] <= high)
    return found


OWN_NAMES: Final[dict[str, dict[str, tuple[str, float]]]] = {
    "cubic-stiffness": {"k3": ("cubic", 1.0)},
    "quadratic-stiffness": {"k2": ("square", 1.0)},
    "stribeck-friction": {"f_s": ("stribeck", 1.0), "v_s": ("stribeck_speed", 1.0)},
    "presliding-friction": {"k_d": ("dahl", 1.0), "z_c": ("dahl_reach", 1.0)},
    "backlash": {"b": ("play", 2.0)},
    "history-force": {"h": ("basset", 1.0)},
    "release-transient": {"gamma": ("release", 0.5), "tau": ("release_time", 1.0)},
    "equilibrium-step": {"J": ("rest_jump", 1.0), "time": ("rest_jump_at", 1.0)},
    "amplitude-step": {"time": ("scaling_at", 1.0)},
    "frequency-step": {"change": ("omega_jump", 1.0), "time": ("omega_jump_at", 1.0)},
    "impulse": {"dv": ("impulse", 1.0), "time": ("impulse_at", 1.0)},
}
"""By effect and name in docs/effects.md: the parameter of the motion here, and a factor.

The jump of an amplitude is not among them: here r grows by a share, there by a power of e.
"""


def covered(items: Sequence[Solved]) -> list[bool]:
    """Whether intervals hold the numbers of effects that act by the catalogue's own law."""
    found = []
    for item in items:
        if not (item.hidden and item.effect.get("own_form") and item.lead == item.effect["effect"]):
            continue
        fitted, true = item.effects[0].get("parameters") or {}, item.effect["parameters"]
        for name, (own, factor) in OWN_NAMES.get(item.lead, {}).items():
            interval = (fitted.get(name) or {}).get("interval95")
            if interval and own in true:
                found.append(interval[0] <= factor * true[own] <= interval[1])
    return found


def calibration(items: list[Solved]) -> Score:
    """Expected calibration error of the first names' probabilities."""
    rated = [i for i in items if i.detected and math.isfinite(i.probability)]
    true = [any(true_of([i.lead], e) for e in i.hidden) for i in rated]
    return figure(calibration_error, [i.probability for i in rated], true, paired=True)


SEALS: Final = (
    *("set", "count", "sealed_at", "answered_at", "answered_by", "opened_at", "sets_before"),
    *("seed", "truth_sha256", "answers_sha256"),
)
"""Of an opened set: which it was, and when what was known."""


def score(opened: dict[str, Any]) -> Score:
    """All scores of an opened set: truth and answers."""
    items = [
        read_item(name, entry["truth"], entry["answer"].get("diagnosis"))
        for name, entry in opened["items"].items()
    ]

    def family(*names: str) -> list[Solved]:
        return [item for item in items if item.family in names]

    nulls = [item for item in family("null") if item.solved]
    judged = [item for item in family("single") if item.oracle]
    named = [item for item in family("single", "tie") if item.oracle]
    missed = [i for i in family("single", "withheld") if i.size > 30.0 and not i.detected]
    found = {
        "set": {key: opened.get(key, UNRECORDED) for key in SEALS},
        "items": len(items),
        "families": dict(Counter(item.family for item in items)),
        "unsolved": [item.name for item in items if not item.solved],
        "false_alarms": {
            **share([item.alarmed for item in nulls]),
            "oracle": share([bool(item.oracle["detected"]) for item in nulls if item.oracle]),
            "named": dict(Counter(item.lead for item in nulls if item.alarmed)),
        },
        "detection": detection(judged),
        "naming": {
            band: naming([item for item in named if low <= item.size < high])
            for band, (low, high) in BANDS.items()
        },
        "others": {what: share(hits) for what, hits in questions(items).items()},
        "calibration": calibration(family("single", "tie", "outside")),
        "confusion": dict(Counter(f"{i.effect['effect']} -> {i.lead}" for i in named)),
        "missed": [f"{i.name} | {i.effect['law']}" for i in missed],
    }
    return {**found, "promises": promises(found)}


def promises(scores: Score) -> list[Score]:
    """Promises with what was measured; ``kept`` is None where there was too little to judge.

    But for false alarms it is the measured value that counts, and not the end of its interval that
    would flatter us.
    """
    alarms, confident = scores["false_alarms"], scores["others"]["outside: confidently wrong"]
    rows = [("false alarms: interval contains 1 % or lies below", alarms, 0.01)]
    for share_ in ("half", "nine tenths"):
        words = f"Δχ² at which {share_} are detected, over the oracle's: at most {PROMISED}"
        rows.append((words, scores["detection"][share_], PROMISED))
    for band in ("50", "100"):
        named = scores["naming"][band]
        words = f"class accuracy at {band} over the oracle's: at least 0.9"
        rows.append((words, named["share_of_the_oracle"], -0.9))
        words = f"mean class size at {band} over the oracle's: at most {PROMISED}"
        rows.append((words, named["class_size_ratio"], PROMISED))
    rows.append(("confident wrong names outside the catalogue: at most 5 %", confident, 0.05))
    rows.append(("expected calibration error: at most 0.05", scores["calibration"], 0.05))
    found = []
    for words, measured, limit in rows:
        value = measured["interval95"][0] if measured is alarms else measured["value"]
        kept = None if value is None else math.copysign(1.0, limit) * value <= limit
        found.append({"promise": words, "measured": in_words(measured), "kept": kept})
    return found


# ---------------------------------------------------------------- the page


def in_words(measured: Score) -> str:
    """A share or a figure with its 95 % interval."""
    if measured["value"] is None:
        return "too few items"
    low, high = measured["interval95"]
    if "hits" in measured:
        counts = f"{measured['hits']} of {measured['of']}"
        return f"{100 * measured['value']:.1f} % ({counts}; {100 * low:.1f} to {100 * high:.1f} %)"
    return f"{measured['value']:.3g} ({low:.3g} to {high:.3g})"


def table(head: str, rows: Iterable[Sequence[object]]) -> list[str]:
    """A Markdown table."""
    lines = [f"| {' | '.join(map(str, row))} |" for row in rows]
    return ["", f"| {head} |", "|---" * (head.count(" | ") + 1) + "|", *lines]


def asked(items: Sequence[Solved]) -> Iterator[tuple[str, str]]:
    """Each question that was asked, with the share in words."""
    return ((what, in_words(share(hits))) for what, hits in questions(items).items() if hits)


def page(scores: Score) -> str:
    """Write the scores as Markdown."""
    alarms = scores["false_alarms"]
    kept = {None: "-", True: "yes", False: "**no**"}
    lines = [
        "# Proof: concealed effects",
        "",
        "Written by `pendpipe challenge score`. A generator that shares no code with the diagnosis"
        " made the recordings, the truth was sealed, `pendpipe diagnose` solved them one by one,"
        " its answers were hashed, and only then was the truth opened, once. A fresh set:"
        f" `make proof SET=fresh ITEMS={scores['set']['count']}`.",
        *table("of the set | ", ((key.replace("_", " "), v) for key, v in scores["set"].items())),
        *[f"| {family} | {count} |" for family, count in sorted(scores["families"].items())],
        f"| without a diagnosis | {', '.join(scores['unsolved']) or 'none'} |",
        *table(
            "promise | measured | kept",
            ((row["promise"], row["measured"], kept[row["kept"]]) for row in scores["promises"]),
        ),
        *table(
            "Δχ² (median) | detected | by the oracle",
            (
                (f"{row['delta_chi2']:.0f}", in_words(row["solver"]), in_words(row["oracle"]))
                for row in scores["detection"]["levels"]
            ),
        ),
        *table(
            "Δχ² | who | first | in class | class size",
            (
                (
                    band,
                    who,
                    *(in_words(found[f"{key}{name}"]) for name in ("top1", "class")),
                    "-" if not (size := found[f"{key}class_size"]) else f"{size:.2f}",
                )
                for band, found in scores["naming"].items()
                for who, key in (("diagnose", ""), ("oracle", "oracle_"))
            ),
        ),
        *table(
            "what else | measured",
            (
                ("false alarms of the oracle", in_words(alarms["oracle"])),
                ("names given to nulls", alarms["named"] or "none"),
                *(
                    (what, in_words(found))
                    for what, found in scores["others"].items()
                    if found["of"]
                ),
            ),
        ),
        *table("not detected above Δχ² = 30 | hidden", ((row,) for row in scores["missed"])),
    ]
    return "\n".join(lines) + "\n"
