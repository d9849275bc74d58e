"""Scores of an opened set beside the oracle's: alarms, power, names, places, values, prediction.

A name is right where the effect is hidden or its law may be called so; a class is the first name
with what the answer calls indistinguishable from it. Shares have exact 95 % intervals, other
figures those of items drawn anew.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe_challenge.catalogue import kind_of
from pendpipe_challenge.items import WITHOUT_STRENGTH
from pendpipe_challenge.sets import UNRECORDED

Score = dict[str, Any]
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
class Answer:
    """A diagnosis by its classes, each the name and its rivals; without one nothing is solved."""

    content: dict[str, Any]
    classes: tuple[tuple[str, ...], ...] = ()
    solved: bool = False

    @property
    def detected(self) -> bool:
        """Missing physics, or noise alone."""
        return self.content.get("verdict") == "missing-physics" or bool(self.classes)

    @property
    def members(self) -> tuple[str, ...]:
        """The first name's class, itself first."""
        return self.classes[0] if self.classes else ()

    @property
    def lead(self) -> str:
        """The first name, or nothing."""
        return self.members[0] if self.members else ""

    @property
    def names(self) -> tuple[str, ...]:
        """All names of all classes."""
        return tuple(name for members in self.classes for name in members)

    @property
    def probability(self) -> float:
        """Of the first name; NaN where none is stated."""
        stated = self.content["effects"][0].get("probability") if self.classes else None
        return math.nan if stated is None else float(stated)


def read_answer(entry: dict[str, Any], hidden: Iterable[str] = ()) -> Answer:
    """One kept answer; what was presumed counts where it was hidden, and elsewhere is no claim."""
    content = entry.get("diagnosis")
    if not isinstance(content, dict) or content.get("verdict") == "not-analysable":
        return Answer({})
    effects, classes = [], []
    for effect in content.get("effects") or []:
        if effect.get("presumed") and effect["id"] not in hidden:
            continue
        rivals = effect.get("indistinguishable_from") or []
        rivals = sorted(rivals, key=lambda rival: -(rival.get("probability") or 0))
        effects.append(effect)
        classes.append((effect["id"], *(rival["id"] for rival in rivals)))
    return Answer(content | {"effects": effects}, tuple(classes), solved=True)


@dataclass(frozen=True)
class Solved:
    """One item: its truth and its answer."""

    name: str
    truth: dict[str, Any]
    answer: Answer

    @property
    def effect(self) -> dict[str, Any]:
        """The first effect hidden."""
        found: dict[str, Any] = self.truth["effects"][0]
        return found

    @property
    def size(self) -> float:
        """Its Delta chi^2."""
        return float(self.effect["delta_chi2"])

    @property
    def oracle(self) -> dict[str, Any]:
        """The oracle's figures; empty where it was not asked."""
        return self.truth.get("oracle") or {}

    @property
    def held(self) -> bool:
        """Whether the first class holds what was hidden."""
        return true_of(self.answer.members, self.effect)

    @property
    def oracle_held(self) -> bool:
        """Whether the oracle detected the effect and its class holds it."""
        return bool(self.oracle.get("detected")) and true_of(self.oracle["class"], self.effect)

    @property
    def alarmed(self) -> bool:
        """Of a null: called something; the colour of noise that is red is no false alarm."""
        red = self.truth["nuisances"]["alpha"] > 0.0
        return self.answer.detected and not (red and set(self.answer.names) <= {"coloured-noise"})

    @property
    def confidently_wrong(self) -> bool:
        """Of what is outside the catalogue: given a name of it without doubt."""
        named = self.answer.detected and not self.answer.lead.startswith("unnamed-")
        return named and self.answer.probability > CONFIDENT


def true_of(names: Iterable[str], effect: dict[str, Any]) -> bool:
    """Whether one of the names is true of an effect."""
    return not {effect["effect"], *effect.get("also", [])}.isdisjoint(names)


def read_items(opened: dict[str, Any]) -> list[Solved]:
    """Items of an opened set."""
    found = []
    for name, entry in opened["items"].items():
        effects = entry["truth"]["effects"]
        hidden = [each for e in effects for each in (e["effect"], *e.get("also", []))]
        found.append(Solved(name, entry["truth"], read_answer(entry["answer"], hidden)))
    return found


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


def detection(singles: list[Solved]) -> Score:
    """Power against Delta chi^2, beside the oracle by its largest score."""
    tuned = [item for item in singles if item.effect["effect"] not in WITHOUT_STRENGTH]
    sizes = np.array([item.size for item in tuned])
    found = np.array([float(item.answer.detected) for item in tuned])
    oracle = np.array([float(item.oracle["detected"]) for item in tuned])
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

        few = slice(0, 0 if len(tuned) < 10 else None)
        ratios[key] = figure(over_oracle, sizes[few], found[few], oracle[few], paired=True)
    return {"levels": levels, **ratios}


def naming(items: list[Solved]) -> Score:
    """First name, one of three and class, of what each judge detected; class sizes."""
    solver = [item for item in items if item.answer.detected]
    oracle = [item for item in items if item.oracle.get("detected")]
    sizes = [len(item.answer.members) for item in solver]
    ceilings = [len(item.oracle["class"]) for item in oracle]
    return {
        "top1": share([true_of([i.answer.lead], i.effect) for i in solver]),
        "top3": share([true_of(i.answer.names[:3], i.effect) for i in solver]),
        "class": share([i.held for i in solver]),
        "oracle_top1": share([true_of([i.oracle["named"]], i.effect) for i in oracle]),
        "oracle_top3": share([true_of(i.oracle["top3"], i.effect) for i in oracle]),
        "oracle_class": share([i.oracle_held for i in oracle]),
        "class_size": float(np.mean(sizes)) if sizes else None,
        "oracle_class_size": float(np.mean(ceilings)) if ceilings else None,
        "class_size_ratio": figure(ratio, sizes, ceilings),
        "share_of_the_oracle": figure(
            ratio, [i.held for i in items], [i.oracle_held for i in items], paired=True
        ),
    }


def others(family: Callable[..., list[Solved]]) -> Iterator[tuple[str, Score]]:
    """Combinations, ties, what is outside the catalogue, what the baseline lacks."""

    def each(item: Solved) -> list[bool]:
        return [true_of(item.answer.names, effect) for effect in item.truth["effects"]]

    pairs = family("combination")
    plain = [item for item in pairs if not item.truth["cancelling"]]
    yield "both of two named", share([all(each(item)) for item in plain])
    yield "the oracle's own", share([all(i.oracle["found_each"]) for i in plain if i.oracle])
    hiding = [item for item in pairs if item.truth["cancelling"]]
    yield "two that hide each other: detected", share([i.answer.detected for i in hiding])
    ties = [item for item in family("tie") if item.answer.detected]
    decides = [bool(i.answer.content["effects"][0].get("deciding_measurement")) for i in ties]
    credited = [
        i.held and len(i.answer.members) > 1 and d for i, d in zip(ties, decides, strict=True)
    ]
    yield "ties: the class and what decides", share(credited)
    lone = [len(i.answer.members) == 1 and i.answer.probability > CONFIDENT for i in ties]
    yield "ties: a lone name without doubt", share(lone)
    outside = family("outside")
    yield "outside the catalogue: confidently wrong", share([i.confidently_wrong for i in outside])
    large = [item for item in outside if item.effect["left_by_catalogue"] > 70.0]
    right_kind = [true_of(item.answer.names, item.effect) for item in large]
    yield "outside, large: unnamed, of the right kind", share(right_kind)
    yield "withheld: detected", share([item.answer.detected for item in family("withheld")])


GROUPS: Final = {
    "impulse": "impulses",
    "equilibrium-step": "steps",
    "amplitude-step": "steps",
    "frequency-step": "steps",
    "damping-step": "steps",
    "dropped-samples": "lost samples",
    "glitches": "glitches",
    "tone-pickup": "tones",
    "periodic-drive": "tones",
    "second-mode": "tones",
}
"""What is local in time or frequency."""
INSTANTS: Final = ("impulse", "rest_jump", "omega_jump", "gamma_jump", "scaling", "rub")
HERTZ: Final = {"tone_hz": 1.0, "frequency_hz": 1.0, "drive_omega": 0.5 / math.pi}


class Place(NamedTuple):
    """An interval of time (s) or frequency (Hz); of no width where it is a point."""

    low: float
    high: float


def true_place(effect: dict[str, Any], interval_s: float | None) -> Place | None:
    """Where an effect is; None where the truth does not tell."""
    known = effect["parameters"]
    for name in INSTANTS:
        if f"{name}_at" in known:
            begin = float(known[f"{name}_at"])
            return Place(begin, begin + float(known.get(f"{name}_width", 0.0)))
    for name, factor in HERTZ.items():
        if name in known:
            return Place(factor * float(known[name]), factor * float(known[name]))
    samples = [float(value) for name, value in known.items() if name.startswith("sample")]
    if not samples or interval_s is None:
        return None
    return Place(min(samples) * interval_s, max(samples) * interval_s)


def reported_place(answer: Answer, name: str) -> Place | None:
    """Where the answer puts an effect that it names: its fitted frequency, or its times."""
    for entry in answer.content.get("effects") or []:
        if entry["id"] == name:
            ends = (entry.get("location") or {}).get("time_s")
            if GROUPS[name] == "tones":
                fitted = (entry.get("parameters") or {}).values()
                hertz = [each for each in fitted if each.get("unit") == "Hz"]
                ends = hertz[-1].get("interval95") if hertz else None
            return Place(*map(float, ends)) if ends else None
    return None


def places(items: list[Solved], interval_s: Mapping[str, float]) -> dict[str, Score]:
    """How often the place reported of a local effect that was named meets the true one."""
    found: dict[str, list[bool]] = {}
    for item in items:
        for effect in item.truth["effects"]:
            group, between = GROUPS.get(effect["effect"]), interval_s.get(item.name)
            true = true_place(effect, between) if group else None
            seen = reported_place(item.answer, effect["effect"]) if true else None
            if not (group and true and seen):
                continue
            # A sample's place is known to a sample; of several all must lie in it.
            slack = between or 0.0 if group in ("lost samples", "glitches") else 0.0
            first, last = (true.low, true.high) if group == "glitches" else (true.high, true.low)
            held = seen.low - slack <= first and last <= seen.high + slack
            found.setdefault(group, []).append(held)
    return {group: share(held) for group, held in found.items()}


OWN_NAMES: Final[dict[str, dict[str, tuple[str, float, float]]]] = {
    "cubic-stiffness": {"k3": ("cubic", 1.0, -2)},
    "quadratic-stiffness": {"k2": ("square", 1.0, -1)},
    "stribeck-friction": {"f_s": ("stribeck", 1.0, 1), "v_s": ("stribeck_speed", 1.0, 1)},
    "presliding-friction": {"k_d": ("dahl", 1.0, 0), "z_c": ("dahl_reach", 1.0, 1)},
    "backlash": {"b": ("play", 2.0, 1)},
    "history-force": {"h": ("basset", 1.0, 0)},
    "release-transient": {"gamma": ("release", 0.5, 0), "tau": ("release_time", 1.0, 0)},
    "second-mode": {"f_2": ("frequency_hz", 1.0, 0), "tau_2": ("decay_s", 1.0, 0)},
    "equilibrium-step": {"J": ("rest_jump", 1.0, 1), "time": ("rest_jump_at", 1.0, 0)},
    "amplitude-step": {"s": ("scaling", 1.0, 0), "time": ("scaling_at", 1.0, 0)},
    "frequency-step": {"change": ("omega_jump", 1.0, 0), "time": ("omega_jump_at", 1.0, 0)},
    "impulse": {"dv": ("impulse", 1.0, 1), "time": ("impulse_at", 1.0, 0)},
    "sensor-quadratic": {"s2": ("square", 1.0, -1)},
    "sensor-cubic": {"s3": ("cubic", 1.0, -2)},
    "sensor-backlash": {"b": ("play_rad", 1.0, 1)},
    "tone-pickup": {"f_a": ("tone_hz", 1.0, 0)},
    "jitter": {"sigma_t": ("jitter_s", 1.0, 0)},
}
"""By effect and name in docs/effects.md: the parameter here, a factor, the power of the gain.

The solver knows the nominal V/rad only: what has the dimension of an angle appears to it times
the true gain over the nominal one.
"""


def pulls(singles: list[Solved]) -> Score:
    """Pulls and coverage of effects that act by the catalogue's own law and were named so."""
    off: list[float] = []
    covered: list[bool] = []
    for item in singles:
        effect, gain = item.effect, item.truth["nuisances"]["gain"]
        if not (effect["own_form"] and item.answer.lead == effect["effect"]):
            continue
        fitted = item.answer.content["effects"][0].get("parameters") or {}
        for name, (own, factor, power) in OWN_NAMES.get(effect["effect"], {}).items():
            estimate, known = fitted.get(name) or {}, effect["parameters"].get(own)
            value, sd = estimate.get("value"), estimate.get("sd")
            if value is None or not sd or known is None:
                continue
            true = known * factor * gain**power
            low, high = estimate.get("interval95") or (value - 1.96 * sd, value + 1.96 * sd)
            off.append((value - true) / sd)
            covered.append(bool(low <= true <= high))
    return {
        "mean": figure(np.mean, off),
        "sd": figure(np.std, off),
        "coverage68": share([abs(pull) < 1.0 for pull in off]),
        "coverage95": share(covered),
    }


def held_out(items: list[Solved]) -> Score:
    """Prediction of blocks that were not fitted, beside what knowing the effect would gain.

    Of the two halves each is predicted from the other: an effect of Delta chi^2 lambda,
    estimated from half of the record, gains half of lambda less 1 in log density.
    """
    known = []
    for item in items:
        blocks = item.answer.content.get("held_out") or {}
        if item.answer.detected and None not in (blocks.get("gain"), blocks.get("gain_sd")):
            known.append((item.size, float(blocks["gain"]), float(blocks["gain_sd"])))
    return {
        "improved": share([gain > 0.0 for _, gain, _ in known]),
        "worse_by_two_errors": share([gain < -2.0 * sd for _, gain, sd in known]),
        "share_of_the_expected": figure(
            np.median, [gain / (0.5 * size - 1.0) for size, gain, _ in known if size >= 50.0]
        ),
    }


def calibration(items: list[Solved]) -> Score:
    """Expected calibration error of the first names' probabilities."""
    rated = [i for i in items if i.answer.detected and math.isfinite(i.answer.probability)]
    # Of two effects either may come first.
    true = [any(true_of([i.answer.lead], e) for e in i.truth["effects"]) for i in rated]
    return figure(calibration_error, [i.answer.probability for i in rated], true, paired=True)


SEALS: Final = (
    *("set", "count", "sealed_at", "answered_at", "answered_by", "opened_at", "sets_before"),
    *("seed", "truth_sha256", "answers_sha256"),
)
"""Of an opened set: which it was, and when what was known."""


def score(opened: dict[str, Any], interval_s: Mapping[str, float] | None = None) -> Score:
    """All scores of an opened set.

    Parameters
    ----------
    opened
        Truth and answers.
    interval_s
        Between the samples of each recording, where known: the truth tells the places of
        lost and wild samples by their numbers.
    """
    items = read_items(opened)

    def family(*names: str) -> list[Solved]:
        return [item for item in items if item.truth["family"] in names]

    nulls = [item for item in family("null") if item.answer.solved]
    single, named = family("single"), family("single", "tie")
    kinds = [kind_of(i.answer.lead) == i.effect["kind"] for i in named if i.answer.lead]
    missed = [i for i in family("single", "withheld") if i.size > 30.0 and not i.answer.detected]
    found = {
        "set": {key: opened.get(key, UNRECORDED) for key in SEALS},
        "items": len(items),
        "families": dict(Counter(item.truth["family"] for item in items)),
        "unsolved": [item.name for item in items if not item.answer.solved],
        "false_alarms": {
            **share([item.alarmed for item in nulls]),
            "oracle": share([bool(item.oracle["detected"]) for item in nulls if item.oracle]),
            "named": dict(Counter(item.answer.lead for item in nulls if item.alarmed)),
            "rightly_called_coloured": sum(i.answer.detected and not i.alarmed for i in nulls),
        },
        "detection": detection(single),
        "naming": {
            band: naming([item for item in named if low <= item.size < high])
            for band, (low, high) in BANDS.items()
        },
        "dynamics_or_measurement": share(kinds),
        "others": dict(others(family)),
        "pulls": pulls(single),
        "held_out": held_out(single),
        "calibration": calibration(family("single", "tie", "outside")),
        "places": places(family("single", "tie", "combination"), interval_s or {}),
        "confusion": dict(Counter(f"{i.effect['effect']} -> {i.answer.lead}" for i in named)),
        "missed": [f"{i.name} | {i.effect['effect']} ({i.effect['law']})" for i in missed],
    }
    return {**found, "promises": promises(found)}


def promises(scores: Score) -> list[Score]:
    """Promises with what was measured; ``kept`` is None where there was too little to judge.

    But for false alarms it is the measured value that counts, and not the end of its interval that
    would flatter us.
    """
    alarms, confident = (
        scores["false_alarms"],
        scores["others"]["outside the catalogue: confidently wrong"],
    )
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
            "Δχ² | who | first | among three | in class | class size",
            (
                (
                    band,
                    who,
                    *(in_words(found[f"{key}{name}"]) for name in ("top1", "top3", "class")),
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
                ("red noise rightly called coloured", alarms["rightly_called_coloured"]),
                ("dynamics or measurement", in_words(scores["dynamics_or_measurement"])),
                *((what, in_words(found)) for what, found in scores["others"].items()),
                *(
                    (f"{part}: {what}".replace("_", " "), in_words(found))
                    for part in ("pulls", "held_out", "places")
                    for what, found in scores[part].items()
                ),
            ),
        ),
        *table("not detected above Δχ² = 30 | hidden", ((row,) for row in scores["missed"])),
    ]
    return "\n".join(lines) + "\n"
