"""One item: a recording, what is true of it, and what the oracle says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge.bench import Bench, Point
from pendpipe.challenge.oracle import Oracle, Verdict
from pendpipe.challenge.refitted import refitted
from pendpipe.challenge.registry import kind_of
from pendpipe.challenge.scenario import Scenario
from pendpipe.challenge.shifted import shift_score
from pendpipe.challenge.sizing import Sized


@dataclass(frozen=True)
class Item:
    """One recording (codes of `scenario`'s converter) and what is true of it.

    Parameters
    ----------
    scenario
        Everything that made it; its chain, interval and count make the file.
    codes
        The converter's codes, shape (samples,).
    truth
        ``family``, ``baseline``, ``effects`` (see `effect_truth`), ``nuisances``,
        ``oracle`` (None where it was not asked).
    """

    scenario: Scenario
    codes: IntArray
    truth: dict[str, Any]

    @property
    def volts(self) -> FloatArray:
        """The readings as the file has them."""
        return np.asarray(self.codes * self.scenario.chain.step_volts)

    @property
    def angle_rad(self) -> FloatArray:
        """The readings by the nominal V/rad."""
        return self.volts / self.scenario.chain.nominal_volts_per_radian


def about(bench: Bench, point: Point) -> Oracle:
    """The oracle about the baseline's best point, kept with the bench."""
    scenario = bench.scenario
    level = point.level_rad * scenario.chain.nominal_volts_per_radian
    there = replace(scenario, motion=point.motion, chain=scenario.chain.changed(offset_volts=level))
    return Oracle(Bench(there, bench.kept))


def judge(bench: Bench, point: Point, scenario: Scenario, codes: IntArray) -> Verdict:
    """The oracle's verdict on the recorded codes."""
    angle = scenario.chain.step_rad * codes.astype(np.float64)
    oracle = about(bench, point)
    residual = oracle.bench.residual(angle)
    more = {"dropped-samples": shift_score(bench, angle, residual)}
    if more["dropped-samples"] == 0.0:
        more |= refitted(oracle, angle, residual)
    verdict = oracle.judge(residual, codes, more)
    return replace(verdict, whiteness_p=whiteness(oracle.bench.off(residual)))


def whiteness(residual: FloatArray, lags: int = 20) -> float:
    """Ljung and Box's test of a residual: the p-value of its first autocorrelations."""
    from scipy.stats import chi2

    count = len(residual)
    centred = residual - residual.mean()
    square = float(centred @ centred)
    found = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / square
    statistic = count * (count + 2.0) * np.sum(found**2 / (count - np.arange(1, lags + 1)))
    return float(chi2.sf(statistic, lags))


def effect_truth(sized: Sized) -> dict[str, Any]:
    """What is true of one effect."""
    hidden = sized.hidden
    return {
        "effect": hidden.effect,
        "also": list(hidden.also),
        "law": hidden.law,
        "kind": kind_of(hidden.effect),
        "own_form": hidden.own_form,
        "delta_chi2": sized.delta_chi2,
        "parameters": hidden.truth(sized.strength),
    }


def truth_of(
    family: str, without: Scenario, effects: list[dict[str, Any]], bench: Bench
) -> dict[str, Any]:
    """The truth in plain numbers."""
    motion, noise, chain = without.motion, without.noise, without.chain
    omega = without.omega
    kept_s = float(without.time_s[bench.kept][-1])
    return {
        "family": family,
        "baseline": without.baseline,
        "effects": effects,
        "nuisances": {
            "frequency_hz": omega / (2 * np.pi),
            "amplitude_rad": float(np.hypot(motion.angle_rad, motion.rate_rad_s / omega)),
            "a": 2.0 / np.pi * omega * motion.value("quadratic"),
            "b": 0.5 * motion.value("gamma") + 2.0 / np.pi * motion.value("hysteretic"),
            "c": 2.0 / np.pi * motion.value("coulomb") / omega,
            "offset_rad": chain.offset_volts / chain.nominal_volts_per_radian,
            "gain": chain.volts_per_radian / chain.nominal_volts_per_radian,
            "white_sd_rad": noise.white_sd,
            "step_rad": chain.step_rad,
            "alpha": noise.alpha,
            "freedom": noise.freedom,
            "samples": without.samples,
            "judged_until_s": kept_s,
            "stops": kept_s < without.span_s - 2.0 * without.interval_s,
        },
        "oracle": None,
    }


def oracle_truth(verdict: Verdict, effect: str) -> dict[str, Any]:
    """The oracle's figures; the ten best scores are kept."""
    best = sorted(verdict.scores, key=lambda name: -verdict.scores[name])[:10]
    return {
        "threshold": verdict.threshold,
        "threshold_of_effect": verdict.threshold_by_effect.get(effect),
        "detected": verdict.detected,
        "detected_by_effect": verdict.detected_by_effect,
        "largest_score": verdict.scores[best[0]],
        "score_of_effect": verdict.scores.get(effect),
        "named": verdict.ranking[0],
        "top3": list(verdict.ranking[:3]),
        "class": list(verdict.members),
        "whiteness_p": verdict.whiteness_p,
        "scores": {name: verdict.scores[name] for name in best},
    }
