"""Give a hidden effect the strength at which it changes Delta chi^2 by a wanted amount."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe_challenge.bench import Bench, Point
from pendpipe_challenge.hidden import Hidden
from pendpipe_challenge.scenario import Scenario, stop_s
from pendpipe_challenge.signatures import (
    coloured_excess,
    excess,
    jitter_excess,
    jitter_weights,
    missing_excess,
    wander,
)

CLOSE = 0.03
"""Relative distance from the wanted Delta chi^2 that is near enough."""


@dataclass(frozen=True)
class Sized:
    """A hidden effect at its strength.

    Parameters
    ----------
    hidden, strength
        What was hidden and how strongly.
    scenario, without
        The recording's scenario, and the one without the effect.
    bench
        The oracle's workbench of the latter.
    point
        The baseline that comes nearest to the noise-free reading.
    residual
        What it leaves, whitened, kept samples.
    delta_chi2
        Of the effect: the square of that residual, or expected 2 ln L where the effect is
        random.
    """

    hidden: Hidden
    strength: float
    scenario: Scenario
    without: Scenario
    bench: Bench
    point: Point
    residual: FloatArray
    delta_chi2: float


def size(hidden: Hidden, wanted: float) -> Sized | None:
    """Find the strength; None where no sensible strength reaches the wanted Delta chi^2."""
    if hidden.sized == "shape":
        return _by_shape(hidden, wanted)
    without = hidden.without()
    bench = Bench(without)
    strength = _by_likelihood(hidden, bench, wanted)
    if strength is None:
        return None
    value = _likelihood(hidden, bench, strength)
    zero = np.zeros(bench.count)
    scenario = hidden.at(strength)
    point, residual = bench.truth, zero
    if hidden.sized == "process" or hidden.effect == "dropped-samples":
        point, residual, square = bench.refit(scenario.reading_rad())
        value = value if hidden.sized == "process" else square
    return Sized(hidden, strength, scenario, without, bench, point, residual, value)


def kept_samples(hidden: Hidden, strength: float) -> tuple[Scenario, Scenario, np.ndarray]:
    """The two scenarios and the samples before either comes near its stop."""
    scenario, without = hidden.at(strength), hidden.without(strength)
    end = min(stop_s(s, s.motion.run(s.time_s)) for s in (scenario, without))
    return scenario, without, without.time_s < end


def _by_shape(hidden: Hidden, wanted: float) -> Sized | None:
    """Linear first, then by refit, in steps that a refit can follow."""
    sign = float(np.sign(hidden.scale))
    strength = abs(hidden.scale)
    bench: Bench | None = None
    growth, tried = hidden.growth, dict[float, float]()
    moving = hidden.moves
    start: Point | None = None
    for turn in range(16):
        if not 0.0 < strength <= hidden.largest:
            return None
        scenario, without, kept = kept_samples(hidden, sign * strength)
        if kept.sum() < 200:
            return None
        if bench is None or moving or kept.sum() < bench.count:
            bench, start = Bench(without, kept), None
        reading = scenario.reading_rad(np.random.default_rng(0))
        raw = bench.residual(reading)
        swing = np.ptp(bench.track.angle_rad[bench.kept]) / bench.scenario.sd_rad
        gross = float(raw @ raw) > 0.01 * bench.count * swing**2
        linear = bench.off(raw)
        value = float(linear @ linear)
        if turn == 0 and gross:
            strength *= 0.1
            continue
        near = wanted / 9.0 < value < wanted * 9.0
        point, residual = bench.truth, linear
        if near or gross or tried:
            point, residual, value = bench.refit(reading, start)
            start = None if moving else point
            tried[strength] = value
            if abs(value / wanted - 1.0) < CLOSE:
                return Sized(
                    hidden, sign * strength, scenario, without, bench, point, residual, value
                )
            if len(tried) >= 2:
                (s1, v1), (s2, v2) = list(tried.items())[-2:]
                growth = _slope(s1, v1, s2, v2, hidden.growth)
        if not np.isfinite(value) or value <= 0.0:
            return None
        strength *= float(
            np.clip((wanted / value) ** (1.0 / growth), 1e-3, 30.0 if not tried else 3.0)
        )
    return None


def _slope(s1: float, v1: float, s2: float, v2: float, usual: float) -> float:
    """Local growth exponent, kept near what is usual."""
    if s1 == s2 or v1 <= 0 or v2 <= 0:
        return usual
    found = np.log(v2 / v1) / np.log(s2 / s1)
    return float(np.clip(found, 0.5 * usual, 2.5 * usual))


def _likelihood(hidden: Hidden, bench: Bench, strength: float) -> float:
    """Expected 2 ln L of a random effect."""
    if hidden.effect == "jitter":
        return jitter_excess(jitter_weights(bench), strength)
    if hidden.effect == "broadband-drive":
        _, sizes = wander(bench)
        return excess(sizes * strength**2)
    if hidden.effect == "missing-codes":
        return missing_excess(hidden.at(strength))
    if hidden.effect == "coarse-quantisation":
        return float(2.0 * bench.count * np.log(2.0) * hidden.details["dead_bits"])
    if hidden.effect == "coloured-noise":
        return coloured_excess(hidden.at(strength), hidden.without())
    return np.inf


def _by_likelihood(hidden: Hidden, bench: Bench, wanted: float) -> float | None:
    """Strength for the expected likelihood ratio, by steps in its logarithm."""
    if hidden.sized == "fixed":
        return hidden.scale
    strength = hidden.scale
    for _ in range(60):
        value = _likelihood(hidden, bench, strength)
        if abs(value / wanted - 1.0) < CLOSE:
            break
        factor = (wanted / max(value, 1e-12)) ** (1.0 / hidden.growth)
        strength *= float(np.clip(factor, 0.1, 10.0))
        if hidden.sized == "codes":
            strength = max(1.0, round(strength))
            if strength * 0.9 > hidden.largest:
                return None
            if _likelihood(hidden, bench, strength) > 0.5 * wanted:
                break
    else:
        return None
    return strength
