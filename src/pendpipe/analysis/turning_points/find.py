"""Turning points of a free decay, each from all the readings of its half cycle.

Alternating extremes are numbered with no model of the motion; their times are smoothed over
neighbours, and the half cycles followed into the tail. Then the level under them is estimated,
which of them are kept, and their errors.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.coarse import Between, between
from pendpipe.analysis.half_cycles import (
    LEAST_HALF_CYCLES,
    half_cycles,
    least_swing,
    running_median,
    usual_half_period,
)
from pendpipe.analysis.noise import TOLD, scatter, undithered_rms
from pendpipe.analysis.turning_points.harmonics import far_points, mean_square, odd_harmonics
from pendpipe.analysis.turning_points.long_records import follow
from pendpipe.analysis.turning_points.measure import (
    FITTED,
    HARMONICS,
    Measured,
    Places,
    Samples,
    half_cycle_shape,
    loss_rates,
    measure,
    prepare,
    shape_error,
)
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import BoolArray, FloatArray, IntArray, median
from pendpipe.dynamics.kernel import kernel
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.recording import Recording

_ENOUGH: Final = 24
"""Readings in a half cycle that a first look needs, and half cycles from which it is worth it."""
_LOOK: Final = 200_000
"""Readings by which the usual half period is found: of a long record its beginning will do."""
_WIDEST: Final = 80
"""Half cycles whose times are smoothed together at most, by a parabola."""
_GAP: Final = 0.4
"""Half periods without a reading from which a turning point may be lost in them."""
_COUNT: Final = 20.0
"""Noises of an encoder's count in its width (`measure.prepare`)."""
_EDGE: Final = 0.05
"""Half periods from the first reading within which an extreme may be that reading alone."""


class Rough(NamedTuple):
    """Extremes of the readings: their half cycle's number, time and side; the level."""

    number: IntArray
    time_s: FloatArray
    side: IntArray
    level: float


def numbered(samples: Samples) -> tuple[Rough, int]:
    """Number the extremes of a decay.

    Returns
    -------
    rough, stride
        The extremes, and the stride between readings that is enough for a first look.
    """
    piece, counts = samples.values[:_LOOK], samples.counts
    least = least_swing(samples.noise_rms, _COUNT * samples.noise_rms if counts else samples.step)
    half_period = usual_half_period(samples.time_s[:_LOOK], piece)
    time, value, index, stride = np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64), 1
    if half_period is not None:
        # From the first reading on, and no rounding error decides: not the clock's zero.
        since_s = samples.time_s - samples.time_s[0]
        cycles = half_cycles(since_s, samples.values, least, half_period)
        # Where the readings begin the motion need not turn.
        turned = cycles.turn_time_s > _EDGE * half_period
        time, value = cycles.turn_time_s[turned], cycles.turn[turned]
        index = np.searchsorted(since_s, time - 1e-9 * half_period)
        time = samples.time_s[0] + time
    if len(index) > _ENOUGH and not counts:
        stride = max(1, int(median(np.diff(index))) // _ENOUGH)
    side = np.sign(np.diff(value, prepend=value[1:2])).astype(np.int64)
    if len(index) >= LEAST_HALF_CYCLES:
        whole, gap_before = _beside_gaps(samples.time_s, index)
        time, value, side = time[whole], value[whole], side[whole]
    if len(time) < LEAST_HALF_CYCLES:
        return Rough(np.arange(len(time)), time, side, float(median(piece))), stride
    # A beat may begin at a node, and bursts of noise tear half cycles apart: of those that hang
    # together the ones with the most energy are taken.
    number, begin, most, cut = np.zeros(len(time), dtype=np.int64), 0, -1.0, slice(0, 0)
    while len(time) - begin >= LEAST_HALF_CYCLES:
        rest = slice(begin, None)
        usual = float(median(np.diff(time[begin : begin + 6])))
        count = count_half_cycles(time[rest], side[rest], gap_before[rest], usual, number[rest])
        energy = float(np.sum(np.diff(value[begin : begin + count]) ** 2))
        if energy > most:
            most, cut = energy, slice(begin, begin + count)
        begin += count
    return Rough(number[cut], time[cut], side[cut], _level(value[cut])), stride


def _beside_gaps(time: FloatArray, index: IntArray) -> tuple[np.ndarray, IntArray]:
    """Which extremes stand clear of gaps in the data; and which of these have one before them."""
    half_period = float(median(np.diff(time[index[: min(12, len(index))]])))
    gaps = np.flatnonzero(np.diff(time) > _GAP * half_period)
    # An extreme at the very edge of a gap is where the data end, not where they turn.
    edges = time[np.concatenate([gaps, gaps + 1])]
    at_edge = np.abs(time[index, None] - edges) < _EDGE * half_period
    clear = (index > 1) & (index < len(time) - 2) & ~at_edge.any(axis=1)
    before = np.searchsorted(gaps, index[clear])
    return clear, (np.diff(before, prepend=before[:1]) > 0).astype(np.int64)


def _level(value: FloatArray) -> float:
    """Middle of the swings, free of a steady decay: (e + 2 e' + e'')/4."""
    if len(value) < LEAST_HALF_CYCLES:
        return float(np.mean(value))
    return float(median(0.25 * (value[:-2] + 2.0 * value[1:-1] + value[2:])))


_OF_A_PARABOLA: Final = 5
"""Times: its three numbers, and two that tell how well it fits; through fewer goes a line."""


def smooth_times(
    number: IntArray, time_s: FloatArray, weight: FloatArray, wanted: float, at: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the times of turning points over as many neighbours as it takes.

    A weighted local parabola in the number of the half cycle; the window grows until the
    weights sum to `wanted` (the inverse variance that is good enough), between 2 and 40
    neighbours to each side.

    Returns
    -------
    centre_s, half_period_s
        Smoothed time and slope at each number in `at`.
    """
    centre, slope = np.empty(len(at)), np.empty(len(at))
    running, middle = np.append(0.0, np.cumsum(weight)), np.searchsorted(number[:-1], at)
    _smooth(number, time_s, weight, running, wanted, at, middle, centre, slope)
    return centre, slope


@kernel()
def _smooth(
    number: IntArray,
    time_s: FloatArray,
    weight: FloatArray,
    running: FloatArray,
    wanted: float,
    at: IntArray,
    middle: IntArray,
    centre: FloatArray,
    slope: FloatArray,
) -> None:
    """Fill `centre` and `slope`; `middle` is the first neighbour that is not before each.

    `running` are the weights of all before, summed.
    """
    last = number.size - 1
    for k in range(at.size):
        low, high, first_s = max(middle[k] - 2, 0), min(middle[k] + 2, last), time_s[middle[k]]
        low, high = max(min(low, high - 3), 0), min(max(high, low + 3), last)
        while running[high + 1] - running[low] < wanted and high - low < min(_WIDEST, last):
            low, high = max(low - 1, 0), min(high + 1, last)
        w, u, uu, uuu, uuuu, t, ut, uut = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(low, high + 1):
            off, late = float(number[j] - at[k]), time_s[j] - first_s
            first, second = weight[j] * off, weight[j] * off * off
            w, u, uu = w + weight[j], u + first, uu + second
            uuu, uuuu = uuu + second * off, uuuu + second * off * off
            t, ut, uut = t + weight[j] * late, ut + first * late, uut + second * late
        # Through few goes a line; else a parabola, its bend first.
        spread, by_line = uu - u * u / w, ut - u * t / w
        if high - low + 1 >= _OF_A_PARABOLA:
            skew, by_bend = uuu - u * uu / w, uut - uu * t / w
            bend = (by_bend - skew * by_line / spread) / (uuuu - uu * uu / w - skew * skew / spread)
            by_line, t = by_line - bend * skew, t - bend * uu
        slope[k] = by_line / spread
        centre[k] = first_s + (t - slope[k] * u) / w


@kernel()
def count_half_cycles(
    time_s: FloatArray, sign: IntArray, gap_before: IntArray, period: float, number: IntArray
) -> int:
    """Number the extremes, counting those that a gap in the data has swallowed.

    Parameters
    ----------
    time_s, sign
        Of each extreme; `sign` is +1 for a maximum.
    gap_before
        1 where samples are missing between an extreme and the one before it.
    period
        Half period at first.
    number
        To be filled: the number of each half cycle from 0.

    Returns
    -------
    int
        How many extremes from the start hang together (an interval of three half cycles
        without a gap ends the motion).
    """
    number[0] = 0
    for k in range(1, time_s.size):
        interval = time_s[k] - time_s[k - 1]
        odd = sign[k] != sign[k - 1]
        whole = round(interval / period)
        if (whole % 2 == 1) != odd:
            whole += 1 if interval / period > whole else -1
        whole = max(whole, 1 if odd else 2)
        if whole > 2 and gap_before[k] == 0:
            return k
        number[k] = number[k - 1] + whole
        if whole == 1:
            period += 0.3 * (interval - period)
    return time_s.size


_PHASE_WANTED: Final = 0.01
"""Phase, in rad, to which the smoothed times should be known."""
_BLOCK: Final = 8
"""Half cycles followed at once, at least."""


def first_places(rough: Rough) -> Places:
    """Places of all half cycles from the one before the first extreme on, smoothed.

    The readings may begin at a turning point (a release), which is no extreme of theirs.
    """
    at = np.arange(rough.number[0] - 1, rough.number[-1] + 1)
    weight = np.ones(len(rough.number))
    centre, half_period = smooth_times(rough.number, rough.time_s, weight, 5.0, at)
    alternating = rough.side[0] * (2.0 * ((at - at[0]) % 2) - 1.0)
    return Places(at, centre, half_period, alternating)


def times_and_weights(
    places: Places, measured: Measured, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Times of turning, and their inverse variances (zero where nothing is known)."""
    rate = places.angular_frequency
    time = places.centre_s + measured.phase(noise) / rate
    # Beyond what noise does, real pendulums wander in phase by about this much.
    size = np.maximum(measured.amplitude, 1e-12 * np.nanmax(measured.amplitude))
    phase_sd = np.hypot(noise * np.sqrt(measured.sine_variance) / size, 1e-3)
    known = np.isfinite(time) & (measured.amplitude > noise * np.sqrt(measured.variance))
    known &= ~measured.one_sided
    weight = np.where(known, (rate / phase_sd) ** 2, 0.0)
    return np.where(known, time, places.centre_s), weight


def resmoothed(places: Places, measured: Measured, noise: float) -> Places:
    """Smooth the measured times over neighbours, and so the places of the half cycles."""
    time, weight = times_and_weights(places, measured, noise)
    known = weight > 0.0
    if not known.any():
        return places
    wanted = float(median(places.angular_frequency) / _PHASE_WANTED) ** 2
    centre, half_period = smooth_times(
        places.number[known], time[known], weight[known], wanted, places.number
    )
    return places._replace(centre_s=centre, half_period_s=half_period)


def _further(places: Places, measured: Measured, noise: float, count: int) -> Places:
    """Carry the last known half cycles on at their own mean period."""
    time, weight = times_and_weights(places, measured, noise)
    known = np.flatnonzero(weight > 0.0)[-60:]
    own, late, weight = places.number[known], time[known] - time[known[-1]], weight[known]
    total = float(weight.sum())
    middle, mean = float(weight @ own) / total, float(weight @ late) / total
    half = float(weight @ ((own - middle) * late)) / float(weight @ (own - middle) ** 2)
    number = places.number[-1] + 1 + np.arange(count)
    return Places(
        number,
        time[known[-1]] + mean + half * (number - middle),
        np.full(count, half),
        places.side[-1] * (2.0 * (np.arange(count) % 2) - 1.0),
    )


def follow_tail(
    samples: Samples, places: Places, measured: Measured, level: float
) -> tuple[Places, Measured]:
    """Add half cycles too small to be seen singly, as long as blocks of them are seen.

    A block is kept if its amplitude, in phase with what went before, stands out of the
    noise: the sign is the phase's, so noise alone adds up to nothing.
    """
    while True:
        left = (samples.time_s[-1] - places.centre_s[-1]) / places.half_period_s[-1]
        count = int(min(max(_BLOCK, len(places.number) // 8), left + 0.05))
        if count < 1:
            return places, measured
        new = _further(places, measured, samples.noise_rms, count)
        tried = measure(samples, new, level, np.zeros((count, 4 + HARMONICS)))
        if not _visible(tried, samples.noise_rms):
            return places, measured
        places = Places._make(np.concatenate(pair) for pair in zip(places, new, strict=True))
        measured = Measured._make(
            np.concatenate(pair) for pair in zip(measured, tried, strict=True)
        )


def _visible(measured: Measured, noise: float) -> bool:
    """Whether the mean amplitude of some half cycles stands out of the noise."""
    weight = np.where(np.isfinite(measured.amplitude), 1.0 / measured.variance, 0.0)
    if not weight.any():
        return False
    mean = float(np.sum(weight * np.nan_to_num(measured.amplitude)) / weight.sum())
    return mean > _SEEN * noise / float(np.sqrt(weight.sum()))


_LOCKED: Final = 0.1
"""Phase in rad by which rough places may be off when they are measured for the last time."""


def find_turning_points(recording: Recording, place: str | Path = "recording") -> TurningPoints:
    """Measure the turning points of a free decay.

    Extremes give the half cycles' rough places; their times, smoothed over neighbours,
    the phase; then every half cycle is fitted by least squares with the shape that its
    losses give it (`measure.py`), at a level common to all (or slowly wandering). The
    errors of different half cycles are independent but for the level.

    Parameters
    ----------
    recording
        Angles (rad), or any other readings in their own unit, of a free
        decay: what stands before the release is cut already. Times may be uneven.
    place
        Named in messages.

    Returns
    -------
    TurningPoints
        Time, signed angle and level of each, with standard deviations.

    Raises
    ------
    NotAnalysableError
        Dead or saturated channel, amplitude below the noise, under three half cycles.
    InputError
        A sensor constant that is not a number.
    """
    return turning_points_of(prepare(recording, place), place)


def turning_points_of(
    samples: Samples, place: str | Path = "recording", *, long: int = 1 << 22
) -> TurningPoints:
    """As `find_turning_points`, of readings that are prepared already; of `long` ones in a pass."""
    points = None
    if (fine := between(samples.time_s, samples.values, samples.step)) is not None:
        return replace(_of_few(samples, fine, place), readings=samples)
    if len(samples) > long:
        points = follow(samples, lambda head: _measured(head, place), long // 128)
    found = far_points(samples, _measured(samples, place) if points is None else points)
    return replace(found, readings=samples)


def _of_few(samples: Samples, fine: Between, place: str | Path) -> TurningPoints:
    """Measure the half cycles of a coarse record, with the errors that its readings have."""
    dense = replace(samples, time_s=fine.time_s, values=fine.values, step=None, noise_rms=0.0)
    least = 1e-4 * float(np.ptp(fine.values))
    points = _measured(replace(dense, noise_rms=max(fine.noise_rms, least)), place)
    noise = fine.noise_rms
    sd = np.hypot(points.angle_sd_rad, 2.0 * noise / math.sqrt(fine.window))
    pace = math.pi / float(median(np.diff(points.time_s) / np.diff(points.half_cycle)))
    clear = np.maximum(np.abs(points.angle_rad), sd)
    return replace(
        points,
        angle_sd_rad=sd,
        time_sd_s=np.hypot(points.time_sd_s, sd / clear / pace),
        noise_rms_rad=noise,
        step_rad=samples.step or 0.0,
        samples=len(samples),
    )


def _measured(samples: Samples, place: str | Path) -> TurningPoints:
    """Measure half cycle by half cycle."""
    rough, stride = numbered(samples)
    _refuse_few(samples, len(rough.number), place)
    gaps = np.diff(samples.time_s) > _GAP * float(median(np.diff(rough.time_s)))
    refuse_if(
        2 * np.count_nonzero(gaps) > len(rough.number),
        place,
        "most half cycles have a gap in them",
        "record without pauses",
        NotAnalysableError,
    )
    places, first = _locate(samples, rough, stride)
    refuse_if(
        not np.any(_known(first)),
        place,
        "too few readings per cycle (at least four, or twelve if they are uneven)",
        "sample faster",
        NotAnalysableError,
    )
    amplitude, rates, level = _losses(places, first, samples.noise_rms, rough.level)
    places, measured, shape = _shaped(samples, places, amplitude, rates, level, stride)
    # What a gap leaves of a half cycle tells no noise of the others; between counts there is none.
    broken = np.flatnonzero(gaps & (not samples.counts))
    beside = samples.time_s[broken[:, None] + [0, 1]]
    torn = np.searchsorted(places.centre_s - 0.5 * places.half_period_s, beside.ravel()) - 1
    single = measured.single | np.isin(np.arange(len(places.number)), torn)
    terms = 3 + measured.harmonics.shape[1]
    square, freedom = mean_square(measured._replace(single=single), terms)
    if freedom >= TOLD:
        noise = scatter(freedom * square, freedom, samples.step)
        samples = replace(samples, noise_rms=noise)
    keep = kept(samples, places, measured)
    _refuse_few(samples, int(keep.sum()), place)
    return finished(samples, places, measured, shape, rates, level, keep)


def _refuse_few(samples: Samples, found: int, place: str | Path) -> None:
    """Refuse a record without three half cycles."""
    swing, noise = float(np.ptp(samples.values)), samples.noise_rms
    refuse_if(
        found < LEAST_HALF_CYCLES and swing < 12.0 * noise,
        place,
        f"no motion exceeds the noise ({noise:.3g} rms)",
        "raise the amplitude, or pick another channel",
        NotAnalysableError,
    )
    refuse_if(
        found < LEAST_HALF_CYCLES,
        place,
        f"fewer than three half cycles ({found} turning points)",
        "record longer",
        NotAnalysableError,
    )


@np.errstate(divide="ignore")  # bursts of readings tell no half period
def _locate(samples: Samples, rough: Rough, stride: int) -> tuple[Places, Measured]:
    """Lock on to the half cycles with a bare cosine, and follow them into the tail."""
    places, steps = first_places(rough), 3
    while True:
        cosine = np.zeros((len(places.number), 4 + HARMONICS))
        measured = measure(samples, places, rough.level, cosine, stride=stride)
        if not np.any(_known(measured)):
            return places, measured
        late = measured.phase(samples.noise_rms)[~measured.one_sided]
        places = resmoothed(places, measured, samples.noise_rms)
        if np.nanmax(np.abs(late), initial=0.0) < _LOCKED or (steps := steps - 1) == 0:
            break
    return follow_tail(samples, places, measured, rough.level)


def _known(measured: Measured) -> BoolArray:
    """Which half cycles tell amplitude and level."""
    return np.isfinite(measured.amplitude) & (measured.readings > FITTED) & ~measured.one_sided


def _losses(
    places: Places, measured: Measured, noise: float, start: float
) -> tuple[FloatArray, FloatArray, float]:
    """Amplitudes at the mean level, the rates they fall at, and that level."""
    known = _known(measured)
    shift = float(np.sum(measured.score[known]) / np.sum(measured.information[known]))
    amplitude = measured.amplitude - places.side * measured.coupling * shift
    sd = noise * np.sqrt(measured.variance)
    use = known & (amplitude > 2.0 * sd)
    use[last_seen(measured, noise) + 1 :] = False
    if use.sum() >= LEAST_HALF_CYCLES:
        rates = loss_rates(places.centre_s[use], amplitude[use], sd[use])
    else:
        rates = np.zeros(3)
    return np.nan_to_num(amplitude), rates, start + shift


def _shaped(
    samples: Samples,
    places: Places,
    amplitude: FloatArray,
    rates: FloatArray,
    level: float,
    stride: int,
) -> tuple[Places, Measured, FloatArray]:
    """Measure again with the shape that the losses, and odd harmonics, give the half cycles."""
    shape = half_cycle_shape(amplitude, places.angular_frequency, rates)
    measured = measure(samples, places, level, shape, stride=stride, amplitude=amplitude)
    places = resmoothed(places, measured, samples.noise_rms)
    measured = measure(samples, places, level, shape, amplitude=amplitude)
    size = np.abs(np.nan_to_num(measured.amplitude))
    relative, _ = shape_error(size, places.angular_frequency, rates)
    shape, measured, places = odd_harmonics(
        samples, places, level, shape, measured, relative * size
    )
    return places, measured, shape


_WINDOWS: Final = (6, 10, 16, 26, 42, 68)
"""Half-widths in half cycles of the local lines that may follow a wander."""


class Level(NamedTuple):
    """The level at each half cycle, with its standard deviation."""

    value: FloatArray
    sd: FloatArray
    wanders: bool


def estimate_level(information: FloatArray, score: FloatArray, noise: float, start: float) -> Level:
    """Estimate the level from what each half cycle says of it beside its own amplitude.

    A half cycle alone hardly tells its level from its amplitude (they correlate by 0.9):
    opposite half cycles do. A constant is kept unless local lines explain the scatter
    better by more than chance.

    Parameters
    ----------
    information, score
        Per half cycle: inverse variance of its level with the amplitude free (for unit
        noise), and that times the level it would choose, counted from `start`; (k,).
    noise
        Rms of one reading.
    start
        The level that the readings were counted from.
    """
    total = float(information.sum())
    mean = float(score.sum()) / total
    own = score / information
    sd = noise / math.sqrt(total)
    constant = Level(np.full(len(score), start + mean), np.full(len(score), sd), wanders=False)
    if len(score) < 3 * _WINDOWS[0]:
        return constant
    # Neighbours average out the even errors of opposite half cycles (harmonics, decay).
    even = len(score) // 2 * 2
    pairs = information[:even].reshape(-1, 2).sum(1), score[:even].reshape(-1, 2).sum(1)
    # The wander must be smooth against the scatter of neighbours, noise or not.
    narrow, used = _local_lines(*pairs, 4)
    freedom = max(len(pairs[0]) - used, 1.0)
    excess = _criterion(*pairs, narrow, 0.0, noise) / freedom
    noise *= math.sqrt(max(excess, 1.0))
    best, chosen = _criterion(*pairs, np.full(len(pairs[0]), mean), 1.0, noise), None
    for window in _WINDOWS:
        if 3 * window > len(own):
            break
        line, used = _local_lines(*pairs, window)
        criterion = _criterion(*pairs, line, used, noise)
        if criterion < best - 12.0:
            best, chosen = criterion, window
    if chosen is None:
        return constant
    line, used = _local_lines(information, score, chosen)
    local = np.full(len(score), noise * math.sqrt(used / total))
    return Level(start + line, local, wanders=True)


def _criterion(
    information: FloatArray, score: FloatArray, line: FloatArray, used: float, noise: float
) -> float:
    """Akaike's: chi^2 of the levels about a line, and twice the freedom it used."""
    own = score / information
    chi2 = float(np.sum(information * (own - line) ** 2)) / noise**2
    return chi2 + 2.0 * used


def _local_lines(
    information: FloatArray, score: FloatArray, window: int
) -> tuple[FloatArray, float]:
    """Fit a weighted line about each half cycle; return it and the freedom it uses.

    It takes the neighbours within `window`, fewer at the ends.
    """
    line = np.empty(len(score))
    used = _fill_lines(np.ascontiguousarray(information), np.ascontiguousarray(score), window, line)
    return line, used


@kernel()
def _fill_lines(information: FloatArray, score: FloatArray, window: int, line: FloatArray) -> float:
    """Fill in the line at each; return the freedom."""
    used, upper, lower = 0.0, 0, 0
    w, wk, wkk, s, sk = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(score.size):
        # The window's sums, what has come in and less what is left behind.
        while upper < min(k + window + 1, score.size):
            weight, moment = information[upper], information[upper] * upper
            w, wk, wkk = w + weight, wk + moment, wkk + moment * upper
            s, sk, upper = s + score[upper], sk + score[upper] * upper, upper + 1
        while lower < k - window:
            weight, moment = information[lower], information[lower] * lower
            w, wk, wkk = w - weight, wk - moment, wkk - moment * lower
            s, sk, lower = s - score[lower], sk - score[lower] * lower, lower + 1
        centre = wk / w
        spread = max(wkk - wk * centre, 1e-300)
        offset = k - centre
        line[k] = s / w + (sk - s * centre) / spread * offset
        used += information[k] * (1.0 / w + offset * offset / spread)
    return used


_LEAST_SHARE: Final = 0.3
"""Of the readings that its neighbours have; a half cycle with fewer is not kept."""
_SEEN: Final = 3.0
"""Standard deviations by which the last half cycle, with its neighbours, or the mean of those that
are followed must stand out: chance makes one of 400 do so."""


def finished(
    samples: Samples,
    places: Places,
    measured: Measured,
    shape: FloatArray,
    rates: FloatArray,
    start: float,
    keep: BoolArray,
) -> TurningPoints:
    """Put level, amplitude and time together; `start` is the level of the measurement."""
    noise = samples.noise_rms
    level = estimate_level(measured.information[keep], measured.score[keep], noise, start)
    side, rate = places.side[keep], places.angular_frequency[keep]
    coupling, sine = measured.coupling[keep], measured.sine[keep]
    amplitude = measured.amplitude[keep] - side * coupling * (level.value - start)
    sd = noise * np.sqrt(measured.variance[keep])
    sine_sd = noise * np.sqrt(measured.sine_variance[keep])
    height = 1.0 + shape[keep, 4:].sum(axis=1)
    turned = (amplitude + _late(amplitude, sine, sd, sine_sd)) * height
    clear = np.maximum(np.abs(amplitude), sd)
    relative, phase = shape_error(clear, rate, rates)
    # A period that changes from one half cycle to the next skews the wave about its turning.
    skew = np.where(measured.single | measured.one_sided, places.unsteady_phase, 0.0)[keep]
    relative, phase = np.hypot(relative, 0.1 * skew**2), np.hypot(phase, 0.1 * skew**2)
    rounding = undithered_rms(clear, samples.step, noise)
    return TurningPoints(
        half_cycle=places.number[keep] - places.number[keep][0],
        time_s=_turning_s(places, measured, noise)[keep],
        time_sd_s=np.hypot(np.minimum(sine_sd / clear, 1.0), phase) / rate,
        angle_rad=side * turned,
        angle_sd_rad=np.sqrt((sd * height) ** 2 + (relative * clear) ** 2 + rounding**2),
        level_rad=level.value,
        level_sd_rad=float(np.mean(level.sd)),
        level_coupling=float(np.mean(coupling * height)),
        noise_rms_rad=noise,
        step_rad=samples.step or 0.0,
        start_s=float(samples.time_s[0]),
        stop_s=float(samples.time_s[-1]),
        samples=len(samples),
        unit=samples.unit,
        wanders=level.wanders,
        notes=_notes(samples, keep, level),
    )


def _late(
    amplitude: FloatArray, sine: FloatArray, sd: FloatArray, sine_sd: FloatArray
) -> FloatArray:
    """What a small error of phase has taken off the amplitude; unbiased by the noise."""
    strong = amplitude > 5.0 * sd
    lost = (sine**2 - sine_sd**2) / (2.0 * np.where(strong, amplitude, 1.0))
    return np.where(strong, lost, 0.0)


def kept(samples: Samples, places: Places, measured: Measured) -> BoolArray:
    """Half cycles that hold enough readings, and turn among the readings, one after the other.

    A record that ends at rest ends here with the last half cycle that is seen.
    """
    turning, slack = places.centre_s, 0.02 * places.half_period_s
    inside = (turning >= samples.time_s[0] - slack) & (turning <= samples.time_s[-1] + slack)
    keep = inside & (measured.coverage > _LEAST_SHARE * _usual(measured.coverage))
    keep[last_seen(measured, samples.noise_rms) + 1 :] = False
    when = _turning_s(places, measured, samples.noise_rms)[keep]
    before, after = np.maximum.accumulate(when), np.minimum.accumulate(when[::-1])[::-1]
    # Where a disturbed motion turns too soon, its phase is no half cycle's.
    keep[keep] = np.append(True, when[1:] > before[:-1]) & np.append(when[:-1] < after[1:], True)
    return np.asarray(keep)


def _turning_s(places: Places, measured: Measured, noise: float) -> FloatArray:
    """When each half cycle turns, shape (k,)."""
    return places.centre_s + measured.phase(noise) / places.angular_frequency


def last_seen(measured: Measured, noise: float) -> int:
    """The last half cycle that stands out of the noise, with its neighbours; -1 if none.

    Neighbours are on opposite sides: together they cancel an error of the level.
    """
    both, told = (measured.amplitude, measured.variance), np.isfinite(measured.amplitude)
    amplitude, variance = np.where(told, both, [[0.0], [np.inf]])
    around = np.convolve(amplitude, [0.25, 0.5, 0.25], "same")
    seen = around > np.maximum(_SEEN * noise * np.sqrt(variance), 1e-6 * float(np.max(amplitude)))
    return int(np.max(np.flatnonzero(seen), initial=-1))


_NEAR: Final = 5
"""Neighbours to each side that tell what is usual: their median bears a gap of five."""


def _usual(coverage: FloatArray) -> FloatArray:
    """What is usual among the neighbours."""
    middle = float(median(coverage[coverage > 0.0])) if coverage.any() else 0.0
    if len(coverage) < 2 * _NEAR + 2 or np.max(np.abs(coverage[1:-1] - middle)) < 0.3 * middle:
        return np.full(len(coverage), middle)
    padded = np.pad(coverage, _NEAR, mode="reflect")
    return running_median(padded, _NEAR)[_NEAR:-_NEAR]


def _notes(samples: Samples, keep: BoolArray, level: Level) -> tuple[str, ...]:
    inner = keep[int(np.argmax(keep)) : len(keep) - int(np.argmax(keep[::-1]))]
    lost = int(np.count_nonzero(~inner))
    notes = (
        (lost, f"{lost} half cycle(s) are left out: too few readings, or out of order"),
        (level.wanders, "the offset wanders; it is followed by local lines"),
        (
            samples.held,
            f"readings are held: {samples.held} row(s) repeat the one above, and are left out",
        ),
        (samples.counts, "one row per count: the times of the counts are the data"),
    )
    return tuple(note for is_so, note in notes if is_so)
