"""Faults of a converter: a range that is too small, missing codes, stuck bits, coarse steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
from scipy.fft import irfft, rfft
from scipy.special import gammaincc, log_ndtr, ndtr, xlogy

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.forensics.codes import (
    Coded,
    Raw,
    lattice_of,
    noise_before_rounding,
    raw_readings,
    read_codes,
)
from pendpipe.diagnosis.forensics.evidence import FEWEST
from pendpipe.diagnosis.forensics.local import local_residual
from pendpipe.diagnosis.found import Finding, Location
from pendpipe.estimate import Estimate
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import after_number

if TYPE_CHECKING:
    from pendpipe.diagnosis.forensics.evidence import Evidence

_FEWEST_AT_END: Final = 2
"""Readings exactly at the end of the range that make a flat top."""
_ROUNDING_RMS: Final = 0.5
"""Rms in steps up to which errors may be correlated by rounding alone."""
_MASK_BELOW: Final = 1e-2
"""p-value of an end of the range below which its readings are left out: what is left out in
vain is one end of a hundred records, a reading or two."""

Side = Literal["upper", "lower"]
_SIGN: Final[dict[Side, float]] = {"upper": 1.0, "lower": -1.0}
"""Of an angle at that end of the range."""
_FEWEST_EXPECTED: Final = 6.0
"""Expected readings of a code (or a residue) from which it is tested."""
_MOST_BITS: Final = 7
"""Bits whose codes are asked for a pattern: a comb of 2^7 codes has 128 residues, each with
six readings of a thousand."""
_COMMON_ERROR: Final = 0.05
"""Common error of the angles in steps, beside their individual error."""
_SIGNIFICANT: Final = 1e-3
"""Chance, over all residues of a period, from which a code is listed as seldom."""
_MOST_LISTED: Final = 32
"""Codes that are named: more fill no line that anybody reads."""
_HARMLESS_NOISE: Final = 0.25
"""Noise before rounding, in steps, above which rounding is harmless."""
_WHOLE_WITHIN: Final = 1e-9
"""Tolerance of a spacing of whole bits, over the converter's step."""
_RANDOM_AMPLITUDE: Final = 20.0
"""Amplitude in steps above which rounding errors are effectively random."""


class End(NamedTuple):
    """One end of the range."""

    side: Side
    limit: float
    p_value: float
    delta_chi2: float


def find_clipping(evidence: Evidence) -> Finding | None:
    """Test whether the largest (smallest) reading is smaller than the motion's.

    With the true angles x_j from the rest of each window (without readings at the end), the
    probability that no reading exceeds the limit m is

        p = product over j of Phi((m + q/2 - x_j)/sigma_j),

    the distribution of the largest reading. It is tested only if two readings or more are
    equal, as at the end of a converter's range.
    """
    data, samples = evidence.data, evidence.samples
    if data.time_noise or samples.counts:
        return None
    raw = raw_readings(evidence)
    lattice = lattice_of(raw.values, samples)
    step = lattice.step if lattice is not None else 0.0
    both = [_end(raw, step, side, evidence.noise.memory) for side in _SIGN]
    p_value = -math.expm1(2.0 * math.log1p(-min(min(end.p_value for end in both), 1.0 - 1e-12)))
    ends = [end for end in both if end.p_value < _MASK_BELOW]
    if not ends:
        return Finding("clipping", p_value, summary="the largest readings agree with the motion")
    values, codes = samples.values[data.rows], ()
    clipped = np.zeros(values.shape, dtype=bool)
    slack = 0.5 * step if step else 1e-9 * abs(ends[0].limit)
    for end in ends:
        clipped |= _SIGN[end.side] * (values - end.limit) >= -slack
    if lattice is not None:
        at = lattice.position(np.array([end.limit for end in ends]))
        codes = tuple(np.rint(at).astype(int).tolist())
    number, mask = int(np.count_nonzero(clipped)), np.asarray(clipped.any(axis=1))
    sd, when = quantisation_rms(step), data.time_s[mask]
    parameters = {f"{end.side}_level": Estimate(end.limit, sd, data.unit) for end in ends}
    parameters["number"] = Estimate(float(number), 0.0, "")
    sides = " and ".join(end.side for end in ends)
    limits = " and ".join(f"{end.limit:.5g}" for end in ends)
    around = {"upper": 0.0, "lower": math.pi}[ends[0].side]
    phase = (around - 0.2) % (2.0 * math.pi), (around + 0.2) % (2.0 * math.pi)
    return Finding(
        "clipping",
        p_value,
        sum(end.delta_chi2 for end in ends),
        parameters,
        Location.over(
            when,
            evidence.sampled.amplitude[mask],
            phase if len(ends) == 1 else None,
            adc_codes=codes,
        ),
        mask=mask,
        summary=f"{number} readings lie at the {sides} end of the range ({limits}"
        f"{after_number(data.unit)}), which the motion exceeds, until {when[-1]:.4g} s",
    )


def _end(raw: Raw, step: float, side: Side, memory: float) -> End:
    sign, values = _SIGN[side], _SIGN[side] * raw.values
    limit, other = float(values[raw.used].max()), float(values[raw.used].min())
    slack = 0.5 * step if step else 1e-9 * (limit - other)
    at = raw.used & (values >= limit - slack)
    quiet = End(side, sign * limit, 1.0, 0.0)
    if np.count_nonzero(at) < _FEWEST_AT_END:
        return quiet
    outermost = at | (raw.used & (values <= other + slack))
    local = local_residual(raw.phase, raw.residual, raw.used, leave_out=outermost)
    if local.smooth(memory) and local.rms > _ROUNDING_RMS * step:
        # The motion is not fitted well enough: its true extremes are unknown.
        return quiet
    true = values - sign * local.left
    before = noise_before_rounding(local, step) if step else local.rms
    spread = np.sqrt(before**2 + local.rms**2 * np.maximum(local.leverage, 0.0))
    near = raw.used & (true > limit - 6.0 * local.rms - 3.0 * step)
    p_value = float(np.exp(np.sum(log_ndtr((limit + 0.5 * step - true[near]) / spread[near]))))
    beyond = np.maximum(true[at] - limit - 0.5 * step, 0.0) / spread[at]
    return End(side, sign * limit, p_value, float(beyond @ beyond))


def find_missing_codes(evidence: Evidence) -> Finding | None:
    """Compare how often each code occurs with what motion and noise predict.

    Each number is tested against a Poisson distribution (readings scatter less, so the p-value is
    never underestimated) whose mean may lie anywhere within a small common error of the angles.
    Codes that are equal modulo a power of two are tested together, and single ones; the p-value
    counts all of them.
    """
    coded = read_codes(evidence)
    if coded is None or len(coded.code) < FEWEST or np.ptp(coded.code) < 2:
        return None
    comb = worst_comb(coded.code, _expectations(coded))
    if comb.p_value > FALSE_ALARM:
        return Finding("missing-codes", comb.p_value, summary="codes occur as often as expected")
    codes, readings = comb.codes, len(coded.code)
    missing, sd = comb.expected - comb.found, math.sqrt(max(comb.expected, 1.0))
    parameters = {
        "share": Estimate(missing / readings, sd / readings, ""),
        "number": Estimate(float(comb.number), 0.0, ""),
        "found": Estimate(comb.found, math.sqrt(max(comb.found, 1.0)), ""),
        "expected": Estimate(comb.expected, 0.0, ""),
    }
    first = codes[:5]
    named = ", ".join(map(str, first)) + (", ..." if comb.number > len(first) else "")
    lead = ""
    if comb.period:
        parameters["period"] = Estimate(float(comb.period), 0.0, "")
        lead = f"{comb.residues} in every {comb.period} codes: "
        if 2 * comb.residues == comb.period:
            bit = comb.period.bit_length() - 2
            parameters["bit"] = Estimate(float(bit), 0.0, "")
            lead = f"bit {bit} of the converter is stuck or unreliable, or its steps are unequal: "
    return Finding(
        "missing-codes",
        comb.p_value,
        comb.gain,
        parameters,
        Location(adc_codes=tuple(int(code) for code in codes)),
        summary=f"{lead}{comb.number} code(s) ({named}, in steps of {coded.step:.4g}"
        f"{after_number(evidence.data.unit)}) occurred {comb.found:.0f} times where"
        f" {comb.expected:.0f} were expected",
    )


def _expectations(coded: Coded) -> FloatArray:
    """Return expected numbers of the codes between the outermost, for shifted and unshifted angles.

    Each code has its own column where there is a reading a code on average. Of more codes none
    alone is expected often enough, and all that are equal modulo the longest period share a column.

    Returns
    -------
    ndarray
        Shape (3, modulus): column j is of the codes that are j modulo `modulus`.
    """
    code, position, longest = coded.code, coded.position, 2**_MOST_BITS
    first, last = int(code.min()), int(code.max())
    spread = max(math.hypot(coded.ratio, coded.blur), 0.02)
    shift = _COMMON_ERROR + 2.0 * coded.blur
    moves = (-shift, 0.0, shift)
    if last - first > len(code):
        inner = position[(code > first) & (code < last)]
        return np.stack([_expected(inner + move, longest, spread) for move in moves])
    # So wide that no angle is near both ends.
    wide = last - first + 3 + 2 * math.ceil(5.0 * spread)
    modulus = math.ceil(wide / longest) * longest
    near = np.clip(position, first - 1.0, last + 1.0)
    expected = np.stack([_expected(near + move, modulus, spread) for move in moves])
    outside = np.arange(last, first + modulus + 1) % modulus
    expected[:, outside] = 0.0
    return expected


def _expected(position: FloatArray, modulus: int, spread: float) -> FloatArray:
    """Sum P(code) over readings by a fine histogram of the angles, for codes modulo `modulus`."""
    fine = 10 if spread < 1.0 else 4
    size = modulus * fine
    cells = np.bincount(np.floor((position + 0.5) * fine).astype(np.int64) % size, minlength=size)
    # From one turn of the codes on, all are equally probable.
    spread = min(spread, float(modulus))
    reach = (math.ceil(5.0 * spread + 0.5) + 1) * fine
    # Expectation of a code: its probability about its middle, summed over the cells.
    cell = np.arange(-reach, reach)
    offset = (cell + 0.5) / fine
    chance = ndtr((offset + 0.5) / spread) - ndtr((offset - 0.5) / spread)
    kernel = np.bincount((cell + 1 - fine // 2) % size, chance, size)
    smooth = irfft(rfft(cells) * rfft(kernel), size)
    return np.asarray(np.maximum(smooth[::fine], 0.0))


class Comb(NamedTuple):
    """Codes that occur too seldom.

    Parameters
    ----------
    period
        The power of two modulo which they are equal; 0 for single codes.
    residues
        How many different ones there are modulo it.
    number, codes
        How many they are, and the first of them.
    found, expected
        Observed and expected readings of all of them.
    gain
        Twice the gain in log-likelihood (Poisson).
    p_value
        With all periods, residues and codes that were tested.
    """

    period: int
    residues: int
    number: int
    codes: IntArray
    found: float
    expected: float
    gain: float
    p_value: float


def worst_comb(code: IntArray, expected: FloatArray) -> Comb:
    """Sum the codes by residue, and return the least probable residues, or single codes.

    A converter with a faulty bit loses codes of some residues modulo a power of two. Each code
    alone may be expected too seldom to be missed; together they are not. The first and the last
    code are left out.

    Parameters
    ----------
    code
        Of each reading.
    expected
        Expected number of the codes that are 0, 1, ... modulo its length, a row for each common
        error of the angles; shape (errors, modulus), the middle row without error. The modulus
        is a multiple of the longest period; single codes are asked if it is not below their number.
    """
    first, last, tried = int(code.min()) + 1, int(code.max()) - 1, 0
    inside, modulus = code[(code >= first) & (code <= last)], expected.shape[1]
    number = last - first + 1
    periods = [2**bit for bit in range(1, _MOST_BITS + 1) if 2 ** (bit + 1) <= number + 2]
    tables = []
    for period in (*periods, *([modulus] if number <= modulus else [])):
        rows = expected.reshape(len(expected), -1, period).sum(axis=1)
        least = rows.min(axis=0)
        found = np.bincount(inside % period, minlength=period).astype(np.float64)
        # P(N <= found) of a Poisson distribution; 1 where too few are expected to tell.
        chance = np.where(least > _FEWEST_EXPECTED, gammaincc(found + 1.0, least), 1.0)
        tried += int(np.count_nonzero(least > _FEWEST_EXPECTED))
        tables.append((period, chance, found, rows[len(rows) // 2]))
    period, chance, found, usual = min(tables, key=lambda table: float(table[1].min()))
    worst = float(chance.min())
    seldom = np.flatnonzero(chance <= max(_SIGNIFICANT / period, worst))
    found, usual = found[seldom], usual[seldom]
    # The first code of each residue, and those a period apart from it.
    start = first + (seldom - first) % period
    start = start[start <= last]
    many = int(np.sum((last - start) // period + 1))
    codes = np.sort((start + period * np.arange(_MOST_LISTED)[:, None]).ravel())
    return Comb(
        period if period in periods else 0,
        len(seldom),
        many,
        codes[codes <= last][:_MOST_LISTED],
        float(found.sum()),
        float(usual.sum()),
        2.0 * float(np.sum(xlogy(found, found / usual) - found + usual)),
        min(1.0, tried * worst),
    )


def find_coarse_steps(evidence: Evidence) -> Finding | None:
    """Test whether the errors depend on the angle's position between two codes.

    Rounding an angle x with noise s to steps q shifts the mean reading by

        (q/pi) sum over m of (-1)^m exp(-2 (pi m s/q)^2) sin(2 pi m x/q)/m,

    which vanishes from s = q/2 on. The size of its first term is the errors' inner product with
    it; the null is any noise above a quarter step. If the amplitude stays above twenty steps, the
    errors are pseudo-random and do no harm: a property of the record.

    """
    data = evidence.data
    coded = None if evidence.samples.promised_step is not None else read_codes(evidence)
    if coded is None or len(coded.code) < FEWEST:
        return None
    wave = -np.sin(2.0 * math.pi * coded.position)
    wave = wave - wave.mean()
    error = coded.code - coded.position
    error = error - error.mean()
    size = float(wave @ error) / float(wave @ wave)
    sd = math.sqrt(float(np.mean(error**2)) / float(wave @ wave))
    allowed = math.exp(-2.0 * (math.pi * _HARMLESS_NOISE) ** 2) / math.pi
    step, end = coded.step, float(evidence.sampled.amplitude[-1])
    return Finding(
        "coarse-quantisation",
        float(ndtr((allowed - size) / sd)),
        max(size / sd, 0.0) ** 2,
        {
            "step": Estimate(step, 0.0, data.unit),
            "noise_over_step": Estimate(coded.ratio, 0.2 * coded.ratio, ""),
            "bias_over_step": Estimate(size, sd, ""),
        },
        evidence.everywhere(),
        summary=f"the step of {step:.3g}{after_number(data.unit)} is {1.0 / coded.ratio:.2g} times"
        " the noise, so that errors depend on the codes; the final amplitude is"
        f" {end / step:.2g} steps",
        kind="fault" if end < _RANDOM_AMPLITUDE * step else "property",
    )


def find_dead_bits(evidence: Evidence) -> Finding | None:
    """Report codes that all lie on a coarser lattice; by chance each would with 1/times.

    The converter's lowest bits are dead, or an earlier stage has a coarser step.

    With noise above half the converter's step every code is as probable as its neighbours, so
    that each reading contributes ln(times) to the log-likelihood. The lattice's origin is
    estimated from the codes, and so is its spacing if that is not a whole number.
    """
    data, samples = evidence.data, evidence.samples
    step, promised = samples.step, samples.promised_step
    if step is None or promised is None:
        return None
    times = step / promised
    whole = abs(times - round(times)) < _WHOLE_WITHIN
    free = len(np.unique(samples.values)) - (1 if whole else 2)
    steps = (
        f"the step is {step:.3g}{after_number(data.unit)}, but the converter's bits give"
        f" {promised:.3g}"
    )
    parameters = {
        "step": Estimate(step, 0.0, data.unit),
        "promised": Estimate(promised, 0.0, data.unit),
    }
    if whole:
        parameters["dead_bits"] = Estimate(math.log2(times), 0.0, "")
    return Finding(
        "coarse-quantisation",
        times**-free,
        2.0 * data.used * math.log(times),
        parameters,
        evidence.everywhere(),
        summary=f"only one code in {times:.0f} occurs: {steps}"
        if whole
        else f"the codes that occur are {times:.4g} apart, rounded to whole ones: {steps}",
        also=("missing-codes",) if whole and round(times) == 2 else (),
    )
