"""From measured half cycles to the table: the level under them, which are kept, their errors."""

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.noise import undithered_rms
from pendpipe.analysis.turning_points.measure import Measured, Places
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.shape import shape_error
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import BoolArray, FloatArray

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
    pairs = _paired(information, score)
    if _steady(*pairs, mean, noise):
        return constant
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


def _steady(information: FloatArray, score: FloatArray, mean: float, noise: float) -> bool:
    """Whether blocks of a dozen half cycles agree with one level, as chance would have it."""
    blocks = len(score) // 6
    if blocks < 4:
        return False
    used = slice(0, 6 * blocks)
    weight = information[used].reshape(blocks, 6).sum(1)
    own = score[used].reshape(blocks, 6).sum(1) / weight
    chi2 = float(np.sum(weight * (own - mean) ** 2)) / noise**2
    # Neighbouring blocks that depart together are a slow wander, small as it may be.
    pull = np.sqrt(weight) * (own - mean) / noise
    together = float(np.sum(pull[1:] * pull[:-1]))
    return chi2 < blocks + 3.0 * math.sqrt(2.0 * blocks) and together < 3.0 * math.sqrt(blocks)


def _paired(information: FloatArray, score: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Join half cycles two by two."""
    even = len(score) // 2 * 2
    return information[:even].reshape(-1, 2).sum(1), score[:even].reshape(-1, 2).sum(1)


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
    """Fit a weighted line about each half cycle; return it and the freedom it uses."""
    k = np.arange(len(score), dtype=np.float64)
    sums = [
        _box(column, window)
        for column in (information, information * k, information * k * k, score, score * k)
    ]
    w, wk, wkk, s, sk = sums
    centre = wk / w
    spread = wkk - wk * centre
    slope = (sk - s * centre) / np.maximum(spread, 1e-300)
    offset = k - centre
    leverage = information * (1.0 / w + offset**2 / np.maximum(spread, 1e-300))
    return s / w + slope * offset, float(leverage.sum())


def _box(column: FloatArray, window: int) -> FloatArray:
    """Sum over the neighbours within `window` of each entry (fewer at the ends)."""
    running = np.concatenate([[0.0], np.cumsum(column)])
    k = np.arange(len(column))
    upper, lower = np.minimum(k + window + 1, len(column)), np.maximum(k - window, 0)
    return np.asarray(running[upper] - running[lower])


_LEAST_SHARE: Final = 0.3
"""Of the readings that its neighbours have; a half cycle with fewer is not kept."""
_SEEN: Final = 3.0
"""Standard deviations by which the last half cycle must stand out, with its neighbours."""


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
        time_s=places.centre_s[keep] + measured.phase(noise)[keep] / rate,
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
    """Half cycles that hold enough readings, and whose turning lies among the readings.

    A record that ends at rest ends here with the last half cycle that is seen.
    """
    turning, slack = places.centre_s, 0.02 * places.half_period_s
    inside = (turning >= samples.time_s[0] - slack) & (turning <= samples.time_s[-1] + slack)
    keep = inside & (measured.coverage > _LEAST_SHARE * _usual(measured.coverage))
    keep[last_seen(measured, samples.noise_rms) + 1 :] = False
    return np.asarray(keep)


def last_seen(measured: Measured, noise: float) -> int:
    """The last half cycle that stands out of the noise, with its neighbours; -1 if none.

    Neighbours are on opposite sides: together they cancel an error of the level.
    """
    amplitude = np.nan_to_num(measured.amplitude)
    around = np.convolve(amplitude, [0.25, 0.5, 0.25], "same")
    sd = noise * np.sqrt(np.nan_to_num(measured.variance, nan=np.inf))
    seen = around > np.maximum(_SEEN * sd, 1e-6 * float(np.max(amplitude)))
    return int(np.max(np.flatnonzero(seen), initial=-1))


def _usual(coverage: FloatArray) -> FloatArray:
    """What is usual among the five neighbours to each side."""
    middle = float(np.median(coverage[coverage > 0.0]))
    if len(coverage) < 12 or np.max(np.abs(coverage[1:-1] - middle)) < 0.3 * middle:
        return np.full(len(coverage), middle)
    padded = np.pad(coverage, 5, mode="reflect")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 11), axis=1))


def _notes(samples: Samples, keep: BoolArray, level: Level) -> tuple[str, ...]:
    notes = []
    inner = keep[int(np.argmax(keep)) : len(keep) - int(np.argmax(keep[::-1]))]
    lost = int(np.count_nonzero(~inner))
    if lost:
        notes.append(f"{lost} half cycle(s) are left out for lack of readings")
    if level.wanders:
        notes.append("the offset wanders; it is followed by local lines")
    if samples.counts:
        notes.append("one row a count: the times of the counts are the data")
    return tuple(notes)
