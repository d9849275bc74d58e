"""What readings show by themselves: steps, turns, amplitudes, the pull of gravity, their scale."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis.half_cycles import larger_half_cycles
from pendpipe.arrays import FloatArray, quantiles
from pendpipe.errors import refuse_if
from pendpipe.facts import Fact
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2
from pendpipe.recording import Recording


def motion_of(
    recording: Recording, volts_per_radian: float | None = None, place: str | Path = "recording"
) -> Recording:
    """Return a recording in radians where the sensor's constant is known.

    Angles are counted from where the pendulum hangs, without jumps. Anything else stays in its
    own unit: metres, volts without a constant, counts, pixels. The analysis is the same, and Q
    and the period need no constant; but the amplitude, a and c are then in that unit and no
    angle, so that sin x does not apply.

    Parameters
    ----------
    recording
        As it was read.
    volts_per_radian
        The sensor's constant; by default the recording's own.
    place
        Named in messages.

    Raises
    ------
    InputError
        If the recording's own constant is not a number, or 0; if it is an accelerometer's pull
        along the string, whose frequency is twice the pendulum's; or if the numbers are such as
        no pendulum gives, and their squares or their differences no computer holds.
    """
    motion = _in_radians(recording, volts_per_radian, place)
    _check_scale(motion, place)
    return with_amplitudes(_with_pull(motion, place))


def with_amplitudes(recording: Recording) -> Recording:
    """Note that a recording holds amplitudes, if nobody has and they only fall."""
    time_s, values = recording.time_s[recording.usable], recording.values[recording.usable]
    if recording.holds_amplitudes or not only_falls(values):
        return recording
    fact = amplitudes_in(recording.quantity, time_s, values)
    metadata = {**recording.metadata, "holds": "amplitudes"}
    return replace(recording.knowing(fact), metadata=metadata)


def amplitudes_in(label: str, time: FloatArray | None, values: FloatArray) -> Fact:
    """Say of readings that `only_falls` calls amplitudes how that is known.

    Turning points on both sides in turn, at even times, may as well be two readings a cycle, each a
    little later in it: that they are turning points is a guess.
    """
    said = f"'{label}' only falls: amplitudes against time"
    steps = np.diff(time) if time is not None else np.empty(0)
    even = len(steps) > _BY_HAND and np.ptp(steps) < _EVEN * np.median(steps)
    if even and alternate(values):
        said += ", or two readings a cycle, which show neither period nor loss"
        return Fact("amplitudes", label, "guessed", said)
    return Fact("amplitudes", label, "shown", said)


def _with_pull(recording: Recording, place: str | Path) -> Recording:
    """Refuse an accelerometer's pull along the string; note what may be one."""
    if recording.unit != "m/s^2" or not recording.unit_is_stated:
        return recording
    good = recording.usable
    fact = pull_along_string(recording.time_s[good], recording.values[good])
    refuse_if(
        fact is not None and fact.how == "shown",
        place,
        "this is the pull along the string (about 9.8 m/s^2), which swings twice per period",
        "give the axis along the swing, or the gyroscope, with --column (--unit counts takes it"
        " as it stands)",
    )
    return recording if fact is None else recording.knowing(fact)


def _check_scale(recording: Recording, place: str | Path) -> None:
    """Refuse a span of time or of readings that is beyond any pendulum."""
    values = recording.values[np.isfinite(recording.values)]
    if len(values) < 2:
        return
    span, span_s = float(np.ptp(values)), float(recording.time_s[-1] - recording.time_s[0])
    for wrong, problem in (
        (not _SHORTEST_S < span_s < _LONGEST_S, f"the times span {span_s:.3g} s"),
        (not 0 <= float(np.abs(values).max()) < _LARGEST, "the readings are too large"),
        (0 < span < 1 / _LARGEST, f"the readings move by {span:.3g} {recording.unit}"),
    ):
        refuse_if(wrong, place, problem, "check their unit")


def _in_radians(
    recording: Recording, volts_per_radian: float | None, place: str | Path
) -> Recording:
    if recording.quantity == "angle_rad":
        values, notes = from_below(recording.values)
        known = recording
        for note in notes:
            known = known.knowing(Fact("turns", "undone", "shown", note))
        return replace(known, values=values) if notes else recording
    if recording.quantity != "volts":
        return recording
    constant = volts_per_radian or recording.number("volts_per_radian", place)
    if constant is None:
        said = "no sensor constant: a, c and the amplitude are in volts"
        return recording.knowing(Fact("sensor constant", "none", "guessed", said))
    refuse_if(
        not constant,
        place,
        "the sensor constant is 0",
        "give --volts-per-radian (see calibrate)",
    )
    return replace(
        recording,
        values=recording.values / constant,
        quantity="angle_rad",
        resolution=None if recording.resolution is None else recording.resolution / abs(constant),
        metadata={**recording.metadata, "volts_per_radian": repr(float(constant))},
    )


_LARGEST: Final = 1e60
"""Of readings, whose fourth powers must be numbers as well; they move by its inverse at least."""
_SHORTEST_S, _LONGEST_S = 1e-60, 1e14
"""Of a recording. Beyond three million years the search for the period counts false cycles."""


_ALONG: Final = 0.03
"""Of g, within which an axis along the string hangs. Its share is the cosine of the axis' tilt,
evenly spread where a device lies as it may: one other axis in 33 hangs as near."""
_SURE_SD: Final = 3.0
"""Standard errors off 0 of a slope that chance makes one time in 700."""
_FEWEST_TURNS: Final = 8
"""Half cycles, which leave five degrees of freedom for the error of a slope."""


def pull_along_string(time_s: FloatArray, values: FloatArray) -> Fact | None:
    """Say whether readings in m/s^2 hang at g as an accelerometer's axis along the string does.

    A string is pulled by g (3 cos x - 2 cos A): up to 2 g (1 - cos A) above g in the middle of a
    swing, and to g (1 - cos A) below it where it turns. So the level between the turning points of
    the readings rises by a third of their amplitude as that grows; (2 q - 1)/(2 q + 1) of it, of a
    sensor at q of the length of the simple pendulum. An axis that sees the swing through a tilt has
    a level that falls.
    """
    level = float(np.nanmedian(values)) if len(values) else 0.0
    if abs(abs(level) / STANDARD_GRAVITY_M_PER_S2 - 1.0) > _ALONG:
        return None
    said = (
        "the readings hang about 9.8 m/s^2, as a pull along the string does, which swings twice"
        " in a period of the pendulum"
    )
    cycles, shown = larger_half_cycles(time_s, values), False
    if cycles is not None and len(cycles) >= _FEWEST_TURNS:
        turn = np.sign(level) * cycles.turn
        between = 0.25 * (turn[:-2] + 2.0 * turn[1:-1] + turn[2:])
        size = 0.25 * (cycles.swing[:-1] + cycles.swing[1:])
        (slope, _), matrix = np.polyfit(size, between, 1, cov=True)
        shown = slope > _SURE_SD * float(np.sqrt(matrix[0, 0]))
    return Fact("pull", "9.8 m/s^2", "shown" if shown else "guessed", said)


_LEVEL: Final = 0.03
"""Of the range, by which falling sizes may lie above the least before them, on average."""


_BY_HAND: Final = 100
"""Turning points that somebody has noted; a converter takes more readings."""
_EVEN: Final = 0.01
"""Of an interval, within which those of a converter lie; of what people note down, few do."""


def alternate(values: FloatArray) -> bool:
    """Say whether readings lie on two sides of a level in turn."""
    signs = np.sign(np.diff(values[np.isfinite(values)]))
    return len(signs) > 3 and bool(np.mean(signs[1:] * signs[:-1] < 0.0) >= 0.9)


def sizes_of(values: FloatArray) -> FloatArray:
    """Give the amplitudes in a list of them, or of turning points about any level, shape (n,)."""
    level = 0.0
    if alternate(values):
        level = float(np.nanmedian(0.25 * (values[:-2] + 2.0 * values[1:-1] + values[2:])))
    return np.asarray(np.abs(values - level))


_LONGEST_LIST: Final = 100_000
"""Readings of which nobody makes a list of amplitudes."""
_REST: Final = 0.1
"""Of the largest size, below which a decay is nearly over."""
_BENDS: Final = 8
"""How often a smooth fall bends to and fro about a cubic, at most."""


def only_falls(values: FloatArray) -> bool:
    """Say whether readings are a decay without its swings: sizes that fall from one to the next.

    Noise may let some rise, but then they scatter about a smooth fall as noise does, whose second
    differences alternate.

    Examples
    --------
    >>> time = np.arange(50.0)
    >>> only_falls(np.exp(-time / 20)), only_falls(np.exp(-time / 20) * np.cos(time))
    (True, False)
    """
    if len(values) > _LONGEST_LIST:
        return False
    sizes = sizes_of(values[np.isfinite(values)])
    if len(sizes) < 4 or not sizes[-1] < 0.8 * sizes[0]:
        return False
    sizes = sizes / sizes.max()
    # A long rest behind a decay tells nothing of it, and a wild reading makes no range.
    largest = float(quantiles(sizes, 0.98)[0])
    moving = sizes[: int(np.flatnonzero(sizes > _REST * largest)[-1]) + 1]
    above = float(np.mean(moving - np.minimum.accumulate(moving)))
    # None is above 1: of a swing no range need be asked for.
    if not above < _LEVEL or not above < _LEVEL * float(np.ptp(quantiles(moving, 0.02, 0.98))):
        return False
    steps = np.diff(sizes)
    falls, rises = float(np.mean(steps < 0.0)), float(np.mean(steps > 0.0))
    bends = np.diff(steps)
    if len(bends) > 4 * _BENDS:
        powers = np.linspace(-1.0, 1.0, len(bends))[:, None] ** np.arange(4)
        bends = bends - powers @ np.linalg.lstsq(powers, bends)[0]
    alike = float(bends[1:] @ bends[:-1]) / max(float(bends @ bends), 1e-300)
    turns = np.count_nonzero(bends[1:] * bends[:-1] < 0.0)
    if alike > 0.3 and turns > _BENDS:
        # A smooth swing on a steep drift.
        return False
    return falls > max(0.4, 3.0 * rises) or (falls > rises and alike < -0.3)


def jumps_of_a_turn(values: FloatArray) -> bool:
    """Say whether readings (radians) stay within a turn, and neighbours lie a turn apart."""
    if len(values) < 2 or np.ptp(values) > 2.02 * np.pi:
        return False
    jumps = np.abs(np.diff(values))
    return bool(np.any((jumps > 1.8 * np.pi) & (jumps < 2.2 * np.pi)))


def from_below(values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Count an angle from where the pendulum hangs: undo wraps, then whole half turns.

    A centre within 0.35 rad of a multiple of pi is taken to be where the pendulum hangs:
    at an odd one the angle counts from the top, at an even one from some turns ago. So is
    one within 0.15 rad of a quarter turn: polar angles are counted from the horizontal.

    Returns
    -------
    angle_rad
        Shape (n,).
    notes
        What was done.
    """
    notes, good = list[str](), np.isfinite(values)
    # No centre of these lies a quarter turn off.
    if not good.any() or np.abs(values[good]).max() < 0.5 * np.pi - 0.15:
        return values, ()
    if jumps_of_a_turn(values[good]):
        values = values.copy()
        values[good] = np.unwrap(values[good])
        notes.append("the angle jumps by a turn: unwrapped")
    low, centre, high = np.percentile(values[good], (5, 50, 95)).tolist()
    centre = centre if high - low < 1.0 else 0.5 * (low + high)
    for quarters, words, near in ((2, "half turn", 0.35), (1, "quarter turn", 0.15)):
        turns = round(centre / (0.5 * np.pi * quarters))
        shift = 0.5 * np.pi * quarters * turns
        if turns and abs(centre - shift) < near:
            notes.append(
                f"the angle swings about {centre:.3f} rad: {shift:.4f} rad"
                f" ({turns} {words}) taken off, so that it hangs near 0"
            )
            return values - shift, tuple(notes)
    return values, tuple(notes)


def find_step(values: FloatArray) -> float | None:
    """Find the step between readings: what all differences of neighbours are multiples of.

    ``None`` where there is none (a computed or a smoothed reading). Neighbours, and not
    all distinct values, since an encoder that has lost a count once has two ladders of
    values with one step. Numbers with a fixed number of digits (0.0938, 0.104) have no one step.
    """
    finite = values[np.isfinite(values)]
    if len(finite) < 2 or np.abs(finite).max() > _LARGEST:
        return None
    jumps = np.abs(np.diff(finite))
    # Values that arithmetic has left a rounding error apart are one value.
    jumps = np.sort(jumps[jumps > 1e-9 * float(np.ptp(finite))])
    if not len(jumps):
        return None
    smallest = float(jumps[min(2, len(jumps) - 1)])
    near = float(jumps[jumps <= 1.35 * smallest].mean())
    if not (step := _refined(jumps, near) or _refined(jumps, smallest)):
        return None
    sizes = np.unique(np.abs(finite))
    tenths = sizes[3 * len(sizes) // 4 :] / (10.0 * step)
    # All large ones multiples of ten steps: numbers of fixed digits.
    return None if len(tenths) > 8 and np.all(np.abs(tenths - np.rint(tenths)) < 0.02) else step


_SOME: Final = 256
_DIGITS: Final = 9
"""Decimals beyond which numbers are taken as not rounded."""


def decimal_step(values: FloatArray) -> float | None:
    """Find the last decimal that numbers are written to; ``None`` beyond nine decimals.

    Examples
    --------
    >>> decimal_step(np.array([0.02, 0.03, 0.05]))
    0.01
    """
    if len(values) > 2 * _SOME and decimal_step(values[:_SOME]) is None:
        return None
    largest = float(np.abs(values).max(initial=0.0))
    for digits in range(_DIGITS + 1):
        scaled = values * 10.0**digits
        # Doubles hold sixteen digits, whatever the decimals are.
        slack = 1e-6 + 4e-16 * largest * 10.0**digits
        if slack < 0.01 and np.all(np.abs(scaled - np.rint(scaled)) < slack):
            return float(10.0**-digits)
    return None


def _refined(jumps: FloatArray, step: float) -> float | None:
    """Fit ``jump = k step`` and keep the step if nearly all jumps lie on it.

    The reach of the fit grows, since an error of the step adds up over many steps.
    """
    reach, full = 2.0 * step, float(jumps[-1])
    while True:
        reach *= 2.0
        near = jumps[jumps <= reach]
        multiples = np.rint(near / step)
        step = float(near @ multiples) / (float(multiples @ multiples) or np.inf) or step
        # Jumps that belong to no ladder are spread evenly: 40 % of them within 0.2.
        if np.mean(np.abs(near - multiples * step) < 0.2 * step) < 0.9:
            return None
        if reach >= full:
            return step
