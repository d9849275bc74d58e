"""What is seen of a misfit, whatever its cause: in which part of the motion, where, how large.

A model is compared with the readings cycle by cycle, on the phase of the model that stays in step.
Of all windows of time, or pairs of them, the one is told whose misfit is large and sure: the
geometric mean of its size, less the error that chance makes in one of all windows (`deviations`),
and of that over the error. The largest alone would be that of the last swings, the surest an
average.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.demodulation import by_cycle, cycle_starts
from pendpipe.analysis.fit.printed import short_size
from pendpipe.analysis.misfit import misfit_of
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.cycles import Cycles, cycles, span_ends
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.location import between_models
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.dynamics.eq8 import OMEGA
from pendpipe.estimate import Z95, Estimate
from pendpipe.levels import deviations
from pendpipe.quantities import prefixed, stretch, with_error

_MOST_WINDOWS: Final = 40
"""Parts of a recording that are told apart, as in the figures."""
_FEWEST: Final = 3
"""Ends of spans: two windows side by side."""
_SHARE: Final = 0.25
"""Of the misfit, from which on a second part is told, too: a choice."""
_MOST_TOLD: Final = 2
_HARMONICS: Final = 4
"""As many as `misfit_of` tells from what lies between them."""
_LINE_SHARE: Final = 0.5
"""Of what lies between the harmonics, from which a line is that: most of it."""


@dataclass(frozen=True)
class Seen:
    """One thing that is seen.

    Parameters
    ----------
    part
        ``"frequency"``, ``"loss"``, ``"offset"``, ``"waveform"``, or ``"between"`` the harmonics;
        of what happens at an instant ``"amplitude"``, ``"phase"`` or ``"offset"``.
    share
        Of the misfit's excess over the noise; 1 of what happens at an instant.
    size
        Of frequency, loss and amplitude relative; of a phase in rad; else in the unit of the
        readings.
    time_s, amplitude_rad
        Where: from the middle of the first window to that of the second, or over one window.
    clause
        In words.
    """

    part: str
    share: float
    size: Estimate
    time_s: tuple[float, float]
    amplitude_rad: tuple[float, float]
    clause: str


class _Found(NamedTuple):
    """What a part shows: its size, the window, or two, and words with a place for the size."""

    size: Estimate
    time_s: tuple[float, float]
    words: str


def seen_of(
    before: Fit,
    after: Fit,
    data: Data,
    noise: Noise,
    *,
    instant_s: tuple[float, float] | None = None,
    line_hz: Estimate | None = None,
) -> tuple[Seen, ...]:
    """Return what the readings show that a model does not, the largest part first, two at most.

    Parameters
    ----------
    before
        The model that is compared.
    after
        The one that stays in step with the readings.
    data, noise
        The readings.
    instant_s
        When something happens at once: then its jump is told, and nothing else.
    line_hz
        Of a line off the harmonics: likewise.
    """
    phase = after.at.sampled.phase
    missed = (between_models(before, after) + data.residual(after.at.reading)) * data.weight
    shares = misfit_of(missed / noise.sd, phase).shares
    whole = cycles(data.values, data, after.at, noise.white_rms)
    model = cycles(before.at.reading, data, before.at, 0.0)
    if not (len(whole.time_s) and len(model.time_s)):
        return ()
    both = (model.time_s[0] <= whole.time_s) & (whole.time_s <= model.time_s[-1])
    own = Cycles(whole.time_s[both], whole.amplitude[both], whole.phase[both], whole.sd[both])
    model = model.at(own.time_s)
    if instant_s is not None and (jump := _jump(own, model, missed, after, data, instant_s)):
        return (jump,)
    if line_hz is not None:
        return (_line(missed, line_hz, data, noise, own),)
    each: dict[str, tuple[str, Callable[[], _Found | None]]] = {
        "phase": ("frequency", lambda: _frequency(own, model, before)),
        "amplitude": ("loss", lambda: _loss(own, model)),
        "offset": ("offset", lambda: _offset(missed, phase, data, noise)),
        "harmonics": ("waveform", lambda: _waveform(missed, phase, data, noise)),
        "between": ("between", lambda: _between(missed, after, data, noise)),
    }
    told: list[Seen] = []
    for name, share in sorted(shares.items(), key=lambda item: -item[1]):
        if len(told) == _MOST_TOLD or (told and share < _SHARE) or not share > 0.0:
            break
        part, look = each[name]
        if (found := look()) is not None:
            sizes = np.interp(found.time_s, own.time_s, own.amplitude).tolist()
            clause = found.words
            if found.time_s != (float(data.time_s[0]), float(data.time_s[-1])):
                clause += f" {_where((sizes[0], sizes[1]), found.time_s, data)}"
            told.append(Seen(part, share, found.size, found.time_s, (sizes[0], sizes[1]), clause))
    return tuple(told)


def _where(amplitude: tuple[float, float], time_s: tuple[float, float], data: Data) -> str:
    """Return where: amplitudes, and when; times alone where the amplitude is the same."""
    first, last = (short_size(each, data.unit) for each in amplitude)
    # To a hundredth of the recording, as well as anybody asks.
    digits = 2 - math.floor(math.log10(float(np.ptp(data.time_s))))
    when = stretch(*(round(each, digits) + 0.0 for each in time_s))
    alike = abs(amplitude[0] - amplitude[1]) < _ALIKE * max(amplitude)
    return f"from {when}" if alike else f"from {first} to {last} ({when})"


_ALIKE: Final = 0.01
"""Relative difference below which amplitudes of three digits do not show a change between them."""


def _percent(size: Estimate) -> str:
    """Print a relative change in per cent, or in parts per million below a thousandth."""
    factor, unit = (1e6, "ppm") if abs(size.value) < 1e-3 else (100.0, "%")
    return with_error(factor * abs(size.value), factor * size.sd, unit, short=True)


def _number(size: Estimate) -> str:
    factor, unit = prefixed(abs(size.value), size.unit)
    return with_error(factor * abs(size.value), factor * size.sd, unit, short=True)


def _windows(count: int) -> list[tuple[int, int]]:
    """Return windows of so many points by first and last: a part in 2, 4, 8, ... of them each."""
    widths = [2**k for k in range(count.bit_length()) if 2**k < count]
    return [(i, i + width) for width in widths for i in range(count - width)]


def _told(size: FloatArray, sd: FloatArray, among: BoolArray | None = None) -> int | None:
    """Return which of several sizes is told; None where chance makes the largest."""
    asked = sd > 0.0 if among is None else among & (sd > 0.0)
    if not asked.any():
        return None
    beyond = np.abs(size) - deviations(float(asked.sum())) * sd
    score = np.where(asked & (beyond > 0.0), beyond / np.sqrt(np.where(asked, sd, 1.0)), 0.0)
    best = int(np.argmax(score))
    return best if score.ravel()[best] > 0.0 else None


def _two(
    windows: list[tuple[int, int]], value: FloatArray, sd: FloatArray
) -> tuple[int, int] | None:
    """Return which two windows differ, the first before the second."""
    first, last = np.array(windows).T
    apart = last[:, None] <= first
    best = _told(value - value[:, None], np.hypot(sd[:, None], sd), apart)
    return None if best is None else divmod(best, len(value))


def _frequency(own: Cycles, model: Cycles, fit: Fit) -> _Found | None:
    """A change of the frequency beyond the model's: between two windows, relative."""
    ends = span_ends(own)
    if len(ends) < _FEWEST:
        return None
    windows = _windows(len(ends))
    first, last = np.array(ends)[np.array(windows).T]
    turns = (own.phase - model.phase) / float(fit.value[OMEGA])
    lasts = own.time_s[last] - own.time_s[first]
    value = (turns[last] - turns[first]) / lasts
    sd = np.hypot(own.sd[first], own.sd[last]) / float(fit.value[OMEGA]) / lasts
    if (two := _two(windows, value, sd)) is None:
        return None
    one, other = two
    size = Estimate(float(value[other] - value[one]), math.hypot(sd[one], sd[other]), "")
    when = [float(own.time_s[[first[k], last[k]]].mean()) for k in two]
    way = "rises" if size.value > 0.0 else "falls"
    return _Found(size, (when[0], when[1]), f"the frequency {way} by {_percent(size)}")


def _loss(own: Cycles, model: Cycles) -> _Found | None:
    """A loss that is not the model's: in one window, relative to the model's there."""
    ends = span_ends(own)
    if len(ends) < _FEWEST:
        return None
    first, last = np.array(ends)[np.array(_windows(len(ends))).T]
    log, expected = np.log(own.amplitude), np.log(model.amplitude)
    due = expected[first] - expected[last]
    more = log[first] - log[last] - due
    sd = np.hypot(own.sd[first], own.sd[last])
    # A window in which the model loses nothing has no ratio.
    usual = np.maximum(due, 1e-3 * np.ptp(expected))
    best = _told(more / usual, sd / usual)
    if best is None:
        return None
    when = float(own.time_s[first[best]]), float(own.time_s[last[best]])
    size = Estimate(float(more[best] / usual[best]), float(sd[best] / usual[best]), "")
    if more[best] + due[best] < 0.0:
        grown = Estimate(float(-more[best] - due[best]), float(sd[best]), "")
        return _Found(size, when, f"the swing grows by {_percent(grown)}")
    if due[best] < usual[best]:
        return None
    way = "larger" if size.value > 0.0 else "smaller"
    return _Found(size, when, f"the loss is {_percent(size)} {way} than fitted")


class _Series(NamedTuple):
    """Means over cycles of what is missed: offset, cosines and sines, with their errors."""

    value: FloatArray
    """Shape (1 + 2 harmonics, windows)."""
    sd: FloatArray
    time_s: FloatArray
    """Of the first and last reading, shape (windows, 2)."""
    windows: list[tuple[int, int]]


def _series(missed: FloatArray, phase: FloatArray, data: Data, noise: Noise) -> _Series:
    """Take means over windows of cycles; a cosine's mean square is one half."""
    found, _ = by_cycle(missed, phase, _HARMONICS)
    starts = cycle_starts(phase)
    number = np.add.reduceat(data.weight, starts)
    root = np.sqrt(np.maximum(number, 1.0))[:, None]
    scale = np.where(np.arange(found.shape[1]) > 0, math.sqrt(2.0), 1.0)
    edges = np.linspace(0, len(starts), min(len(starts), _MOST_WINDOWS) + 1).astype(int)
    windows = _windows(len(edges))
    total = np.concatenate([np.zeros((1, found.shape[1])), np.cumsum(found * root, axis=0)])
    counted = np.concatenate([[0.0], np.cumsum(number)])
    first, last = edges[np.array(windows).T]
    readings = np.maximum(counted[last] - counted[first], 1.0)[:, None]
    value = scale * (total[last] - total[first]) / readings
    sd = scale * noise.rms / np.sqrt(readings)
    when = np.append(data.time_s[starts], data.time_s[-1])
    return _Series(value.T, sd.T, np.stack([when[first], when[last]], axis=1), windows)


def _offset(missed: FloatArray, phase: FloatArray, data: Data, noise: Noise) -> _Found | None:
    """A change of the offset, between two windows."""
    found = _series(missed, phase, data, noise)
    value, sd = found.value[0], found.sd[0]
    if not found.windows or (two := _two(found.windows, value, sd)) is None:
        return None
    one, other = two
    size = Estimate(
        float(value[other] - value[one]), float(np.hypot(sd[one], sd[other])), data.unit
    )
    when = [float(found.time_s[k].mean()) for k in two]
    way = "rises" if size.value > 0.0 else "falls"
    return _Found(size, (when[0], when[1]), f"the offset {way} by {_number(size)}")


def _waveform(missed: FloatArray, phase: FloatArray, data: Data, noise: Noise) -> _Found | None:
    """A harmonic that is not the model's, in one window."""
    found = _series(missed, phase, data, noise)
    if not found.windows:
        return None
    size = np.hypot(found.value[3::2], found.value[4::2])
    sd = found.sd[3::2]
    if (told := _told(size, sd)) is None:
        return None
    order, best = divmod(told, size.shape[1])
    number = Estimate(float(size[order, best]), float(sd[order, best]), data.unit)
    when = float(found.time_s[best, 0]), float(found.time_s[best, 1])
    return _Found(number, when, f"harmonic {order + 2} is off by {_number(number)}")


def _between(missed: FloatArray, after: Fit, data: Data, noise: Noise) -> _Found | None:
    """A line, a higher harmonic, or what else lies between the harmonics."""
    _, rest = by_cycle(missed, after.at.sampled.phase, _HARMONICS)
    excess = float(np.mean(rest**2)) - noise.rms**2
    when = float(data.time_s[0]), float(data.time_s[-1])
    if not excess > 0.0:
        return None
    interval = (when[1] - when[0]) / (len(rest) - 1)
    even = np.interp(np.linspace(*when, len(rest)), data.time_s, rest)
    lines = 2.0 * np.abs(np.fft.rfft(even)) / len(rest)
    best = int(np.argmax(lines))
    size = float(lines[best])
    if 0.5 * size**2 < _LINE_SHARE * excess:
        rms = Estimate(math.sqrt(excess), 0.0, data.unit)
        return _Found(rms, when, f"between the harmonics lie {_number(rms)} rms beyond the noise")
    line = Estimate(size, noise.rms * math.sqrt(2.0 / len(rest)), data.unit)
    hertz, apart = best / (interval * len(rest)), 1.0 / (when[1] - when[0])
    order = hertz * after.at.span.period_s
    if abs(order - round(order)) < apart * after.at.span.period_s and round(order) > _HARMONICS:
        return _Found(line, when, f"harmonic {round(order)} is off by {_number(line)}")
    at = with_error(hertz, 0.5 * apart, "Hz", short=True)
    return _Found(line, when, f"a line of {_number(line)} stands at {at}")


def _line(missed: FloatArray, hertz: Estimate, data: Data, noise: Noise, own: Cycles) -> Seen:
    """A line of known frequency: its mean amplitude."""
    turned = np.exp(-2.0j * math.pi * hertz.value * data.time_s) * data.weight
    size = 2.0 * abs(complex(missed @ turned)) / data.used
    found = Estimate(size, noise.rms * math.sqrt(2.0 / data.used), data.unit)
    at = with_error(hertz.value, hertz.sd, "Hz", short=True)
    ends = float(data.time_s[0]), float(data.time_s[-1])
    sizes = float(own.amplitude[0]), float(own.amplitude[-1])
    return Seen("between", 1.0, found, ends, sizes, f"a line of {_number(found)} stands at {at}")


_BESIDE: Final = 8
"""Cycles on each side of a jump, about which the rest is straight: a choice."""


def _jump(
    own: Cycles,
    model: Cycles,
    missed: FloatArray,
    after: Fit,
    data: Data,
    instant_s: tuple[float, float],
) -> Seen | None:
    """What jumps most beyond its error at an instant; None where nothing does."""
    middle, half = 0.5 * sum(instant_s), 0.5 * (instant_s[1] - instant_s[0])
    # The cycle with the instant in it is neither before nor after.
    clear = 0.5 * after.at.span.period_s + half
    earlier = np.flatnonzero(own.time_s < middle - clear)[-_BESIDE:]
    later = np.flatnonzero(own.time_s > middle + clear)[:_BESIDE]
    if min(len(earlier), len(later)) < _BESIDE:
        return None
    offset = [
        float(np.mean(missed[np.abs(data.time_s - t) <= 0.5 * after.at.span.period_s]))
        for t in own.time_s[[*earlier, *later]]
    ]
    changes = {
        "amplitude": (np.log(own.amplitude / model.amplitude)[[*earlier, *later]], own.sd, ""),
        "phase": ((own.phase - model.phase)[[*earlier, *later]], own.sd, "rad"),
        "offset": (
            np.array(offset),
            own.sd * own.amplitude / math.sqrt(2.0),
            data.unit,
        ),
    }
    near = [*earlier, *later]
    later_ones = np.repeat([0.0, 1.0], _BESIDE)
    columns = np.stack([np.ones(2 * _BESIDE), own.time_s[near] - middle, later_ones], axis=1)
    solve = np.linalg.pinv(columns)[2]
    found = [
        (part, Estimate(float(solve @ value), float(np.linalg.norm(solve * sds[near])), unit))
        for part, (value, sds, unit) in changes.items()
    ]
    part, size = max(found, key=lambda each: abs(each[1].value) / max(each[1].sd, 1e-300))
    if abs(size.value) < deviations(len(changes)) * size.sd:
        return None
    number = _percent(size) if part == "amplitude" else _number(size)
    way = "up" if size.value > 0.0 else "down"
    way = {"phase": "ahead" if size.value > 0.0 else "back"}.get(part, way)
    at = with_error(middle, half / Z95, "s", short=True)
    sizes = own.amplitude[[earlier[-1], later[0]]].tolist()
    clause = f"at {at} the {part} jumps {way} by {number}"
    return Seen(part, 1.0, size, instant_s, (sizes[0], sizes[1]), clause)
