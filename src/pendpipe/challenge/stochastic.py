"""How much a random effect can be known by: expected 2 ln(likelihood ratio)."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge.bench import Bench
from pendpipe.challenge.noise import Whitening
from pendpipe.challenge.scenario import Scenario

DRAWS = 48


def excess(eigenvalues: FloatArray) -> float:
    """Sum of lambda - ln(1 + lambda): covariance 1 + lambda tested against 1."""
    return float(np.sum(eigenvalues - np.log1p(eigenvalues)))


def wander(bench: Bench) -> tuple[FloatArray, FloatArray]:
    """Modes of a white acceleration's response, whitened and off the baseline.

    Returns
    -------
    tuple
        Orthonormal modes, shape (kept, modes), and their variance in units of the noise
        for a one-sided root density of 1 rad/s^2/sqrt(Hz).
    """
    motion = bench.propagator
    inverse = bench.back[bench.kept]
    unit = np.random.default_rng(0).standard_normal((bench.count, DRAWS))
    kicks = np.sqrt(0.5 * bench.scenario.interval_s) * unit
    summed = np.cumsum(inverse[:, :, 1, None] * kicks[:, None, :], axis=0)
    response = np.einsum("nj,njm->nm", motion[bench.kept][:, 0, :], summed)
    white = bench.off(bench.whiten(bench.gain * response))
    modes, sizes, _ = np.linalg.svd(white, full_matrices=False)
    return modes, sizes**2 / DRAWS


def jitter_weights(bench: Bench) -> FloatArray:
    """Variance of the kept readings for a clock error of 1 s rms, in units of the noise."""
    rate = bench.gain * bench.track.rate_rad_s[bench.kept] / bench.scenario.sd_rad
    return np.asarray(rate**2)


def jitter_excess(weights: FloatArray, jitter_s: float) -> float:
    """Expected 2 ln L of a variance that follows v^2, the noise level being free."""
    spread = 1.0 + weights * jitter_s**2
    return float(len(spread) * np.log(spread.mean()) - np.log(spread).sum())


def expected_counts(scenario: Scenario, codes: IntArray, used: IntArray) -> FloatArray:
    """How often each of `codes` would come; `used` are an ideal converter's codes."""
    sd = scenario.noise.white_sd / scenario.chain.step_rad
    low, high = int(used.min()) - 8, int(used.max()) + 9
    histogram = np.bincount(used - low, minlength=high - low).astype(float)
    reach = np.arange(-8, 9)
    spread = np.exp(-0.5 * (reach / np.hypot(sd, 0.3)) ** 2)
    smooth = np.convolve(histogram, spread / spread.sum(), mode="same")
    return np.asarray(smooth[np.clip(codes - low, 0, len(smooth) - 1)])


def missing_excess(scenario: Scenario) -> float:
    """2 ln L of codes that never come, their readings going to the next code."""
    missing = np.array(scenario.chain.missing_codes)
    plain = scenario.with_chain(missing_codes=())
    volts = plain.chain.volts(plain.track(), plain.samples)
    counts = expected_counts(plain, missing, plain.chain.codes(volts))
    return float(4.0 * np.log(2.0) * counts.sum())


def coloured_excess(with_it: Scenario, without: Scenario) -> float:
    """2 ln L of the noise's colour, whose spectrum is known to the oracle."""
    slow = with_it.noise.slow(with_it.time_s)
    whitening = Whitening(without.sd_rad, slow)
    ratio = 1.0 / (1.0 - whitening.shrink) ** 2 - 1.0
    return excess(ratio)
