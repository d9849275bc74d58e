"""Scores of effects that are no direction in the reading: spread, spikes, codes, colour."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge import stochastic
from pendpipe.challenge.bench import Bench
from pendpipe.challenge.tones import smooth_length

SPIKES = 5
"""So many wild samples at most are single faults."""


class Specials:
    """2 ln L, by effect, of random effects and faults; the oracle knows the noise."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.weights = stochastic.jitter_weights(bench)
        self.left = 1.0 - np.sum(bench.basis**2, axis=1)
        self.modes, self.sizes = stochastic.wander(bench)

    def of_residuals(self, residuals: FloatArray) -> dict[str, FloatArray]:
        """Scores that need the whitened residuals alone, (kept, draws)."""
        return {
            "jitter": self._jitter(residuals),
            "glitches": self._spikes(residuals),
            "broadband-drive": self._wander(residuals),
            "coloured-noise": self._colour(residuals),
        }

    def of_codes(self, codes: IntArray) -> dict[str, float]:
        """Scores of the converter's faults from one record's codes."""
        scenario = self.bench.scenario
        found = {"coarse-quantisation": 0.0, "missing-codes": 0.0}
        step = int(np.gcd.reduce(np.diff(np.unique(codes)))) if len(np.unique(codes)) > 1 else 1
        half = 2 ** (scenario.chain.bits - 1)
        if step > 1 and codes.min() > -half and codes.max() < half - 1:
            found["coarse-quantisation"] = 2.0 * len(codes) * np.log(step)
            return found
        reading = self.bench.reading(self.bench.truth)
        volts = reading * scenario.chain.nominal_volts_per_radian
        ideal = np.rint(volts / scenario.chain.step_volts).astype(np.int64)
        there, count = np.unique(codes, return_counts=True)
        inner = np.arange(there[0] + 1, there[-1])
        absent = np.setdiff1d(inner, there)
        expected = stochastic.expected_counts(scenario, absent, ideal)
        above = stochastic.expected_counts(scenario, absent + 1, ideal)
        taken = np.zeros(len(absent))
        place = np.searchsorted(there, absent + 1)
        place = np.clip(place, 0, len(there) - 1)
        hit = there[place] == absent + 1
        taken[hit] = count[place[hit]]
        ratio = np.log((above + expected + 1e-12) / (above + 1e-12))
        # Any of the codes may be absent by chance: each pays for the choice among all.
        gain = 2.0 * taken * ratio
        single = gain - 2.0 * np.log(max(len(inner), 1)) - 4.0
        found["missing-codes"] = max(
            float(np.sum(single[single > 0.0])), _combs(inner, absent, gain)
        )
        return found

    def _jitter(self, residuals: FloatArray) -> FloatArray:
        square, count = residuals**2, residuals.shape[0]
        plain = count * np.log(square.mean(0))
        best = np.zeros(residuals.shape[1])
        top = self.weights.max()
        for ratio in (0.05, 0.15, 0.5, 1.5, 5.0, 30.0):
            spread = 1.0 + self.weights / top * ratio
            fit = count * np.log((square / spread[:, None]).mean(0)) + np.log(spread).sum()
            best = np.maximum(best, plain - fit)
        return best

    def _spikes(self, residuals: FloatArray) -> FloatArray:
        size = np.abs(residuals) / np.sqrt(self.left)[:, None]
        size = as_gaussian(size, self.bench.scenario.noise.freedom)
        wildest = np.sort(size, axis=0)[::-1][:SPIKES] ** 2
        # The first one's place is paid for by the level; each further one pays its own.
        more = np.maximum(wildest[1:] - 2.0 * np.log(len(size)) - 2.0, 0.0)
        return np.asarray(wildest[0] + more.sum(0))

    def _wander(self, residuals: FloatArray) -> FloatArray:
        power = (self.modes.T @ residuals) ** 2
        best = np.zeros(residuals.shape[1])
        for strength in np.geomspace(1.0, 1e6, 13) / max(self.sizes[0], 1e-300):
            spread = 1.0 + strength * self.sizes
            gain = power.T @ (1.0 - 1.0 / spread) - np.log(spread).sum()
            best = np.maximum(best, gain)
        return best

    def _colour(self, residuals: FloatArray) -> FloatArray:
        """Low frequencies stronger than the known spectrum says."""
        count = residuals.shape[0]
        length = smooth_length(count)
        # Padding correlates neighbours a little; the bins are few per cent closer only.
        power = np.abs(np.fft.rfft(residuals, length, axis=0)[1 : length // 2]) ** 2 / count
        bins = np.arange(1, len(power) + 1)
        line = self.bench.scenario.omega / 2 / np.pi * length * self.bench.scenario.interval_s
        away = np.abs(bins - line) > 3
        best = np.zeros(residuals.shape[1])
        for corner in (0.1, 0.3, 0.6):
            for alpha in (1.0, 2.0):
                ratio = np.where(bins < corner * line, (corner * line / bins) ** alpha, 0.0)
                spread = 1.0 + ratio[away]
                gain = power[away].T @ (1.0 - 1.0 / spread) - np.log(spread).sum()
                best = np.maximum(best, 2.0 * gain)
        return best


def _combs(inner: IntArray, absent: IntArray, gain: FloatArray) -> float:
    """Codes missing at even distances, as a faulty bit leaves them: the best such comb."""
    best, choices = 0.0, 2.0 * np.log(254.0)
    for spacing in (2, 4, 8, 16, 32, 64, 128):
        for phase in range(spacing):
            wanted = int(np.sum(inner % spacing == phase))
            hit = absent % spacing == phase
            if wanted and int(hit.sum()) == wanted:
                best = max(best, float(gain[hit].sum()) - choices)
    return best


def as_gaussian(size: FloatArray, freedom: float) -> FloatArray:
    """Size of a Gaussian deviate that is as rare as one of Student's t of unit variance."""
    if freedom <= 2.0:
        return size
    from scipy import stats

    found = size.copy()
    wild = size > 2.5
    rare = stats.t.logsf(size[wild] * np.sqrt(freedom / (freedom - 2.0)), freedom)
    found[wild] = stats.norm.isf(np.maximum(np.exp(rare), 1e-300))
    return found
