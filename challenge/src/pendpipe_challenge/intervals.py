"""Intervals of rates, the size at which something is found, and how pages write them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray, IntArray


def rate(hits: int, count: int) -> dict[str, Any]:
    """A rate with its exact 95 % interval (Clopper and Pearson)."""
    from scipy.stats import beta

    if count == 0:
        return {"hits": 0, "of": 0, "rate": None, "interval95": [None, None]}
    low = 0.0 if hits == 0 else float(beta.ppf(0.025, hits, count - hits + 1))
    high = 1.0 if hits == count else float(beta.ppf(0.975, hits + 1, count - hits))
    return {"hits": hits, "of": count, "rate": hits / count, "interval95": [low, high]}


def of(truths: Sequence[bool]) -> dict[str, Any]:
    """The rate of a list of yes and no."""
    return rate(int(sum(truths)), len(truths))


def of_clusters(truths: Sequence[bool], clusters: Sequence[str]) -> dict[str, Any]:
    """The rate of a list of yes and no whose members of one cluster depend on each other.

    Korn and Graubard (Survey Methodology 24, 193, 1998): Clopper and Pearson's interval for so
    many independent items as would have the variance that is seen between k clusters,
    n' = p (1 - p)/V [t(n - 1)/t(k - 1)]^2, and at most n. Where all are yes or all are no,
    nothing is seen of that variance, and each cluster counts once.

    Returns
    -------
    dict
        As `rate`, and ``clusters``.
    """
    from scipy.stats import beta, t

    found, count = of(truths), len(truths)
    names, at = np.unique(np.asarray(clusters, dtype=object), return_inverse=True)
    number = len(names)
    if number < 2:
        # One cluster shows nothing of how clusters differ.
        return {**found, "interval95": [0.0, 1.0] if count else [None, None], "clusters": number}
    p = found["rate"]
    excess = np.bincount(at, weights=np.asarray(truths, np.float64) - p)
    variance = number / (number - 1) * float(excess @ excess) / count**2
    worth = float(number)
    if 0.0 < p < 1.0:
        worth = p * (1.0 - p) / variance if variance > 0.0 else np.inf
        worth *= float(t.ppf(0.975, count - 1) / t.ppf(0.975, number - 1)) ** 2
    worth = min(worth, count)
    hits = p * worth
    low = 0.0 if p == 0.0 else float(beta.ppf(0.025, hits, worth - hits + 1))
    high = 1.0 if p == 1.0 else float(beta.ppf(0.975, hits + 1, worth - hits))
    return {**found, "interval95": [low, high], "clusters": number}


def ratio(
    above: Sequence[float], below: Sequence[float], *, paired: bool = False, draws: int = 500
) -> dict[str, Any]:
    """The ratio of two means with its 95 % interval, items drawn anew.

    Parameters
    ----------
    above, below
        A number for each item.
    paired
        Whether they are of the same items, which are then drawn together.
    draws
        Bootstrap samples.
    """
    own, best = np.asarray(above, np.float64), np.asarray(below, np.float64)
    if not len(own) or not len(best) or best.mean() == 0.0:
        return {"ratio": None, "interval95": [None, None]}
    random = np.random.default_rng(1)
    first = random.integers(0, len(own), (draws, len(own)))
    second = first if paired else random.integers(0, len(best), (draws, len(best)))
    bottom = best[second].mean(axis=1)
    drawn = own[first].mean(axis=1)[bottom > 0.0] / bottom[bottom > 0.0]
    return {"ratio": float(own.mean() / best.mean()), "interval95": _middle(drawn)}


def median(values: Sequence[float], *, draws: int = 500) -> dict[str, Any]:
    """The median with its 95 % interval, items drawn anew."""
    return _drawn_anew(values, np.median, draws)


def mean(values: Sequence[float], *, draws: int = 500) -> dict[str, Any]:
    """The mean with its 95 % interval, items drawn anew."""
    return _drawn_anew(values, np.mean, draws)


def spread(values: Sequence[float], *, draws: int = 500) -> dict[str, Any]:
    """The standard deviation with its 95 % interval, items drawn anew."""
    return _drawn_anew(values, np.std, draws, ddof=1)


def _drawn_anew(
    values: Sequence[float], what: Callable[..., Any], draws: int, **options: Any
) -> dict[str, Any]:
    known = np.asarray(values, np.float64)
    if len(known) < 2:
        return {"value": None, "interval95": [None, None], "of": len(known)}
    pick = np.random.default_rng(1).integers(0, len(known), (draws, len(known)))
    drawn = what(known[pick], axis=1, **options)
    return {
        "value": float(what(known, **options)),
        "interval95": _middle(drawn),
        "of": len(known),
    }


def _middle(drawn: FloatArray) -> list[float]:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return [float(low), float(high)]


def power_curve(sizes: FloatArray, found: FloatArray) -> tuple[float, float]:
    """Fit P(found) = Phi((sqrt(size) - m)/s) by maximum likelihood.

    Returns
    -------
    tuple
        The sizes at which a half and nine tenths are found.
    """
    from scipy.optimize import minimize
    from scipy.special import ndtr

    root = np.sqrt(sizes)

    def cost(p: FloatArray) -> float:
        chance = np.clip(ndtr((root - p[0]) / np.exp(p[1])), 1e-4, 1 - 1e-4)
        # A weak rein on the width, so that perfectly separated data have an answer.
        rein = 0.5 * (p[1] / 1.5) ** 2
        return float(rein - np.sum(np.where(found > 0, np.log(chance), np.log1p(-chance))))

    m, width = minimize(cost, [5.0, 0.0], method="Nelder-Mead").x
    return float(max(m, 0.0) ** 2), float(max(m + 1.2816 * np.exp(width), 0.0) ** 2)


def power_ratio(
    sizes: FloatArray, found: FloatArray, oracle: FloatArray, *, draws: int = 200
) -> dict[str, Any]:
    """Sizes at which a half and nine tenths are found, beside the oracle's, with intervals."""
    if len(sizes) < 10:
        return {"items": len(sizes)}
    random = np.random.default_rng(1)
    own, best = power_curve(sizes, found), power_curve(sizes, oracle)
    ratios = []
    for _ in range(draws):
        pick = random.integers(0, len(sizes), len(sizes))
        a, b = power_curve(sizes[pick], found[pick]), power_curve(sizes[pick], oracle[pick])
        ratios.append([a[0] / max(b[0], 1e-9), a[1] / max(b[1], 1e-9)])
    low, high = np.quantile(ratios, [0.025, 0.975], axis=0)
    return {
        "items": len(sizes),
        "half": {
            "found": own[0],
            "oracle": best[0],
            "ratio": own[0] / max(best[0], 1e-9),
            "interval95": [low[0], high[0]],
        },
        "nine_tenths": {
            "found": own[1],
            "oracle": best[1],
            "ratio": own[1] / max(best[1], 1e-9),
            "interval95": [low[1], high[1]],
        },
    }


def calibration(
    probability: FloatArray, correct: FloatArray, bins: int = 10, draws: int = 500
) -> dict[str, Any]:
    """Reliability of stated probabilities and their expected calibration error.

    ``by_chance`` is the error that perfect probabilities would show on as many items: few
    items scatter about what was stated, and every scatter counts.
    """
    random = np.random.default_rng(1)
    edges = np.linspace(0.0, 1.0, bins + 1)
    place = np.clip(np.digitize(probability, edges) - 1, 0, bins - 1)
    rows = []
    for number in np.unique(place):
        here = place == number
        stated, met = float(probability[here].mean()), float(correct[here].mean())
        ends = [float(edges[number]), float(edges[number + 1])]
        rows.append(
            {"edges": ends, "stated": stated, "met": met, **of((correct[here] > 0).tolist())}
        )
    count = len(probability)
    again = [random.integers(0, count, count) for _ in range(draws)] if count else []
    errors = [_error(probability[pick], correct[pick], place[pick], bins) for pick in again]
    perfect = [
        _error(probability, (random.random(count) < probability).astype(float), place, bins)
        for _ in again
    ]
    return {
        "expected_calibration_error": _error(probability, correct, place, bins) if count else None,
        "interval95": _middle(np.array(errors)) if count else [None, None],
        "by_chance": float(np.median(perfect)) if count else None,
        "bins": rows,
        "items": count,
    }


def _error(probability: FloatArray, correct: FloatArray, place: IntArray, bins: int) -> float:
    """Mean distance of what was stated from what came true, over bins."""
    gap = np.bincount(place, weights=probability - correct, minlength=bins)
    return float(np.abs(gap).sum() / len(probability))


Score = dict[str, Any]


def percent(score: Score | None) -> str:
    """A rate as hits of count, with its 95 % interval."""
    if not score or score.get("rate") is None:
        return "none to judge"
    low, high = score["interval95"]
    return (
        f"{100 * score['rate']:.1f} % ({score['hits']} of {score['of']};"
        f" {100 * low:.1f} to {100 * high:.1f} %)"
    )


def number(value: float | None, form: str = ".2f") -> str:
    """A number or a dash."""
    return "-" if value is None else format(value, form)


def with_interval(value: float | None, score: Score, form: str = ".2f") -> str:
    """A number with its 95 % interval."""
    if value is None:
        return "too few items"
    low, high = score["interval95"]
    return f"{number(value, form)} ({number(low, form)} to {number(high, form)})"
