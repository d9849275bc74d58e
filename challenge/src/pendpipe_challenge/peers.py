"""Simpler judges of the same recordings: AIC, BIC, a test of whiteness, and PySINDy.

PySINDy (sparse regression on derivatives) is an extra (``pip install "pendpipe[bench]"``). It
judges a part of a set when that is scored, long after it was solved: nothing of it is near the
solver.
"""

from __future__ import annotations

import importlib.util
import time
import warnings
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe_challenge import intervals
from pendpipe_challenge.answers import Solved, right
from pendpipe_challenge.oracle import FREEDOM


def peers(nulls: list[Solved], singles: list[Solved]) -> dict[str, Any]:
    """AIC, BIC and a whiteness test on the same items, with the oracle's own residuals.

    They are given the true noise spectrum and the oracle's linear scores, which flatters
    them.
    """

    def chosen(item: Solved, cost: float) -> str:
        scores = item.oracle["scores"]
        worth = {n: u - cost * FREEDOM.get(n, 1) for n, u in scores.items()}
        best = max(worth, key=lambda name: worth[name])
        return best if worth[best] > 0.0 else ""

    found = {}
    for name in ("aic", "bic", "whiteness"):

        def chooses(item: Solved, name: str = name) -> str:
            if name == "whiteness":
                return "?" if item.oracle["whiteness_p"] < 0.01 else ""
            cost = 2.0 if name == "aic" else float(np.log(item.truth["nuisances"]["samples"]))
            return chosen(item, cost)

        seen = [item for item in singles if item.oracle and chooses(item)]
        found[name] = {
            "false_alarms": intervals.of([bool(chooses(i)) for i in nulls if i.oracle]),
            "detected": intervals.of([bool(chooses(i)) for i in singles if i.oracle]),
            "top1": None
            if name == "whiteness"
            else intervals.of([right(chooses(i), i.effect) for i in seen]),
        }
    return found


FIRST: Final = 100
"""Of the nulls and of the singles with Eq. 8 for a baseline: so many, by number."""
PATIENCE_S: Final = 180.0
"""What comes later is not judged; the page tells how many were."""
INSTALL: Final = 'pip install "pendpipe[bench]"'
SINDY: Final = {
    "x^2": "quadratic-stiffness",
    "x^3": "cubic-stiffness",
    "x^2 v": "cubic-damping",
    "v^3": "cubic-damping",
    "x v": None,
}
"""Terms of the library that Eq. 8 does not have."""


class Judgement(NamedTuple):
    """A peer's answer about a recording."""

    missing: bool
    name: str | None


def by_sindy(time_s: FloatArray, angle_rad: FloatArray, omega: float) -> Judgement:
    """Pysindy on smoothed derivatives: the threshold that predicts the last third best.

    Angles in units of the amplitude and times of 1/omega, so that one threshold suits all
    terms; the library holds Eq. 8's terms and those of `SINDY`.
    """
    import pysindy as ps

    scale = float(np.abs(angle_rad).max())
    t = omega * (time_s - time_s[0])
    step = float(t[-1] / (len(t) - 1))
    smooth = ps.SmoothedFiniteDifference(smoother_kws={"window_length": 7, "polyorder": 3})
    x = angle_rad / scale
    v = np.asarray(smooth(x[:, None], step))[:, 0]
    a = np.asarray(smooth(v[:, None], step))[:, 0]
    terms = {
        "1": np.ones_like(x),
        "x": x,
        "v": v,
        "x^2": x**2,
        "x^3": x**3,
        "v|v|": v * np.abs(v),
        "sign v": np.sign(v),
        "x v": x * v,
        "x^2 v": x**2 * v,
        "v^3": v**3,
    }
    library = np.column_stack(list(terms.values()))[5:-5]
    target, cut = a[5:-5, None], 2 * (len(x) - 10) // 3
    best, chosen = np.inf, np.zeros(len(terms))
    for threshold in np.geomspace(1e-5, 0.3, 12):
        optimizer = ps.STLSQ(threshold=float(threshold), alpha=0.0, normalize_columns=False)
        optimizer.fit(library[:cut], target[:cut])
        weights = np.asarray(optimizer.coef_).ravel()
        error = float(np.mean((target[cut:, 0] - library[cut:] @ weights) ** 2))
        if error < best:
            best, chosen = error, weights
    extra = {n: abs(w) for n, w in zip(terms, chosen, strict=True) if n in SINDY and w != 0.0}
    if not extra:
        return Judgement(False, None)
    return Judgement(True, SINDY[max(extra, key=lambda name: extra[name])])


def sindy_scores(items: list[Solved], folder: Path) -> dict[str, Any]:
    """Judge the first nulls and singles of a set; ``install`` is how, where it can't be.

    It is given the frequency and until when the pendulum moves, which flatters it.
    """
    if importlib.util.find_spec("pysindy") is None:
        return {"install": INSTALL}
    nulls, singles = (
        [
            item
            for item in items
            if item.truth["family"] == family and item.truth["baseline"] == "eq8"
        ][:FIRST]
        for family in ("null", "single")
    )
    end = time.monotonic() + PATIENCE_S
    alarms: list[bool] = []
    found: list[tuple[Judgement, dict[str, Any]]] = []
    for item in filter(None, chain.from_iterable(zip_longest(nulls, singles))):
        path = folder / "recordings" / f"{item.name}.csv"
        if not path.is_file() or time.monotonic() > end:
            continue
        judged = _judged(item, path)
        if item.truth["family"] == "null":
            alarms.append(judged.missing)
        else:
            found.append((judged, item.effect))
    seen = [right(str(judged.name), effect) for judged, effect in found if judged.missing]
    return {
        "false_alarms": intervals.of(alarms),
        "detected": intervals.of([judged.missing for judged, _ in found]),
        "top1": intervals.of(seen),
    }


def _judged(item: Solved, path: Path) -> Judgement:
    """Read a recording (comments, a header, rows) and judge it; pysindy warns of much."""
    known = item.truth["nuisances"]
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if not line.startswith("#")][1:]
    time_s, reading = np.loadtxt(rows, delimiter=",", unpack=True)
    kept = time_s <= known["judged_until_s"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return by_sindy(time_s[kept], reading[kept], 2.0 * np.pi * known["frequency_hz"])
