"""Missing codes of the converter, and stuck bits."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.special import gammainc, gammaincc, ndtr

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.codes import Coded, read_codes
from pendpipe.diagnosis.forensics.finding import Finding, nothing
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Location
from pendpipe.estimate import Estimate

_FEWEST_EXPECTED: Final = 6.0
"""Expected readings of a code (or a residue) from which it is tested."""
_MOST_BITS: Final = 7
_COMMON_ERROR: Final = 0.05
"""Common error of the angles in steps, beside their individual error."""
_SIGNIFICANT: Final = 1e-3
_MOST_LISTED: Final = 32


class Occupation(NamedTuple):
    """Observed and expected numbers of codes; shape (k,)."""

    code: IntArray
    found: FloatArray
    low: FloatArray
    high: FloatArray
    expected: FloatArray


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Compare how often each code occurs with what motion and noise predict.

    Each number is tested against a Poisson distribution (readings scatter less, so the p-value is
    never underestimated) whose mean may lie anywhere within a small common error of the angles.
    Single codes, whole bits, and codes that are equal modulo a power of two are tested; the
    p-value counts all of them.
    """
    coded = None if data.time_noise else read_codes(data, fit, samples)
    if coded is None or len(coded.code) < 100:
        return nothing("missing-codes")
    expected = _expectations(coded)
    occupation = occupied(coded, expected)
    comb = worst_comb(coded.code, expected)
    chance = _chances(occupation)
    tested = len(chance)
    single = min(1.0, tested * float(chance.min())) if tested else 1.0
    bit, bits = _stuck_bits(coded, expected)
    p_value = min(1.0, 3.0 * min(single, bits, comb.p_value))
    if p_value > 0.01:
        return Finding("missing-codes", p_value, summary="codes occur as often as expected")
    if comb.p_value < min(single, bits):
        return _described_comb(data, coded, comb, p_value)
    bad = np.minimum(chance * tested, 1.0) < _SIGNIFICANT
    return _described(data, coded, occupation, bad, bit if bits <= single else None, p_value)


def _expectations(coded: Coded) -> FloatArray:
    """Return expected numbers of each code for shifted and unshifted angles, (3, codes)."""
    first, last = int(coded.code.min()) - 1, int(coded.code.max()) + 1
    spread = max(math.hypot(coded.ratio, coded.blur), 0.02)
    shift = _COMMON_ERROR + 2.0 * coded.blur
    size = last - first + 1
    return np.stack(
        [_expected(coded.position + move, first, size, spread) for move in (-shift, 0.0, shift)]
    )


def occupied(coded: Coded, expected: FloatArray) -> Occupation:
    """Return observed and expected numbers of each code."""
    first, last = int(coded.code.min()) - 1, int(coded.code.max()) + 1
    found = np.bincount(coded.code - first, minlength=last - first + 1).astype(np.float64)
    inside = slice(2, -2)
    codes = np.arange(first, last + 1)
    low, high = expected.min(axis=0), expected.max(axis=0)
    return Occupation(codes[inside], found[inside], low[inside], high[inside], expected[1][inside])


def _expected(position: FloatArray, first: int, size: int, spread: float) -> FloatArray:
    """Sum P(code) over readings, by a fine histogram of the angles."""
    fine = 10 if spread < 1.0 else 4
    cells = np.bincount(
        np.clip(((position - first + 0.5) * fine).astype(np.int64), 0, size * fine - 1),
        minlength=size * fine,
    ).astype(np.float64)
    reach = (math.ceil(5.0 * spread + 0.5) + 1) * fine
    # Expectation of a code: its probability about its middle, summed over the cells.
    offset = (np.arange(-reach, reach) + 0.5) / fine
    kernel = ndtr((offset + 0.5) / spread) - ndtr((offset - 0.5) / spread)
    length = 2 ** math.ceil(math.log2(len(cells) + 2 * reach))
    smooth = np.fft.irfft(np.fft.rfft(cells, length) * np.fft.rfft(kernel, length), length)
    start = reach + fine // 2 - 1
    return np.asarray(np.maximum(smooth[start : start + size * fine : fine], 0.0))


def _chances(occupation: Occupation) -> FloatArray:
    """Return the two-sided p-value of each code's number; shape (k,)."""
    tested = occupation.low > _FEWEST_EXPECTED
    found = occupation.found
    # P(N <= found) at the smallest expectation, P(N >= found) at the largest.
    fewer = gammaincc(found + 1.0, occupation.low)
    more = gammainc(found, occupation.high)
    chance = np.where(tested, 2.0 * np.minimum(fewer, more), 1.0)
    return np.asarray(np.minimum(chance, 1.0)) if tested.any() else np.zeros(0)


def _stuck_bits(coded: Coded, expected: FloatArray) -> tuple[tuple[int, float], float]:
    """Return the bit that is set too often or too seldom, and its p-value.

    The converter's code 0 is unknown: a bit of weight 2^b divides the codes into runs of 2^b, and
    every origin of the runs is tried. Expectations include the noise: near a turning point many
    readings lie about one code.
    """
    best, chance, tried = (0, 0.5), 1.0, 0
    span = int(np.ptp(coded.code))
    codes = np.arange(expected.shape[1]) + int(coded.code.min()) - 1
    for bit in range(_MOST_BITS):
        run = 2**bit
        if 4 * run > span:
            break
        residue = np.bincount(coded.code % (2 * run), minlength=2 * run).astype(np.float64)
        found = _halves(residue, run)
        predicted = np.stack([_halves(_residues(codes, row, run), run) for row in expected])
        should = np.clip(found, predicted.min(axis=0), predicted.max(axis=0)).clip(0.05, 0.95)
        tried += 2 * run
        # Neighbouring readings are in the same half, so that fewer are independent.
        effective = len(coded.code) / max(1.0, _in_a_half(coded, run))
        excess = np.abs(found - should) / np.sqrt(should * (1.0 - should) / effective)
        worst = int(np.argmax(excess))
        p_value = float(2.0 * ndtr(-excess[worst]))
        if p_value < chance:
            best, chance = (bit, float(found[worst])), p_value
    return best, min(1.0, tried * chance)


def _residues(codes: IntArray, numbers: FloatArray, run: int) -> FloatArray:
    """Sum numbers of codes by their residue modulo two runs."""
    return np.asarray(np.bincount(codes % (2 * run), numbers, 2 * run), dtype=np.float64)


def _halves(residue: FloatArray, run: int) -> FloatArray:
    """Return the share of readings in half of the residues, for each origin of the half."""
    ring = np.concatenate([[0.0], np.cumsum(np.tile(residue, 2))])
    return np.asarray((ring[run : 3 * run] - ring[: 2 * run]) / residue.sum())


def _in_a_half(coded: Coded, run: int) -> float:
    """Return the mean number of successive readings in the same half."""
    changes = int(np.count_nonzero(np.diff(np.floor(coded.position / run))))
    return len(coded.position) / max(changes, 1)


def _described(
    data: Data,
    coded: Coded,
    occupation: Occupation,
    bad: BoolArray,
    bit: tuple[int, float] | None,
    p_value: float,
) -> Finding:
    step = coded.lattice.step
    found, expected = occupation.found[bad], occupation.expected[bad]
    likely = np.where(found > 0.0, found * np.log(np.maximum(found, 1e-9) / expected), 0.0)
    gain = 2.0 * float(np.sum(likely - found + expected))
    fewer = found < expected
    seldom = occupation.code[bad][fewer]
    predicted, came = float(expected[fewer].sum()), float(found[fewer].sum())
    readings = len(coded.code)
    parameters = {
        "share": Estimate(
            (predicted - came) / readings, math.sqrt(max(predicted, 1.0)) / readings, ""
        ),
        "number": Estimate(float(len(seldom)), 0.0, ""),
        "found": Estimate(came, math.sqrt(max(came, 1.0)), ""),
        "expected": Estimate(predicted, 0.0, ""),
    }
    if bit is not None:
        parameters["bit"] = Estimate(float(bit[0]), 0.0, "")
        parameters["share"] = Estimate(0.5, 0.5 / math.sqrt(readings), "")
        gain = max(gain, -2.0 * math.log(max(p_value, 1e-300)))
        summary = (
            f"bit {bit[0]} of the converter is stuck or unreliable: {100 * bit[1]:.0f} % of the"
        )
        summary += " readings lie in one half of its codes"
    else:
        named = ", ".join(str(code) for code in seldom[:5]) + (", ..." if len(seldom) > 5 else "")
        summary = f"{len(seldom)} code(s) ({named}, in steps of {step:.4g} {data.unit}) occurred"
        summary += f" {came:.0f} times where {predicted:.0f} were expected"
    return Finding(
        "missing-codes",
        p_value,
        gain,
        parameters,
        Location(adc_codes=tuple(int(code) for code in seldom[:_MOST_LISTED])),
        summary=summary,
    )


def _described_comb(data: Data, coded: Coded, comb: Comb, p_value: float) -> Finding:
    readings = len(coded.code)
    codes = np.arange(int(coded.code.min()), int(coded.code.max()) + 1)
    codes = codes[comb.holds(codes)]
    predicted = max(comb.expected, 1.0)
    return Finding(
        "missing-codes",
        p_value,
        comb.gain,
        {
            "share": Estimate(
                (predicted - comb.found) / readings, math.sqrt(predicted) / readings, ""
            ),
            "number": Estimate(float(len(codes)), 0.0, ""),
            "found": Estimate(comb.found, math.sqrt(max(comb.found, 1.0)), ""),
            "expected": Estimate(comb.expected, 0.0, ""),
            "period": Estimate(float(comb.period), 0.0, ""),
        },
        Location(adc_codes=tuple(int(code) for code in codes[:_MOST_LISTED])),
        summary=f"every {comb.period}th code (from {codes[0]}, in steps of"
        f" {coded.lattice.step:.4g} {data.unit}) occurred {comb.found:.0f} times where"
        f" {comb.expected:.0f} were expected",
    )


class Comb(NamedTuple):
    """Codes that are equal modulo `period`.

    Parameters
    ----------
    period, residue
        Code = residue (mod period).
    found, expected
        Observed and expected number of readings.
    p_value
        With all periods and residues that were tested.
    """

    period: int
    residue: int
    found: float
    expected: float
    p_value: float

    def holds(self, code: IntArray) -> BoolArray:
        """Return which codes belong to it."""
        return np.asarray(code % self.period == self.residue)

    @property
    def gain(self) -> float:
        """Twice the gain in log-likelihood (Poisson)."""
        likely = self.found * np.log(self.found / self.expected) if self.found else 0.0
        return float(2.0 * (likely - self.found + self.expected))


def worst_comb(code: IntArray, expected: FloatArray) -> Comb:
    """Sum the codes by residue, and return the least probable residue.

    A converter with a faulty bit loses every code of one residue modulo a power of two. Each code
    alone may be expected too seldom to be missed; together they are not.

    Parameters
    ----------
    code
        Of each reading.
    expected
        Expected number of each code from ``code.min() - 1`` on, a row for each common error of
        the angles; shape (errors, codes), the middle row without error.
    """
    first, size = int(code.min()) - 1, expected.shape[1]
    codes = np.arange(first, first + size)
    best, tried = Comb(1, 0, 0.0, 0.0, 1.0), 0
    for bit in range(1, _MOST_BITS + 1):
        period = 2**bit
        if 2 * period > size - 2:
            break
        predicted = np.stack([np.bincount(codes % period, row, period) for row in expected])
        low, high = predicted.min(axis=0), predicted.max(axis=0)
        found = np.bincount(code % period, minlength=period).astype(np.float64)
        tested = low > _FEWEST_EXPECTED
        tried += int(np.count_nonzero(tested))
        # Residues within two sigma are not improbable, whatever their number.
        odd = tested & ((found < low - 2.0 * np.sqrt(low)) | (found > high + 2.0 * np.sqrt(high)))
        chance = np.ones(period)
        if odd.any():
            fewer, more = gammaincc(found[odd] + 1.0, low[odd]), gammainc(found[odd], high[odd])
            chance[odd] = 2.0 * np.minimum(fewer, more)
        at = int(np.argmin(chance))
        if chance[at] < best.p_value:
            middle = float(predicted[len(expected) // 2, at])
            best = Comb(period, at, float(found[at]), middle, float(chance[at]))
    return best._replace(p_value=min(1.0, tried * best.p_value))
