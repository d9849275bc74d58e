"""Readings that are fit for it, and the amplitude, phase and level of half cycles in them.

The sums over the readings of every half cycle are machine code.

The shape of a half cycle about its turning point, to second order in the losses.

About a turning point of amplitude y at phase 0 (phase = omega (t - t_k) with the frequency
observed) Eq. 8 moves as x = y h(phase):

- friction (the terms with sgn x', of size delta = pi (a y^2 + b_h y + c)/(2 omega)):
  h = cos + (sgn(phase) delta - delta delta')(1 - cos)/y, delta' = d delta/dy;
- viscous damping, e = b_v/omega: h = cos + e (sin - phase cos) + e^2 (phase^2 cos/2 - phase sin).

What is odd in the phase leaves the amplitude alone and shifts the time; what is even has
the second order. How b divides is not known to turning points: half of it is taken as
hysteretic, which leaves +-0.17 (b/omega)^2 of the amplitude open, and of the time a
constant +-b/(4 omega^2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.noise import noise_rms
from pendpipe.analysis.readings import decimal_step, find_step, motion_of
from pendpipe.arrays import BoolArray, FloatArray, IntArray, median
from pendpipe.dynamics.kernel import IntMatrix, Matrix, Stack, kernel
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.recording import Recording
from pendpipe.solve import Bounds, bounded_step, invert

FITTED: Final = 4
"""Readings of a half cycle from which its amplitude, phase and level are told, and one is left."""
JUDGED: Final = 8
"""The same with harmonics of its own, and what they leave."""
HALF_PI = 0.5 * np.pi
"""Phase from a turning point to the next zero crossing."""
HARMONICS = 3
"""How many odd harmonics above the first the shape may hold (3, 5, 7)."""


def half_cycle_shape(
    amplitude: FloatArray, angular_frequency: FloatArray, rates: FloatArray
) -> FloatArray:
    """Coefficients of the half cycles' shapes, for `half_cycle_sums`.

    Parameters
    ----------
    amplitude
        y of each half cycle, shape (k,).
    angular_frequency
        Phase per second, shape (k,).
    rates
        a, b, c of Eq. 13; a negative one is taken as zero.

    Returns
    -------
    FloatArray
        Shape (k, 4 + HARMONICS): friction, viscous, second orders of both, and the odd
        harmonics 3, 5, 7 (zero).
    """
    a, b, c = np.maximum(rates, 0.0).tolist()
    least = 1e-3 * float(np.max(amplitude))
    y = np.maximum(amplitude, least)
    quadratic, linear, coulomb = (rate / angular_frequency for rate in (a * y, b, c / y))
    shape = np.zeros((len(y), 4 + HARMONICS))
    total = quadratic + linear + coulomb
    shape[:, 0] = np.minimum(HALF_PI * (total - 0.5 * linear), 0.5)
    shape[:, 1] = 0.5 * linear
    shape[:, 2] = HALF_PI**2 * (total * (2.0 * quadratic + linear) - 0.5 * linear**2)
    shape[:, 3] = 0.5 * linear**2
    return shape


def shape_error(
    amplitude: FloatArray, angular_frequency: FloatArray, rates: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What the shape leaves open: relative error of the amplitude, and of the phase in rad.

    With e = (a y + b + c/y)/omega, the third order, about 1.5 e^3 and e^3, and of the second
    what the unknown share of b leaves, 0.1 e b/omega. At Q = 136 it is 1e-6; at Q = 5, 2e-3.
    """
    y = np.maximum(amplitude, 1e-300)
    quadratic, linear, coulomb = np.maximum(rates, 0.0).tolist()
    losses = np.minimum((quadratic * y + linear + coulomb / y) / angular_frequency, 1.0)
    third = losses**3
    return 1.5 * third + 0.1 * losses * linear / angular_frequency, third


_LOSSES: Final = Bounds(np.array([0.0, 0.0, 0.0, -np.inf]), np.full(4, np.inf))
"""Of a, b, c, and of the amplitude from which they act."""


def loss_rates(time_s: FloatArray, amplitude: FloatArray, sd: FloatArray) -> FloatArray:
    """Rates of Eq. 13, none below zero, in one linear step by its integral.

    That is y0 - y = a S y^2 + b S y + c t.

    The integrals come from the amplitudes by Simpson-like cubic sums, so this is a start
    and a shape, not an estimate; the fit of Eq. 14 is `pendpipe.analysis.fit`.

    Parameters
    ----------
    time_s, amplitude, sd
        Of the turning points, shape (k,).
    """
    t = time_s - time_s[0]
    if len(t) < len(_LOSSES.lower):
        fall = np.log(max(amplitude[0], 1e-300) / max(amplitude[-1], 1e-300))
        return np.array([0.0, max(float(fall / t[-1]), 0.0), 0.0])
    y = np.maximum(amplitude, 0.0)
    columns = np.stack([-_integral(t, y**2), -_integral(t, y), -t, np.ones_like(t)], axis=1)
    # Late integrals carry the errors of all before: the weights must not be sharper.
    weight = 1.0 / np.hypot(sd, 3e-4 * y[0])
    weighted = columns * weight[:, None]
    normal, right = weighted.T @ weighted, weighted.T @ (y * weight)
    return bounded_step(normal, right, _LOSSES)[:3]


def _integral(t: FloatArray, f: FloatArray) -> FloatArray:
    """Running integral: trapezoids with the end correction h^2/12 f'."""
    h = np.diff(t)
    slope = np.empty_like(f)
    slope[1:-1] = (f[2:] - f[:-2]) / (t[2:] - t[:-2])
    slope[0], slope[-1] = (f[1] - f[0]) / h[0], (f[-1] - f[-2]) / h[-1]
    steps = 0.5 * h * (f[1:] + f[:-1]) + h**2 / 12.0 * (slope[:-1] - slope[1:])
    return np.concatenate([[0.0], np.cumsum(steps)])


BLOCK = 256
"""Readings that are worked on at a time."""
ROWS = 5 + HARMONICS
"""Of a block: 1, the shape, the sine, the odd harmonics; the cosine; and the readings."""
_COSINE, _READING = ROWS - 2, ROWS - 1


@kernel(inline=True)
def cosine_sine(phase: float) -> tuple[float, float]:
    """Cosine and sine for |phase| < 2, to 1e-9: fast, since no range is reduced."""
    square = phase * phase
    # Each line adds two terms of the series, 1/n! with alternating signs.
    cosine = (square / 20922789888000.0 - 1.0 / 87178291200.0) * square + 1.0 / 479001600.0
    cosine = (cosine * square - 1.0 / 3628800.0) * square + 1.0 / 40320.0
    cosine = (cosine * square - 1.0 / 720.0) * square + 1.0 / 24.0
    cosine = (cosine * square - 0.5) * square + 1.0
    sine = 1.0 / 6227020800.0 - square / 1307674368000.0
    sine = (sine * square - 1.0 / 39916800.0) * square + 1.0 / 362880.0
    sine = (sine * square - 1.0 / 5040.0) * square + 1.0 / 120.0
    sine = (sine * square - 1.0 / 6.0) * square + 1.0
    return cosine, sine * phase


@kernel(any_order=True)
def _fill(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    rate: float,
    centre_s: float,
    level: float,
    shape: FloatArray,
    harmonics: int,
    block: Matrix,
) -> int:
    """Fill the rows of a block of readings; return how many there are."""
    friction, viscous, friction2, viscous2 = shape[0], shape[1], shape[2], shape[3]
    forms, sines, cosines, last = block[1], block[2], block[_COSINE], block[_READING]
    count: int = min((time_s.size + stride - 1) // stride, block.shape[1])
    # In loops of few rows each: compilers vectorise no loop of many that might overlap.
    for i in range(count):
        last[i] = rate * (time_s[i * stride] - centre_s)
    for i in range(count):
        phase = last[i]
        cosine, sine = cosine_sine(phase)
        lack = 1.0 - cosine
        sines[i], cosines[i] = sine, cosine
        forms[i] = (
            cosine
            + (math.copysign(friction, phase) - friction2) * lack
            + viscous * (sine - phase * cosine)
            + viscous2 * phase * (0.5 * phase * cosine - sine)
        )
    for i in range(count):
        last[i] = values[i * stride] - level
    for m in range(harmonics):
        # cos(n + 2) = 2 cos(2) cos(n) - cos(n - 2), n times the phase
        before, now = block[1 + m if m > 1 else _COSINE], block[2 + m if m > 0 else _COSINE]
        new, share = block[3 + m], shape[4 + m]
        for i in range(count):
            new[i] = (4.0 * cosines[i] * cosines[i] - 2.0) * now[i] - before[i]
            forms[i] += share * new[i]
    return count


@kernel(any_order=True)
def product(one: FloatArray, other: FloatArray, count: int) -> float:
    """Return the sum of products of the first `count`."""
    total = 0.0
    for i in range(count):
        total += one[i] * other[i]
    return total


@kernel()
def half_cycle_sums(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    edges: IntMatrix,
    centre_s: FloatArray,
    rate: FloatArray,
    level: float,
    shape: Matrix,
    harmonics: int,
    gram: Stack,
    right: Matrix,
    square: FloatArray,
    block: Matrix,
) -> None:
    """Normal equations of every half cycle: level, amplitude, sine, free odd harmonics.

    Parameters
    ----------
    time_s, values, stride
        Readings, shape (n,), of which every `stride`-th is used.
    edges
        First sample and the one after the last of each half cycle, shape (k, 2).
    centre_s, rate
        Time of the turning point and phase per second, shape (k,).
    level
        What is taken off the readings first.
    shape
        Coefficients of the half cycle's shape (`half_cycle_shape`), shape (k, 4 + HARMONICS).
    harmonics
        How many odd harmonics the shape has; the first of them are fitted besides, where `gram`
        has room for more than three terms.
    gram, right, square
        To be added to: sums of products, shape (k, terms, terms), with the readings, (k, terms),
        and of the readings' squares, (k,).
    block
        Room, shape (ROWS, BLOCK), its first row ones.
    """
    terms = right.shape[1]
    for k in range(centre_s.size):
        first, last = edges[k, 0], edges[k, 1]
        while first < last:
            count = _fill(
                time_s[first:last],
                values[first:last],
                stride,
                rate[k],
                centre_s[k],
                level,
                shape[k],
                harmonics,
                block,
            )
            readings = block[_READING]
            for p in range(terms):
                right[k, p] += product(block[p], readings, count)
                for q in range(p + 1):
                    gram[k, p, q] += product(block[p], block[q], count)
            square[k] += product(readings, readings, count)
            first += count * stride
        for p in range(terms):
            for q in range(p):
                gram[k, q, p] = gram[k, p, q]


_ONE_SIDED: Final = 0.3
"""Correlation of slope and curvature from which readings lie on one side of a turning point."""
_PHASE_PRIOR: Final = 0.02
"""Phase in rad within which an extreme lies about where its neighbours have it."""


class Places(NamedTuple):
    """Where the half cycles are: consecutive numbers, times of turning, half periods."""

    number: IntArray
    centre_s: FloatArray
    half_period_s: FloatArray
    side: FloatArray
    """+1 above the level, -1 below."""

    @property
    def angular_frequency(self) -> FloatArray:
        """Phase per second."""
        return np.pi / self.half_period_s

    @property
    def unsteady_phase(self) -> FloatArray:
        """Phase by which a period that changes may misplace an extrapolated half cycle."""
        steps = np.diff(self.half_period_s)
        # Means of the steps to both sides: np.gradient takes five times as long.
        changes = 0.5 * (np.append(steps[:1], steps) + np.append(steps, steps[-1:]))
        return np.pi * np.abs(changes) / self.half_period_s


class Measured(NamedTuple):
    """What the readings of each half cycle say, shape (k,) each; NaN where there are none."""

    amplitude: FloatArray
    """Factor of the shape, positive on the half cycle's own side."""
    sine: FloatArray
    """Factor of the sine: amplitude times the phase by which the turning is late."""
    variance: FloatArray
    """Of the amplitude, for unit noise."""
    sine_variance: FloatArray
    coupling: FloatArray
    """Fall of the signed amplitude for a rise of the level."""
    harmonics: FloatArray
    """Free odd harmonics, shape (k, free)."""
    peak: FloatArray
    """Amplitude and free harmonics together, their sum's variance for unit noise, and the
    sum's fall with the level; shape (k, 3)."""
    information: FloatArray
    score: FloatArray
    residual_square: FloatArray
    readings: FloatArray
    """How many there are."""
    coverage: FloatArray
    """Sum of the squared shape over the readings: what the amplitude rests on."""
    one_sided: BoolArray
    """Whether readings of one side are missing, so that amplitude and phase mix."""
    single: BoolArray
    """Whether the shape is the half cycle's own, and only its middle is fitted."""

    def phase(self, noise: float) -> FloatArray:
        """Phase by which each turning point is late, in rad; at most 1."""
        floor = 3.0 * noise * np.sqrt(self.variance)
        return np.clip(self.sine / np.maximum(smoothed(self.amplitude), floor), -1.0, 1.0)


_SEVEN: Final = np.ones(7)
"""A half cycle and three neighbours to each side."""


def smoothed(amplitude: FloatArray) -> FloatArray:
    """Geometric-like local mean that leaves a strong decay alone: over y where noise is small."""
    filled = np.where(np.isfinite(amplitude), amplitude, 0.0)
    if len(filled) < len(_SEVEN):
        return filled
    known = np.convolve(np.isfinite(amplitude).astype(np.float64), _SEVEN, "same")
    mean = np.convolve(filled, _SEVEN, "same") / np.maximum(known, 1.0)
    return np.maximum(filled, mean)


def edges(samples: Samples, places: Places, window: float = 1.0) -> IntArray:
    """First sample and the one after the last of each half cycle, shape (k, 2).

    A `window` below 1 takes that part of each half cycle, about its middle.
    """
    if window < 1.0:
        reach = 0.5 * window * places.half_period_s
        ends = np.stack([places.centre_s - reach, places.centre_s + reach], axis=1)
        return np.searchsorted(samples.time_s, ends)
    start = places.centre_s - 0.5 * places.half_period_s
    stop = places.centre_s + 0.5 * places.half_period_s
    between = 0.5 * (stop[:-1] + start[1:])
    bounds = np.concatenate([start[:1], between, stop[-1:]])
    where = np.searchsorted(samples.time_s, bounds)
    return np.stack([where[:-1], where[1:]], axis=1)


def measure(
    samples: Samples,
    places: Places,
    level: float,
    shape: FloatArray,
    *,
    stride: int = 1,
    window: float = 1.0,
    free: int = 0,
    amplitude: FloatArray | None = None,
) -> Measured:
    """Fit every half cycle by linear least squares at a given level.

    Parameters
    ----------
    samples, places
        The readings, and where the half cycles are.
    level
        Taken off the readings; the result says how the rest depends on it.
    shape
        From `half_cycle_shape`.
    stride
        Every how many-th reading is enough.
    window
        Part of the half cycle that is fitted.
    free
        Number of odd harmonics fitted besides.
    amplitude
        Known before; it holds the phase of a half cycle of which only a side is there.
    """
    number = len(places.number)
    terms = 3 + free
    gram, right = np.zeros((number, terms, terms)), np.zeros((number, terms))
    square = np.zeros(number)
    half_cycle_sums(
        samples.time_s,
        samples.values,
        stride,
        edges(samples, places, window),
        places.centre_s,
        places.angular_frequency,
        level,
        shape,
        HARMONICS if free or shape[:, 4:].any() else 0,
        gram,
        right,
        square,
        np.ones((ROWS, BLOCK)),
    )
    prior = np.zeros(number)
    one_sided = gram[:, 1, 2] ** 2 > _ONE_SIDED**2 * gram[:, 1, 1] * gram[:, 2, 2]
    if amplitude is not None and one_sided.any():
        known = np.maximum(smoothed(amplitude), 1e-12)
        held = (samples.noise_rms / (known * (_PHASE_PRIOR + places.unsteady_phase))) ** 2
        prior = np.where(one_sided, held, 0.0)
    harmonics, found = np.empty((number, free)), np.empty((13, number))
    system = np.empty((number, terms - 1, terms - 1))
    solve_half_cycles(gram, right, square, prior, places.side, system, harmonics, found)
    single = np.zeros(number, dtype=bool)
    peak, rest = found[5:8].T, (*found[8:], one_sided, single)
    return Measured._make((*found[:5], harmonics, peak, *rest))


@kernel()
def solve_half_cycles(
    gram: Stack,
    right: Matrix,
    square: FloatArray,
    prior: FloatArray,
    side: FloatArray,
    system: Stack,
    harmonics: Matrix,
    found: Matrix,
) -> None:
    """Solve each half cycle for amplitude, sine and harmonics at a given level.

    Parameters
    ----------
    gram, right, square
        From `half_cycle_sums`; row 0 is the level.
    prior
        Added to the sine's diagonal (an inverse variance about zero, over the noise's).
    side
        Of each half cycle.
    system
        Room for the Gram matrices without the level, (k, size, size).
    harmonics, found
        To be filled: what `Measured` holds of each, the peak in three rows; NaN for half cycles
        without readings.
    """
    size = system.shape[1]
    for k in range(side.size):
        for p in range(size):
            for q in range(size):
                system[k, p, q] = gram[k, p + 1, q + 1] if gram[k, 0, 0] != 0.0 else np.nan
            # A hair of regularisation: few samples can't tell harmonics apart.
            system[k, p, p] *= 1.0 + 1e-9
        system[k, 1, 1] += prior[k] + 1e-12
    invert(system)
    for k in range(side.size):
        inverse, row = system[k], found[:, k]
        peak, variance, by_level = 0.0, 0.0, 0.0
        row[8], row[9], row[10] = gram[k, 0, 0], right[k, 0], square[k]
        row[11], row[12] = gram[k, 0, 0], gram[k, 1, 1]
        for p in range(size):
            # For a level that is right, and minus the change per unit of level.
            best, change = 0.0, 0.0
            for q in range(size):
                best += inverse[p, q] * right[k, q + 1]
                change += inverse[p, q] * gram[k, q + 1, 0]
                variance += inverse[p, q] if p != 1 and q != 1 else 0.0
            row[8] -= gram[k, p + 1, 0] * change
            row[9] -= gram[k, p + 1, 0] * best
            row[10] -= right[k, p + 1] * best
            if p < 2:
                row[p], row[p + 2] = best * side[k], inverse[p, p]
            else:
                harmonics[k, p - 2] = best * side[k]
            if p == 0:
                row[4] = change
            # Amplitude and free harmonics add up at the turning point.
            peak += best * side[k] if p != 1 else 0.0
            by_level += change if p != 1 else 0.0
        row[5], row[6], row[7] = peak, variance, by_level


_BEGINNING: Final = 2048
"""Readings that tell a step: at the beginning the motion crosses most."""
_FEWEST: Final = 16
"""Readings in which anything is sought."""
_SATURATED: Final = 0.1
"""Part of a half cycle that may repeat one reading at its end: a cosine falls by 1 % only over a
tenth at its end."""
_HELD: Final = 0.2
"""Share of rows that repeat the one above, in fast motion, from which readings are held."""
_EVEN: Final = 1e-6
"""Of an interval, by which even times differ at most."""
_ROUNDED: Final = 0.6
"""Of the last digit, by which rounded or cut stamps may lie off the line through them."""
_COUNTS: Final = 50
"""Counts of which one may be lost, and the rows still come one by one."""
_SEVERAL: Final = 3.0
"""Steps from row to row in fast motion."""


@dataclass(frozen=True)
class Samples:
    """Readings against time, with their noise.

    Parameters
    ----------
    time_s, values
        Shape (n,), finite, times strictly rising.
    unit
        ``"rad"`` or ``"m"``.
    step
        The step of the readings; None where there is none, or where the times of the
        steps are the data (`counts`).
    noise_rms
        First estimate of one reading's standard deviation.
    counts
        Whether each row marks the passage of one count of an encoder: the angle is then
        exact, and the error is in the time.
    promised_step
        The converter's step, where only every so manieth of its codes comes and `step` is
        as much larger; None elsewhere.
    radius_excess
        Of positions: distance from the pivot over its median, less 1, shape (n,).
    held
        How many rows repeat the reading above, and are left out.
    """

    time_s: FloatArray
    values: FloatArray
    unit: str
    step: float | None
    noise_rms: float
    counts: bool = False
    promised_step: float | None = None
    radius_excess: FloatArray | None = None
    held: int = 0

    def __len__(self) -> int:
        return len(self.time_s)


def prepare(recording: Recording, place: str | Path) -> Samples:
    """Take the readings of a recording, or say why they can't be used.

    Nothing is copied where every row is good, so that a record may fill the memory.

    Raises
    ------
    NotAnalysableError
        Dead or saturated channel, too few readings.
    InputError
        A sensor constant that is not a number.
    """
    if recording.quantity == "volts":
        recording = motion_of(recording, place=place)
    time, values, radius = recording.time_s, recording.values, recording.radius_excess
    low, high = _range(values)
    if recording.quality is not None or not math.isfinite(high - low):
        time, values = time[recording.usable], values[recording.usable]
        radius = None if radius is None else radius[recording.usable]
        low, high = _range(values)
    refuse_if(
        len(values) < _FEWEST,
        place,
        f"{len(values)} readings are too few",
        "record at least three half cycles",
        NotAnalysableError,
    )
    refuse_if(
        low == high,
        place,
        f"the channel is dead: it reads {low:.6g} throughout",
        "check the sensor",
        NotAnalysableError,
    )
    _refuse_saturated(values, low, high, place)
    time = even_times(time)
    step = recording.resolution or find_step(values[:_BEGINNING])
    if step is not None and _one_row_a_count(time, values, step):
        # Counts are turned into the angles at which they changed, half a step back: the same edge
        # is then passed upwards and downwards at the same angle, and a step's width is no friction.
        angles = values[1:] - 0.5 * np.copysign(step, np.diff(values))
        # The lines of a scale are placed to a small part of its step.
        return Samples(time[1:], angles, recording.unit, None, 0.05 * step, counts=True)
    new, rows = _new_readings(values, step), len(values)
    if new is not None:
        time, values = _when_measured(time, new), values[new]
        radius = None if radius is None else radius[new]
    noise = noise_rms(values, step)
    held = rows - len(values)
    return Samples(time, values, recording.unit, step, noise, radius_excess=radius, held=held)


def even_times(time_s: FloatArray) -> FloatArray:
    """Return the even times that rounded stamps stand for, or the stamps where there are none.

    Sixty frames a second with two decimals come as 0.02, 0.03, 0.05: no stamp is off by more than
    half of its last digit.
    """
    intervals = np.diff(time_s)
    low, high = float(intervals.min()), float(intervals.max())
    if high - low < _EVEN * high or (digit := decimal_step(time_s)) is None:
        return time_s
    usual = float(median(intervals))
    single = float(np.mean(intervals[intervals < 1.5 * usual + digit]))
    number = np.concatenate([[0.0], np.cumsum(np.rint(intervals / single))])
    line = np.polynomial.Polynomial.fit(number, time_s, 1)
    # Of few stamps the line may lie beside the best one.
    even = line(number)
    fits = digit < single and float(np.max(np.abs(time_s - even))) < _ROUNDED * digit
    return even if fits and number[-1] < 2 * len(time_s) else time_s


def _range(values: FloatArray) -> tuple[float, float]:
    """The least and the greatest reading; not finite where one of them isn't."""
    return (float(values.min()), float(values.max())) if len(values) else (math.nan, math.nan)


def _refuse_saturated(values: FloatArray, low: float, high: float, place: str | Path) -> None:
    """Refuse a channel that spends its turning points at the end of its range.

    A sine spends (2/pi) sqrt(2 step/y) of its time within a step of its extremes, both
    together, and a decaying one less: long stays at the very largest and smallest value
    are the converter's.
    """
    piece = values[: 1 << 18]
    for extreme in (low, high):
        at = piece == extreme
        count = np.count_nonzero(at)
        share = count / len(piece)
        if share <= _SATURATED:
            continue
        runs = int(at[0]) + np.count_nonzero(at[1:] & ~at[:-1])
        levels = np.unique(piece)
        step = abs(float(levels[1 if extreme == low else -2]) - extreme) if len(levels) > 1 else 0.0
        expected = math.sqrt(max(step, 1e-12) / (high - low))
        refuse_if(
            len(levels) > _FEWEST and share > 2.0 * expected and count > 8 * runs,
            place,
            f"the channel is saturated: {100.0 * share:.0f} % of the readings are {extreme:.6g}",
            "lower the gain or the starting amplitude, or cut with --start",
            NotAnalysableError,
        )


def _one_row_a_count(time: FloatArray, values: FloatArray, step: float) -> bool:
    """Whether rows come when the count changes, rather than by the clock."""
    piece, when = values[: 1 << 16], time[: 1 << 16]
    change = np.abs(np.diff(piece))
    intervals = np.diff(when)
    single = float(np.mean(np.abs(change - step) < 0.1 * step))
    if not (len(piece) > _COUNTS and single > 1.0 - 1.0 / _COUNTS):
        return False
    low, high = np.percentile(intervals, (10, 90))
    return bool(high > 1.5 * low)


def _new_readings(values: FloatArray, step: float | None) -> BoolArray | None:
    """Return which rows hold a new reading, where a sensor is read more often than it measures.

    What moves by several steps from row to row repeats no reading. Where it is slow a reading may
    be the same again: a new one stands there after as many rows as one is held at most. None where
    each row is a reading.
    """
    piece = values[: 1 << 16]
    again = np.diff(piece) == 0.0
    share = float(np.mean(again))
    if not _HELD < share < 1.0:
        return None
    reach = math.ceil(2.0 / (1.0 - share))
    moved = np.abs(piece[2 * reach :] - piece[: -2 * reach]) / (2 * reach)
    jumps = np.abs(np.diff(piece))
    fast = moved > _SEVERAL * (step or float(jumps[jumps > 0.0].min()))
    repeats = again[reach : reach + len(fast)]
    if np.count_nonzero(fast) < _FEWEST or float(np.mean(repeats[fast])) < _HELD:
        return None
    starts = np.flatnonzero(np.append(True, np.diff(values) != 0.0))
    whole = starts[(starts >= reach) & (starts < reach + len(fast) - reach)]
    lengths = np.diff(whole)[fast[whole[:-1] - reach]]
    usual, most = np.percentile(lengths, (5, 100))
    # Two readings in a row may be the same by chance.
    most = int(usual if usual == np.percentile(lengths, 95) else most)
    age = np.arange(len(values)) - np.repeat(starts, np.diff(np.append(starts, len(values))))
    return np.asarray(age % most == 0)


def _when_measured(time: FloatArray, new: BoolArray) -> FloatArray:
    """Return even times of new readings where these can be true, else those of their rows.

    A reading stands in the first row after it was measured.
    """
    found = time[new]
    order = np.arange(len(found))
    even = np.polynomial.Polynomial.fit(order, found, 1)(order)
    return even if np.ptp(found - even) < 1.1 * float(median(np.diff(time))) else found
