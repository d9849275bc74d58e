"""Intervals of rates, and the size at which something is found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray


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
        "half": {"found": own[0], "oracle": best[0], "ratio": own[0] / best[0],
                 "interval95": [low[0], high[0]]},
        "nine_tenths": {"found": own[1], "oracle": best[1], "ratio": own[1] / best[1],
                        "interval95": [low[1], high[1]]},
    }  # fmt: skip


def calibration(probability: FloatArray, correct: FloatArray, bins: int = 10) -> dict[str, Any]:
    """Reliability of stated probabilities and their expected calibration error."""
    edges = np.linspace(0.0, 1.0, bins + 1)
    place = np.clip(np.digitize(probability, edges) - 1, 0, bins - 1)
    rows, error = [], 0.0
    for number in range(bins):
        here = place == number
        if here.any():
            stated, met = float(probability[here].mean()), float(correct[here].mean())
            error += here.mean() * abs(stated - met)
            rows.append({"stated": stated, "met": met, **of(correct[here] > 0)})
    return {"expected_calibration_error": float(error), "bins": rows, "items": len(probability)}
