"""What is measured of the answers, each beside the oracle's: alarms, names, places, values."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe_challenge import intervals
from pendpipe_challenge.answers import Answer, Solved, right
from pendpipe_challenge.catalogue import kind_of


def alarmed(item: Solved) -> bool:
    """A null called missing physics; the colour of noise that is red is no false alarm."""
    if not item.answer.detected:
        return False
    red = item.truth["nuisances"]["alpha"] > 0.0
    return not (red and set(item.answer.names) <= {"coloured-noise"})


def false_alarms(nulls: list[Solved]) -> dict[str, Any]:
    """How often nothing was called something, at the nominal 1 %."""
    solved = [item for item in nulls if item.answer.solved]
    hard = [item for item in solved if item.truth["nuisances"]["freedom"] > 0.0]
    return {
        **intervals.of([alarmed(item) for item in solved]),
        "nominal": 0.01,
        "at_five_percent": intervals.of([_doubted(i) for i in solved if not _coloured(i)]),
        "named": dict(Counter(item.answer.lead for item in solved if alarmed(item))),
        "rightly_called_coloured": sum(map(_coloured, solved)),
        "heavy_tailed": intervals.of([alarmed(item) for item in hard]),
        "stopped": intervals.of([alarmed(i) for i in solved if i.truth["nuisances"]["stops"]]),
        "oracle": intervals.of([bool(item.oracle["detected"]) for item in nulls if item.oracle]),
    }


def _coloured(item: Solved) -> bool:
    """Red noise rightly called coloured."""
    return item.answer.detected and not alarmed(item)


def _doubted(item: Solved) -> bool:
    """Whether the answer's own p-value lies below 5 %."""
    p_value = item.answer.content.get("p_value")
    return p_value is not None and float(p_value) < 0.05


def noise_of(item: Solved) -> str:
    """A null's noise in words."""
    known = item.truth["nuisances"]
    if known["freedom"] > 0.0:
        return "heavy-tailed noise"
    return "red noise" if known["alpha"] > 0.0 else "white noise"


BANDS: Final = {
    "all": (0.0, np.inf),
    "50": (35.0, 70.0),
    "100": (70.0, 200.0),
    "400": (200.0, 1e3),
}
"""Of Delta chi^2, by the size that was wanted."""


def naming(items: list[Solved]) -> dict[str, Any]:
    """Top-1, top-3 and class among the detected, by size, beside the oracle's."""
    return {
        band: _of_band([item for item in items if low <= item.size < high])
        for band, (low, high) in BANDS.items()
    }


def _of_band(items: list[Solved]) -> dict[str, Any]:
    """Names of one band; accuracies of both judges are over all items, found or not."""
    solver = [item for item in items if item.answer.detected]
    oracle = [item for item in items if item.oracle.get("detected")]
    hit = [any(right(n, i.effect) for n in i.answer.members) for i in items]
    best = [bool(i.oracle.get("detected")) and _in_oracles(i, "class") for i in items]
    sizes = [len(i.answer.members) for i in solver]
    ceilings = [len(i.oracle["class"]) for i in oracle]
    return {
        "top1": intervals.of([right(i.answer.lead, i.effect) for i in solver]),
        "top3": intervals.of([any(right(n, i.effect) for n in i.answer.names[:3]) for i in solver]),
        "class": intervals.of([any(right(n, i.effect) for n in i.answer.members) for i in solver]),
        "class_size": _mean(sizes),
        "oracle_top1": intervals.of([right(i.oracle["named"], i.effect) for i in oracle]),
        "oracle_top3": intervals.of([_in_oracles(i, "top3") for i in oracle]),
        "oracle_class": intervals.of([_in_oracles(i, "class") for i in oracle]),
        "oracle_class_size": _mean(ceilings),
        "class_size_ratio": intervals.ratio(sizes, ceilings),
        "class_and_detected": intervals.of(hit),
        "oracle_class_and_detected": intervals.of(best),
        "share_of_the_oracle": intervals.ratio(hit, best, paired=True),
    }


def _in_oracles(item: Solved, names: str) -> bool:
    return any(right(name, item.effect) for name in item.oracle[names])


def dynamics_or_measurement(items: list[Solved]) -> dict[str, Any]:
    """Whether the fault is looked for in the pendulum or in the instrument, of the detected."""
    oracle = [item for item in items if item.oracle.get("detected")]
    return {
        **intervals.of([i.answer.kind == i.effect["kind"] for i in items if i.answer.detected]),
        "oracle": intervals.of([kind_of(i.oracle["named"]) == i.effect["kind"] for i in oracle]),
    }


def confusion(items: list[Solved]) -> dict[str, dict[str, int]]:
    """Effect hidden against first name."""
    table: dict[str, dict[str, int]] = {}
    for item in items:
        row = table.setdefault(item.effect["effect"], {})
        row[item.answer.lead] = row.get(item.answer.lead, 0) + 1
    return table


def _mean(values: list[int]) -> float | None:
    return float(np.mean(values)) if values else None


THRESHOLDS: Final = tuple(np.linspace(0.0, 0.95, 20).round(2).tolist())
"""Probabilities below which an answer might be withheld."""


def rated(items: list[Solved]) -> list[Solved]:
    """Items whose first name has a probability."""
    return [i for i in items if i.answer.detected and np.isfinite(i.answer.probability)]


def true_of_any(item: Solved) -> bool:
    """Whether the first name is that of an effect that is there: of two, either may come first."""
    return any(right(item.answer.lead, effect) for effect in item.truth["effects"])


def calibration(items: list[Solved]) -> dict[str, Any]:
    """Compare stated probabilities of the first name with how often they come true."""
    named = rated(items)
    return intervals.calibration(
        np.array([i.answer.probability for i in named]),
        np.array([true_of_any(i) for i in named], dtype=float),
    )


def abstention(items: list[Solved]) -> list[dict[str, Any]]:
    """Accuracy of the first names, if those below a probability are withheld.

    Returns
    -------
    list
        Of each threshold: ``threshold``; ``answered``, the rate of names above it among all;
        and ``accuracy``, how many of those are right.
    """
    named = rated(items)
    rows = []
    for threshold in THRESHOLDS:
        kept = [item for item in named if item.answer.probability >= threshold]
        rows.append(
            {
                "threshold": threshold,
                "answered": intervals.rate(len(kept), len(named)),
                "accuracy": intervals.of([true_of_any(item) for item in kept]),
            }
        )
    return rows


CONFIDENT: Final = 0.8


def combinations(items: list[Solved]) -> dict[str, Any]:
    """Two effects: both, one or none found, cancelling pairs apart."""

    def each(item: Solved) -> list[bool]:
        return [any(right(n, e) for n in item.answer.names) for e in item.truth["effects"]]

    plain = [item for item in items if not item.truth["cancelling"]]
    hiding = [item for item in items if item.truth["cancelling"]]
    large = [i for i in plain if all(e["delta_chi2"] > 200 for e in i.truth["effects"])]
    return {
        "both": intervals.of([all(each(item)) for item in plain]),
        "both_at_400": intervals.of([all(each(item)) for item in large]),
        "either": intervals.of([any(each(item)) for item in plain]),
        "oracle_both": intervals.of([all(i.oracle["found_each"]) for i in plain if i.oracle]),
        "cancelling_detected": intervals.of([item.answer.detected for item in hiding]),
        "cancelling_oracle": intervals.of([i.oracle["detected"] for i in hiding if i.oracle]),
        "cancelling_either": intervals.of([any(each(item)) for item in hiding]),
    }


def confident_and_wrong(item: Solved) -> bool:
    """Whether what is outside the catalogue was given a name of it without doubt."""
    named = item.answer.detected and not item.answer.lead.startswith("unnamed-")
    return named and item.answer.probability > CONFIDENT


def outside(items: list[Solved]) -> dict[str, Any]:
    """Effects outside the catalogue: unnamed, of the right kind, or confidently wrong."""
    large = [item for item in items if item.effect["left_by_catalogue"] > 70.0]

    def unnamed(item: Solved) -> bool:
        return item.effect["effect"] in item.answer.names

    return {
        "detected": intervals.of([item.answer.detected for item in items]),
        "oracle_detected": _oracle_detected(items),
        "unnamed_of_the_right_kind": intervals.of([unnamed(i) for i in large]),
        "unnamed_of_any_kind": intervals.of(
            [any(n.startswith("unnamed-") for n in i.answer.names) for i in large]
        ),
        "confident_wrong_names": intervals.of([confident_and_wrong(i) for i in items]),
        "confident_wrong_names_of_large_ones": intervals.of(
            [confident_and_wrong(i) for i in large]
        ),
        "named": dict(Counter(i.answer.lead for i in items if i.answer.detected)),
    }


def ties(items: list[Solved]) -> dict[str, Any]:
    """Rivals that one record cannot tell apart: the class and what would decide."""
    found = [item for item in items if item.answer.detected]

    def credited(item: Solved) -> bool:
        entry = item.answer.content["effects"][0]
        hit = any(right(n, item.effect) for n in item.answer.members)
        return hit and len(item.answer.members) > 1 and bool(entry.get("deciding_measurement"))

    return {
        "class_and_deciding_measurement": intervals.of([credited(item) for item in found]),
        "lone_confident_names": intervals.of(
            [len(i.answer.members) == 1 and i.answer.probability > CONFIDENT for i in found]
        ),
        "in_class": intervals.of(
            [any(right(n, i.effect) for n in i.answer.members) for i in found]
        ),
        "oracle_in_class": _oracle_in_class(items),
    }


def withheld(items: list[Solved]) -> dict[str, Any]:
    """Known physics that the baseline lacks, at full size."""
    return {
        "detected": intervals.of([item.answer.detected for item in items]),
        "oracle_detected": _oracle_detected(items),
        "in_class": intervals.of(
            [any(right(n, i.effect) for n in i.answer.members) for i in items]
        ),
        "oracle_in_class": _oracle_in_class(items),
    }


def _oracle_detected(items: list[Solved]) -> dict[str, Any]:
    return intervals.of([bool(item.oracle["detected"]) for item in items if item.oracle])


def _oracle_in_class(items: list[Solved]) -> dict[str, Any]:
    """Of those that the oracle detects: its class holds what was hidden."""
    seen = [item for item in items if item.oracle.get("detected")]
    return intervals.of([any(right(n, i.effect) for n in i.oracle["class"]) for i in seen])


def real(items: list[Solved]) -> dict[str, Any]:
    """Real recordings: the change is named, and its twin's answer does not name it.

    Items of one recording share its apparatus and its flaws: the intervals are those of
    recordings drawn anew, not of items.
    """
    sources = [i.truth["source"] for i in items]
    changed = [any(right(n, i.effect) for n in i.answer.names) for i in items]
    before = [i.twin is not None and any(right(n, i.effect) for n in i.twin.names) for i in items]
    pairs = list(zip(changed, before, strict=True))
    return {
        "named": intervals.of_clusters(changed, sources),
        "named_without_it": intervals.of_clusters(before, sources),
        "newly_named": intervals.of_clusters([c and not b for c, b in pairs], sources),
        "by_change": {
            i.name: {
                "effect": i.effect["effect"],
                "source": i.truth["source"],
                "named": c,
                "twin_named": b,
            }
            for i, c, b in zip(items, changed, before, strict=True)
        },
    }


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
"""What is local in time or frequency, and how the page sums it up."""
_INSTANTS: Final = ("impulse", "rest_jump", "omega_jump", "gamma_jump", "scaling", "rub")
_HERTZ: Final = {"tone_hz": 1.0, "hertz": 1.0, "frequency_hz": 1.0, "drive_omega": 0.5 / math.pi}


class Place(NamedTuple):
    """An interval of time (s) or frequency (Hz); of no width where it is a point."""

    low: float
    high: float


def places(items: list[Solved], interval_s: Mapping[str, float]) -> dict[str, Any]:
    """Ask of each kind of local effect that was named whether it is where the answer puts it.

    Parameters
    ----------
    items
        Items with one effect or two.
    interval_s
        Between the samples of each recording, where known.

    Returns
    -------
    dict
        By group: the rate, ``unit``, the median ``width`` of the places reported, and the
        median ``error`` of their middles.
    """
    found: dict[str, list[tuple[bool, float, float]]] = {}
    for item in items:
        for effect in item.truth["effects"]:
            group = GROUPS.get(effect["effect"])
            true = true_place(effect, interval_s.get(item.name))
            reported = _reported(item, effect["effect"]) if group and true else None
            if group is None or true is None or reported is None:
                continue
            # A sample's place is known to a sample.
            slack = interval_s[item.name] if group in ("lost samples", "glitches") else 0.0
            if group == "glitches":
                held = reported.low - slack <= true.low and true.high <= reported.high + slack
            else:
                held = reported.low - slack <= true.high and true.low <= reported.high + slack
            middle = 0.5 * (reported.low + reported.high)
            error = max(true.low - middle, middle - true.high, 0.0)
            found.setdefault(group, []).append((held, reported.high - reported.low, error))
    return {
        group: {
            **intervals.of([held for held, _, _ in found[group]]),
            "unit": "Hz" if group == "tones" else "s",
            "width": float(np.median([width for _, width, _ in found[group]])),
            "error": float(np.median([error for _, _, error in found[group]])),
        }
        for group in dict.fromkeys(GROUPS.values())
        if group in found
    }


def true_place(effect: dict[str, Any], interval_s: float | None) -> Place | None:
    """Where an effect is; None where the truth does not tell."""
    known = effect["parameters"]
    for name in _INSTANTS:
        if f"{name}_at" in known:
            begin = float(known[f"{name}_at"])
            return Place(begin, begin + float(known.get(f"{name}_width", 0.0)))
    for name, factor in _HERTZ.items():
        if name in known:
            return Place(factor * float(known[name]), factor * float(known[name]))
    samples = [float(value) for name, value in known.items() if name.startswith("sample")]
    if not samples or interval_s is None:
        return None
    return Place(min(samples) * interval_s, max(samples) * interval_s)


def _reported(item: Solved, name: str) -> Place | None:
    """Where the answer puts an effect that it names: its fitted frequency, or its times."""
    for entry in item.answer.content.get("effects") or []:
        if entry["id"] != name:
            continue
        if GROUPS[name] == "tones":
            fitted = (entry.get("parameters") or {}).values()
            hertz = [each for each in fitted if each.get("unit") == "Hz"]
            ends = hertz[-1].get("interval95") if hertz else None
        else:
            ends = (entry.get("location") or {}).get("time_s")
        return Place(*map(float, ends)) if ends else None
    return None


def expected(truth: dict[str, Any]) -> dict[str, float]:
    """What the first effect's parameters should be, by the names of ``docs/effects.md``.

    The solver knows the nominal V/rad only: what has the dimension of an angle appears to it
    times the true gain over the nominal one.
    """
    effect, known = truth["effects"][0], truth["nuisances"]
    p, name = effect["parameters"], effect["effect"]
    gain, hertz = known["gain"], known["frequency_hz"]
    omega = 2.0 * np.pi * hertz
    straight = effect["law"] == "straight"
    table: dict[str, dict[str, tuple[str, float]]] = {
        "cubic-stiffness": {"k3": ("cubic", gain**-2)},
        "quadratic-stiffness": {"k2": ("square", 1.0 / gain)},
        "coulomb-friction": {"c": ("coulomb", 2.0 / np.pi / omega * gain)},
        "quadratic-drag": {"a": ("quadratic", 2.0 / np.pi * omega / gain)},
        "stribeck-friction": {
            "f_s": ("stribeck", gain),
            "v_s": ("stribeck_speed", gain),
        },
        "presliding-friction": {"k_d": ("dahl", 1.0), "z_c": ("dahl_reach", gain)},
        "backlash": {"b": ("play", 2.0 * gain)},
        "history-force": {"h": ("basset", 1.0)},
        "release-transient": {"gamma": ("release", 0.5), "tau": ("release_time", 1.0)},
        "second-mode": {"f_2": ("frequency_hz", 1.0), "tau_2": ("decay_s", 1.0)},
        "plane-coupling": {"detuning": ("detuning", hertz)},
        "frequency-drift": {"rate": ("omega_drift", 1.0)} if straight else {},
        "equilibrium-step": {"J": ("rest_jump", gain), "time": ("rest_jump_at", 1.0)},
        "amplitude-step": {"s": ("scaling", 1.0), "time": ("scaling_at", 1.0)},
        "frequency-step": {"change": ("omega_jump", 1.0), "time": ("omega_jump_at", 1.0)},
        "impulse": {"dv": ("impulse", gain), "time": ("impulse_at", 1.0)},
        "sensor-quadratic": {"s2": ("square", 1.0 / gain)},
        "sensor-cubic": {"s3": ("cubic", gain**-2)},
        "sensor-backlash": {"b": ("play_rad", gain)},
        "offset-drift": {"rate": ("drift_volts_s", 1.0 / 3.85)} if straight else {},
        "gain-drift": {"rate": ("gain_drift", 1.0)} if straight else {},
        "clock-drift": {"rate": ("clock_drift", 1.0)} if straight else {},
        "tone-pickup": {"f_a": ("tone_hz", 1.0)},
        "jitter": {"sigma_t": ("jitter_s", 1.0)},
    }
    wanted = table.get(name, {})
    return {theirs: p[ours] * factor for theirs, (ours, factor) in wanted.items() if ours in p}


def pulls_of(items: list[tuple[dict[str, Any], Answer]]) -> dict[str, Any]:
    """Pulls and coverage of effects that act by the catalogue's own law and were named so."""
    pulls: list[float] = []
    covered: list[bool] = []
    by_effect: dict[str, list[float]] = {}
    for truth, answer in items:
        effect = truth["effects"][0]
        if not (answer.detected and effect["own_form"] and answer.lead == effect["effect"]):
            continue
        fitted = answer.content["effects"][0].get("parameters") or {}
        for name, true in expected(truth).items():
            estimate = fitted.get(name) or {}
            value, sd = estimate.get("value"), estimate.get("sd")
            if value is None or not sd:
                continue
            pulls.append((value - true) / sd)
            by_effect.setdefault(f"{effect['effect']} {name}", []).append(pulls[-1])
            low, high = estimate.get("interval95") or [value - 1.96 * sd, value + 1.96 * sd]
            covered.append(bool(low <= true <= high))
    middle = float(np.median(pulls)) if pulls else 0.0
    return {
        "parameters": len(pulls),
        "mean": intervals.mean(pulls),
        "median": intervals.median(pulls),
        "sd": intervals.spread(pulls),
        "robust_sd": intervals.median([1.4826 * abs(pull - middle) for pull in pulls]),
        "coverage68": intervals.of([abs(pull) < 1.0 for pull in pulls]),
        "coverage95": intervals.of(covered),
        "by_parameter": by_effect,
    }
