"""Which part of a recording is one free decay.

A pendulum that swings by itself turns at alternate sides, each time nearer to the centre,
after half periods that change little. What does not go like that is cut, with its reason:
rest before the release, the hand's pull, driven parts, rest after the stop, clamping and
repositioning, and every decay but the most telling one.

A decay is a run of half cycles that follow one another.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.angles import as_pendulum
from pendpipe.analysis.coarse import HARDLY, between
from pendpipe.analysis.half_cycles import (
    LEAST_HALF_CYCLES,
    HalfCycles,
    half_cycles,
    least_swing,
    running_median,
    usual_half_period,
)
from pendpipe.analysis.noise import noise_rms
from pendpipe.analysis.turning_points.find import find_turning_points
from pendpipe.analysis.turning_points.table import Cut, TurningPoints
from pendpipe.arrays import BoolArray, FloatArray, IntArray, median
from pendpipe.dynamics.kernel import Matrix, kernel
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.quantities import after_number, with_error
from pendpipe.recording import Recording

_FEWEST: Final = 8
"""Readings of a piece: fewer hold no half cycle with its neighbours."""
# Loose on purpose: an impulse or a beat is physics to be diagnosed, not to be cut.
_RISE: Final = 1.3
_FALL: Final = 0.3
"""Part of the swing before that is left where a hand has caught the pendulum."""
_TAIL: Final = 0.05
"""Part of the first swing by which a small one may grow: noise, or a beat of the support."""
_PERIOD: Final = 0.3
"""Change of ln half period that is another motion: sin x changes it by as much at 117 degrees."""
_WAVER: Final = 0.12
"""Mean change of ln half period of a motion that is not one mode."""
_FLAT: Final = 0.025
"""Of a swing, within which turning points are the same."""
_FEW_FLAT: Final = 4
"""Half cycles of one side whose end is called flat: three may lie alike by their rounding."""
_LONG: Final = 1.6
"""By which a flat side holds more readings than a crest has there."""
_SMOOTH: Final = 0.03
"""Of means of neighbours, which chance makes smooth as well."""


_FEW_LINKS: Final = 6
"""Links in a row of which those two apart are too few to tell how even all are."""
_PRICE: Final = 2.0
"""Of two half cycles that go on, which a disturbance costs: fewer behind it show nothing."""
_COUNTLESS: Final = 4.5
"""Half periods of a disturbance up to which the motion's phase shows by itself."""
_NEAR: Final = 5
"""Half cycles back to which a motion goes on, disturbed ones among them."""


@dataclass(frozen=True, eq=False)
class Run:
    """Half cycles `first` to `last` (inclusive) that belong together.

    Parameters
    ----------
    cycles
        All half cycles of the record.
    bridged
        Disturbed half cycles inside.
    score
        How freely they follow one another.
    before
        Why what stands before it is no free decay, where its amplitudes tell.
    """

    cycles: HalfCycles
    first: int
    last: int
    bridged: int = 0
    score: float = 0.0
    before: str = ""

    @property
    def swing(self) -> FloatArray:
        """Distances between neighbouring turning points, shape (legs,)."""
        return self.cycles.swing[self.first : self.last + 1]

    @property
    def middle_s(self) -> FloatArray:
        """When the middle between the two turning points is passed, shape (legs,)."""
        return self.cycles.middle_s[self.first : self.last + 1]

    @property
    def half_period_s(self) -> float:
        """The usual half period."""
        return float(median(np.diff(self.middle_s)))

    @property
    def worth(self) -> float:
        """What it tells of loss and period, the error of a swing over that of their rates.

        With swings s_k the root of their information, sum s_k^2 (k - <k>)^2.
        """
        weight, place = self.swing**2, np.arange(self.legs)
        middle = float(weight @ place) / float(weight.sum())
        return math.sqrt(float(weight @ (place - middle) ** 2))

    @property
    def legs(self) -> int:
        """Number of half cycles."""
        return self.last - self.first + 1


def best_runs(
    cycles: HalfCycles,
    gaps_s: Sequence[float] | FloatArray = (),
    readings: tuple[FloatArray, FloatArray] = (np.empty(0), np.empty(0)),
) -> list[Run]:
    """Find the runs among the half cycles of a record with gaps at some times, the best first.

    Its `readings` (times, values) say whether the sensor cuts off turns.
    """
    if len(cycles) < LEAST_HALF_CYCLES:
        return []
    piece = np.searchsorted(gaps_s, cycles.middle_s)
    half = _usual(cycles, np.diff(piece) > 0)
    follows, fronts, asked = _follows(cycles, half), dict[int, str](), -1
    # No half cycle follows in a front that is held up, or cut off by the sensor: where chains have
    # one they are aligned again without it.
    while len(fronts) > asked:
        asked, chains = len(fronts), _chains(cycles, piece, half, follows)
        for one in (one for _, one in chains if one[0] not in fronts):
            whole = slice(one[0], one[-1] + 1)
            held = _held(cycles.swing[whole], cycles.step)
            if front := held or _flat(cycles, whole, *readings):
                follows[one[0] : one[0] + front] = -math.inf
                fronts[one[0] + front] = _DRIVEN if held else _CUT_OFF
    runs = (
        Run(cycles, one[0], one[-1], one[-1] - one[0] + 1 - len(one), score, fronts.get(one[0], ""))
        for score, one in chains
        if len(one) >= LEAST_HALF_CYCLES
    )
    return sorted(runs, key=lambda run: -run.worth)


def _usual(cycles: HalfCycles, gap: BoolArray) -> FloatArray:
    """The usual half period at each link, of which some are over a gap; shape (m - 1,).

    What holds a gap is no half period, and those behind it may be another motion's.
    """
    half = np.diff(cycles.middle_s)
    parts = np.split(np.where(gap, np.nan, half), np.flatnonzero(gap) + 1)
    known = np.concatenate([running_median(part, 2) for part in parts if len(part)])
    return np.where(np.isnan(known), median(half), known)


def _chains(
    cycles: HalfCycles, piece: IntArray, usual: FloatArray, follows: FloatArray
) -> list[tuple[float, list[int]]]:
    """Align half cycles to chains, each of one free motion: a chain ends where its score is most.

    (Smith and Waterman's alignment of pieces.) A half cycle goes on from the one before at a score
    of up to 1, or over disturbed ones, or a gap to the next `piece` of the record, at a price.
    """
    size = len(cycles)
    numbers, places = np.zeros((4, size)), np.full(size, -1)
    _link(cycles.swing, cycles.middle_s, piece, usual, follows, cycles.step, numbers, places)
    score, before = numbers[0].tolist(), places.tolist()
    chains, free = list[tuple[float, list[int]]](), [True] * size
    for last in sorted(range(size), key=score.__getitem__, reverse=True):
        chain = [last]
        while free[last] and before[chain[-1]] >= 0:
            chain.append(before[chain[-1]])
        if all(free[chain[-1] : last + 1]) and len(chain) > 1:
            free[chain[-1] : last + 1] = [False] * (last + 1 - chain[-1])
            chains.append((score[last], chain[::-1]))
    return chains


def _follows(cycles: HalfCycles, usual: FloatArray) -> FloatArray:
    """Score for each half cycle but the last how freely the next one follows it, shape (m - 1,).

    1 where half period and swing are those before, 0 at the limits of either.
    """
    swing, half = cycles.swing, np.diff(cycles.middle_s)
    before, after, step = swing[:-1], swing[1:], cycles.step
    # A step of the converter moves the passage of the middle by this share of a half period.
    blur = np.minimum(0.5 * step / np.minimum(before, after), 0.3)
    late = np.log(half / usual) / (_PERIOD + blur)
    loss = np.concatenate(([0.0], swing[:-2] - swing[1:-1]))
    # Coulomb friction takes the same from each half cycle, so the last ones shrink fast.
    low = np.minimum(_FALL * before, before - 1.6 * loss - step)
    change = after - before
    off = np.where(change > 0.0, change / ((_RISE - 1.0) * before + step), change / (before - low))
    worst = np.maximum(late**2, off**2)
    edges = [0, *(np.flatnonzero(worst > 1.0) + 1).tolist(), len(swing)]
    for first, last in pairwise(edges):
        if last - first >= LEAST_HALF_CYCLES:
            one = slice(first, last - 1)
            worst[one] = np.maximum(worst[one], _wavering(cycles, first, last) ** 2)
    return np.asarray(1.0 - worst)


@kernel()
def _link(
    swing: FloatArray,
    middle_s: FloatArray,
    piece: IntArray,
    usual: FloatArray,
    follows: FloatArray,
    step: float,
    numbers: Matrix,
    before: IntArray,
) -> None:
    """Fill in which half cycle goes on `before` each, or -1, with the chain's score up to it.

    Behind it in `numbers`: the first and the least swing, and the largest of the last three.
    """
    score, first, floor, top = numbers[0], numbers[1], numbers[2], numbers[3]
    for here in range(swing.size):
        first[here] = floor[here] = top[here] = size = swing[here]
        last, most = here - 1, 0.0
        if here == 0:
            continue
        disturbed = size > _RISE * floor[last] + _TAIL * first[last] + step
        disturbed = disturbed or follows[last] < 0.0
        # What is smaller than the next, and begins the motion, is a pull.
        pulled = 0.93 * size - 0.5 * step
        for at in range(max(0, here - _NEAR) if disturbed else last, here):
            if before[at] < 0 and swing[at] < pulled:
                continue
            link = score[at]
            if disturbed:
                gap = piece[at] < piece[here]
                link += _over(swing, middle_s, at, here, top[at], usual, step, gap)
            else:
                link += follows[at]
            if link > 0.0 and link >= most:
                most, before[here] = link, at
        at = before[here]
        if at >= 0:
            third = swing[before[at]] if before[at] >= 0 else size
            score[here], first[here] = most, first[at]
            top[here] = max(size, swing[at], third)
            # Of the least a wild one is none.
            middle = max(min(size, swing[at]), min(max(size, swing[at]), third))
            floor[here] = min(floor[at], middle)


@kernel()
def _over(
    swing: FloatArray,
    middle_s: FloatArray,
    at: int,
    here: int,
    top: float,
    usual: FloatArray,
    step: float,
    gap: bool,
) -> float:
    """Score whether a motion goes on over a disturbance (a tracking error, lost samples), or a gap.

    `top` is the largest of the last three swings before: where a turning point is lost in a gap,
    the swings beside it are too small. In a longer gap the half cycles must be countable: half
    periods before and behind it say the same whole number, and the side that of that number. So
    must their loss.
    """
    size, pause = swing[here], middle_s[here] - middle_s[at]
    # Half periods of the five half cycles before, and behind.
    behind, ahead = usual[max(at - 3, 0)], usual[min(here + 2, usual.size - 1)]
    off = math.log(size / top) / math.log(1.15 if size > top else 2.0)
    short, alike = pause < _COUNTLESS * behind, abs(ahead / behind - 1.0) < _PERIOD
    if not (gap or short) or not alike or size < 3.0 * step:
        return -np.inf
    if short:
        return 1.0 - off**2 - _PRICE if abs(off) < 1.0 else -np.inf
    number, least, largest = round(0.5 * (pause / behind + pause / ahead)), np.inf, -np.inf
    for one, other in ((max(at - _BLOCKS, 0), at), (here, min(here + _BLOCKS, swing.size) - 1)):
        if other > one:
            loss = (swing[one] - swing[other]) / (other - one)
            least, largest = min(least, loss), max(largest, loss)
    if largest < least:
        least = largest = 0.0
    counted = max(abs(pause / behind - number), abs(pause / ahead - number)) < _COUNTED
    falls = 0.5 * number * least - step < top - size < 2.0 * number * largest + step
    agree = counted and falls and (here - at - number) % 2 == 0
    return 1.0 - _PRICE if agree else -np.inf


def _wavering(cycles: HalfCycles, first: int, last: int) -> float:
    """How far periods and amplitudes waver, over what a pendulum's may."""
    swing, half = cycles.swing[first:last], np.diff(cycles.middle_s[first:last])
    usual = float(median(swing))
    blur = cycles.step / usual
    # Where the sides differ, half cycles two apart are alike; of a few that says too little.
    apart = 2 if len(half) > _FEW_LINKS else 1
    waver = float(median(np.abs(half[apart:] - half[:-apart]))) / float(median(half))
    # Viscous loss takes the same share of each half cycle, Coulomb friction the same amount: a
    # strong one of either bends what is even under the other.
    kinks = float(np.min(median(_bends(swing, usual))))
    if kinks >= _WAVER and len(half) > _FEW_LINKS:
        # A zero that drifts shortens and lengthens swings in turn, and not the means of neighbours.
        means = 0.5 * (swing[1:] + swing[:-1])
        kinks = _WAVER / _SMOOTH * float(np.min(np.mean(_bends(means, usual), axis=1)))
    return max(waver / (_WAVER + 0.5 * blur), kinks / (_WAVER + 2.0 * blur))


def _bends(swing: FloatArray, usual: float) -> FloatArray:
    """Bends of the swings' logarithms, and of the swings over the usual one."""
    return np.asarray(np.abs([np.diff(np.log(swing), 2), np.diff(swing, 2) / usual]))


def _held(swing: FloatArray, step: float) -> int:
    """Count half cycles at the front whose amplitude is held while that after them falls.

    The loss of a free half cycle grows with its amplitude; so the first k half cycles lose
    at least k times what those after them lose. A tenth of that is no free decay. (The top
    of a beat is flat too, but loses 0.3 of it.)
    """
    count = len(swing)
    if count < 9:
        return 0
    k = np.arange(4, count - 4)
    ahead = np.minimum(np.maximum(4, k // 2), count - 1 - k)
    # Medians of seven: a disturbed half cycle inside the run is no drive.
    ends = 2.0 * swing[0] - swing[3:0:-1], swing, 2.0 * swing[-1] - swing[-2:-5:-1]
    smooth = running_median(np.concatenate(ends), 3)[3:-3]
    falls = smooth[k] - smooth[k + ahead]
    expected = k * falls / ahead
    lost = smooth[0] - smooth[k]
    held = (lost < 0.1 * expected) & (expected > np.maximum(0.1 * swing[0], 3.0 * step))
    # Near the end a small scatter of few half cycles would stand for the loss of hundreds, and
    # the last fall of an amplitude that wavers all along for the end of its drive.
    waver = np.maximum.accumulate(np.maximum.accumulate(smooth) - smooth)[k]
    held &= falls > np.maximum(2.0 * waver, 3.0 * step)
    gain = np.where(held, expected - lost, 0.0)
    best = int(np.argmax(gain))
    return int(k[best]) if gain[best] > 0.0 else 0


def _flat(cycles: HalfCycles, whole: slice, time: FloatArray, values: FloatArray) -> int:
    """Count half cycles at the front that end flat on one side, while the other side falls.

    A sonic ranger has a dead zone, an optical sensor an edge: there the readings stay.
    """
    turns, when = (part[whole.start : whole.stop + 1] for part in (cycles.turn, cycles.turn_time_s))
    near = max(_FLAT * abs(float(turns[1] - turns[0])), cycles.step)
    for side in (0, 1):
        own, other = turns[side::2], turns[1 - side :: 2]
        floor = float(median(own[:_FEW_FLAT]))
        count = int(np.argmax(np.append(np.abs(own - floor) > near, True)))
        falls = count < len(other) and abs(other[0] - other[count]) >= 3.0 * near
        if falls and count >= _FEW_FLAT and len(turns) - 1 - 2 * count - side > _MANY:
            inside = slice(*np.searchsorted(time, when[[0, 2 * count - 2 + side]]))
            swing = abs(float(median(other[:count])) - floor)
            expected = math.acos(1.0 - 2.0 * near / swing) / math.pi
            if np.mean(np.abs(values[inside] - floor) < near) > _LONG * expected:
                return 2 * count + side
    return 0


_SHORT: Final = 8.0
"""Half periods below which a rest between two motions is part of the handling."""
_DRIVEN: Final = "driven: the amplitude is held up"
_CUT_OFF: Final = "the sensor reads no further on one side: larger swings are left out"
_BY_HAND: Final = "held or moved by hand before release"
_NO_DECAY: Final = "no free decay: handling, clamp, repositioning or drive"


def stretches(
    time: FloatArray,
    values: FloatArray,
    start_s: float,
    stop_s: float,
    *,
    quiet: float,
    window_s: float,
    before: str,
) -> list[Cut]:
    """Tell what is left out of ``[start_s, stop_s]``.

    Parameters
    ----------
    time, values
        The recording.
    quiet
        A stretch of `window_s` that moves by less than this is at rest.
    before
        The reason why motion before the start is no free decay.
    """
    sides = (
        (float(time[0]), start_s, "rest before release", before),
        (stop_s, float(time[-1]), "at rest after the decay", _NO_DECAY),
    )
    return [
        Cut(low, high, rest if still else motion, still)
        for begin, end, rest, motion in sides
        if end > begin
        for low, high, still in _parts(time, values, begin, end, quiet, window_s)
    ]


def _parts(
    time: FloatArray, values: FloatArray, begin: float, end: float, quiet: float, window_s: float
) -> list[tuple[float, float, bool]]:
    """Go through windows of half a period; say of each whether it is rest (gaps are)."""
    count = max(1, min(2000, round((end - begin) / window_s)))
    edges = np.linspace(begin, end, count + 1)
    places = np.searchsorted(time, edges)
    # One sample more at each side: what moves between two windows is motion too.
    windows = [values[max(first - 1, 0) : last + 1] for first, last in pairwise(places.tolist())]
    still = [len(part) < 2 or float(np.ptp(part)) < quiet for part in windows]
    for first, last in _runs_of_flags(still)[1:-1]:
        # A short rest between two motions is part of the handling.
        if edges[last] - edges[first] < _SHORT * window_s:
            still[first:last] = [False] * (last - first)
    return [(float(edges[a]), float(edges[b]), still[a]) for a, b in _runs_of_flags(still)]


def _runs_of_flags(flags: list[bool]) -> list[tuple[int, int]]:
    """First and last+1 of each run of the same."""
    ends = [0, *(i for i in range(1, len(flags)) if flags[i] != flags[i - 1]), len(flags)]
    return list(pairwise(ends))


_BLOCKS: Final = 9
"""Half cycles, or blocks of them, by whose medians two runs are compared."""
_MANY: Final = 18
"""Half cycles that follow one another by no accident, however small they are."""
_STEADY: Final = 0.2
"""By which the half periods of a beat may differ from the usual one, but at its nodes."""
_SPOILT: Final = 3.0
"""Of the usual loss: what loses more in a half cycle was caught, and what has less left rests."""
_AS_MUCH: Final = 0.2
"""What a run that does not fall counts beside one that does, for what it tells."""
_COUNTED: Final = 0.25
"""Half cycles by which the count across a gap may be off."""
_NODE: Final = 4
"""Half cycles at a node of a beat."""


@dataclass(frozen=True)
class FreeDecay:
    """The part of a recording that is one free decay.

    Parameters
    ----------
    start_s, stop_s
        Its ends, on the recording's clock.
    cuts
        What lies outside, with the reason, in the order of time.
    half_period_s
        The half period, roughly (the median).
    half_cycles
        How many half cycles were counted in it.
    notes
        What else was noticed, a clause each.
    beats
        Which two modes beat, where they do.
    """

    start_s: float
    stop_s: float
    cuts: list[Cut]
    half_period_s: float
    half_cycles: int
    notes: list[str] = field(default_factory=list)
    beats: str = ""

    def of(self, recording: Recording) -> Recording:
        """Return that part of the recording."""
        return recording.between(self.start_s, self.stop_s)


def find_free_decay(recording: Recording, place: str | Path = "recording") -> FreeDecay:
    """Find the free decay in a recording of angles or displacements.

    After a pull or a hold by hand it starts where the first free swing passes its middle
    (the hand may have followed until then); in a recording that begins in free motion, at
    its first sample. It ends half a period after the last turning point that stands out of
    noise and step, or with the recording, or where something else begins.

    Parameters
    ----------
    recording
        In radians or metres (`readings.motion_of`); samples may be uneven.
    place
        Named in messages.

    Raises
    ------
    NotAnalysableError
        When there is no free decay of at least three half cycles: one line that says why.
    """
    time, values, least, half_period = _looked_at(recording, place)
    cycles = half_cycles(time, values, least, half_period)
    # A gap of a period parts the record: in it the motion could have done anything.
    edges = np.flatnonzero(np.diff(time) > 2.0 * half_period)
    # Of so many others some fall in turn by chance, k of them one time in k!; each link tells as
    # much as it scores.
    found = [
        run
        for run in best_runs(cycles, time[edges], (time, values))
        if math.log(max(len(cycles) - run.legs, 1)) <= math.lgamma(run.score + 2.0)
    ]
    # A drive that comes or goes may tell as much, but does not fall.
    falls = {run: _falls(run, least) for run in found}
    told = max(found, key=lambda run: run.worth * (1.0 if falls[run] else _AS_MUCH), default=None)
    alone = told and falls[told] and sum(run.worth for run in found) <= 1.3 * told.worth
    ends = (float(told.middle_s[0]), float(told.middle_s[-1])) if told else (math.inf, math.inf)
    beat = _beating(
        time,
        values,
        cycles,
        half_period,
        place,
        driven=not alone,
        held=told is not None and told.before == _DRIVEN,
        decay_s=ends,
    )
    if beat is not None:
        return beat
    if told is None:
        raise NotAnalysableError(
            place,
            "no free decay: no three half cycles follow each other with falling amplitude,"
            " unless by chance",
            "handling, a clamp or a drive can't be analysed",
        )
    _refuse_without_fall(place, time, values, told, least, falls=falls[told])
    others = [run for run in found if run.worth > 0.05 * told.worth and run is not told]
    return _described(
        time, values, edges, told, others, least, may_turn_over=recording.quantity == "angle_rad"
    )


def _looked_at(
    recording: Recording, place: str | Path
) -> tuple[FloatArray, FloatArray, float, float]:
    """Times and readings in which a decay is looked for, the least swing, and the half period."""
    refuse_if(
        recording.holds_amplitudes,
        place,
        "it holds amplitudes, not a recording of the swing",
        "use pendpipe fit, which fits Eq. 14 to them",
        NotAnalysableError,
    )
    # A whole recording is not copied.
    usable = slice(None) if recording.usable.all() else recording.usable
    time, values = recording.time_s[usable], recording.values[usable]
    span = float(np.ptp(values)) if len(values) else 0.0
    refuse_if(
        len(values) < _FEWEST or span == 0.0,
        place,
        "the reading never changes" if len(values) >= _FEWEST else f"{len(values)} samples only",
        "choose another with --channel or --column",
        NotAnalysableError,
    )
    noise = noise_rms(values, recording.resolution, quieter=0.1)
    if (fine := between(time, values, recording.resolution, HARDLY)) is not None:
        time, values, noise = fine.time_s, fine.values, fine.noise_rms
    least = least_swing(noise, recording.resolution)
    half_period = usual_half_period(time, values)
    # Noise alone spans about `least`. What hardly exceeds it many half cycles can prove.
    if half_period is None or span < 1.5 * least:
        why = (
            f"no oscillation: the reading moves by {span:.3g}{after_number(recording.unit)},"
            f" its noise and step hide {least:.2g}"
            if span < 10.0 * least
            else "no oscillation: the reading does not swing to and fro"
        )
        raise NotAnalysableError(place, why, "give a recording of a free decay")
    return time, values, least, half_period


def _described(
    time: FloatArray,
    values: FloatArray,
    edges: IntArray,
    run: Run,
    others: list[Run],
    least: float,
    *,
    may_turn_over: bool,
) -> FreeDecay:
    """Say where a decay begins and ends, what is cut off it, and what else was noticed."""
    piece = time[np.append(edges, len(time) - 1)], time[np.append(0, edges + 1)]
    stop = _stop(float(piece[0][np.searchsorted(piece[0], run.middle_s[-1])]), run)
    first = int(np.searchsorted(time, piece[1][np.searchsorted(piece[1], run.middle_s[0]) - 1]))
    start = _start(time[first:], values[first:], run)
    half, swing = run.half_period_s, float(run.swing[0])
    before = run.before or _BY_HAND
    centre = float(np.mean(run.cycles.turn[run.first : run.first + 2]))
    wide = np.abs(values[time < start] - centre).max(initial=0.0)
    if may_turn_over and wide > np.pi > 0.5 * swing:
        before = "it went over the top before it settled"
    quiet = max(2.0 * least, 0.02 * swing)
    cuts = stretches(time, values, start, stop, quiet=quiet, window_s=half, before=before)
    notes = [
        *(
            f"nothing was recorded from {time[end]:.6g} to {time[end + 1]:.6g} s; the decay goes on"
            for end in edges
            if start < time[end] < time[end + 1] < stop
        ),
        *(
            f"another decay of {other.legs} half cycles from {other.middle_s[0]:.6g} s is not used"
            for other in others[:3]
        ),
        *([f"{len(others) - 3} more decays are not used"] if len(others) > 3 else []),
        *(
            [f"{run.bridged} disturbed half cycle(s) inside the decay are kept"]
            if run.bridged
            else []
        ),
    ]
    return FreeDecay(start, stop, cuts, half, run.legs, notes)


def _beating(
    time: FloatArray,
    values: FloatArray,
    cycles: HalfCycles,
    half_period: float,
    place: str | Path,
    *,
    driven: bool,
    held: bool,
    decay_s: tuple[float, float],
) -> FreeDecay | None:
    """Find two free modes that beat; None where nothing beats, or one decays alone (`decay_s`).

    They are asked where the amplitude rises again, or is `held` up before it falls.

    Raises
    ------
    NotAnalysableError
        When one of the modes does not decay, but is `driven` (else that is no beat).
    """
    if len(cycles) < _MANY:
        return None
    half = np.diff(cycles.middle_s)
    steady = np.flatnonzero(np.abs(np.log(half / median(half))) < _STEADY)
    blocks = np.split(steady, np.flatnonzero(np.diff(steady) > _NODE) + 1)
    block = max(blocks, key=len)
    if len(block) < _MANY:
        return None
    first, last = int(block[0]), int(block[-1]) + 1
    smooth = running_median(cycles.swing[first:last], 2)[2:-2]
    rises = np.max(smooth - np.minimum.accumulate(smooth)) > 0.2 * np.max(smooth)
    if not (rises or held):
        return None
    start, stop = float(cycles.turn_time_s[first]), float(cycles.turn_time_s[last + 1])
    # Ends that are nearer than a period to a turning point of the beat are in it.
    start = float(time[0]) if start - time[0] < 2.0 * half_period else start
    stop = float(time[-1]) if time[-1] - stop < 2.0 * half_period else stop
    from pendpipe.effects.two_modes import two_modes

    inside = (time >= start) & (time <= stop)
    usual = float(median(half))
    modes = two_modes(time[inside], values[inside], usual, may_be_one=not driven, decay_s=decay_s)
    steadily = [mode for mode in modes or () if mode.driven]
    if modes is None or (steadily and not driven):
        return None
    if steadily:
        raise NotAnalysableError(
            place,
            f"a drive holds the amplitude up: the motion of {steadily[0].frequency.value:.4g} Hz"
            " does not decay",
            "a driven oscillation has no free decay",
        )
    each = " and ".join(
        f"{mode.frequency.value:.6g} Hz, which loses"
        f" {with_error(mode.loss.value, mode.loss.sd, '1/s', short=True)}"
        f" (Q = {math.pi * mode.frequency.value / mode.loss.value:.3g})"
        for mode in modes
    )
    quiet = 2.0 * cycles.step
    cuts = stretches(time, values, start, stop, quiet=quiet, window_s=half_period, before=_BY_HAND)
    return FreeDecay(
        start, stop, cuts, half_period, last - first, [f"two modes beat: {each}"], each
    )


def _falls(run: Run, least: float) -> bool:
    """Whether the turning points alone show the amplitude fall."""
    swing = run.swing
    third = max(1, len(swing) // 3)
    fall = float(np.mean(swing[:third]) - np.mean(swing[-third:]))
    scatter = float(np.std(np.diff(swing))) / np.sqrt(2.0)
    # The most that swings grow again after having been smaller, over blocks that calm noise.
    blocks = _BLOCKS if len(swing) >= 2 * _BLOCKS else 1
    edges = np.linspace(0, len(swing), blocks + 1).astype(np.int64)
    means = np.add.reduceat(swing, edges[:-1]) / np.diff(edges)
    rise = float(np.max(means - np.minimum.accumulate(means)))
    few = max(3.0 * scatter / np.sqrt(third), rise, 0.3 * least, 1e-4 * float(swing[0]))
    return bool(fall > few)


def _refuse_without_fall(
    place: str | Path,
    time: FloatArray,
    values: FloatArray,
    run: Run,
    least: float,
    *,
    falls: bool,
) -> None:
    """Refuse motion that does not decay, or that hardly exceeds noise and step."""
    swing = run.swing
    refuse_if(
        float(swing[:3].max()) < 3.0 * least and len(swing) < _MANY,
        place,
        f"the largest half cycle ({swing[:3].max():.2g}) hardly exceeds noise and step"
        f" ({least:.2g})",
        "record with a larger amplitude",
        NotAnalysableError,
    )
    if falls:
        return
    fall, sd = _fall_of_all(time, values, run.middle_s)
    refuse_if(
        fall < 4.0 * sd,
        place,
        f"the amplitude does not fall over {len(swing)} half cycles by more than its error"
        f", {with_error(100.0 * fall, 100.0 * sd, '%')}: the decay is too slow to be resolved",
        "record longer, unless something drives it",
        NotAnalysableError,
    )


def _fall_of_all(time: FloatArray, values: FloatArray, middle: FloatArray) -> tuple[float, float]:
    """Fall of the amplitude along a run, from all its readings, with its standard deviation.

    That of a straight line through the amplitudes of `_BLOCKS` parts, over the first.
    """
    from pendpipe.effects.two_modes import slow_amplitude

    phase = np.pi * np.interp(time, middle, np.arange(len(middle)))
    parts = np.searchsorted(time, np.linspace(middle[0], middle[-1], _BLOCKS + 1))
    amplitude = np.abs(slow_amplitude(phase, values, parts.tolist()))
    if len(amplitude) < _BLOCKS:
        return 0.0, 1.0
    place = np.linspace(0.0, 1.0, _BLOCKS)
    (slope, begun), matrix = np.polyfit(place, amplitude, 1, cov=True)
    return float(-slope / begun), float(np.sqrt(matrix[0, 0]) / begun)


def _stop(end: float, run: Run) -> float:
    """When a run of half cycles ends, within its piece of the record.

    A decay comes to rest by itself where its next swing would be none, or is not seen. One that
    rests sooner was caught: its last half cycle is the hand's, and may be as long as others.
    """
    half, cycles, swing = float(median(np.diff(run.middle_s[-4:]))), run.cycles, run.swing
    pauses = cycles.middle_s[run.last + 1 :] - run.middle_s[-1]
    follows = cycles.ending < _RISE * float(swing[-1]) + cycles.step
    fades = float(pauses[0]) > 1.5 * run.half_period_s if len(pauses) else follows
    turned = cycles.turn_time_s[run.last : run.last + 2].tolist()
    loss = float(median(np.abs(np.diff(swing[-_BLOCKS:])))) + cycles.step
    if fades and end - turned[1] > 1.5 * half and swing[-1] > _SPOILT * loss:
        return float(turned[0])
    # Half a period after its last middle the pendulum has turned and swung back once more.
    stop = float(run.middle_s[-1]) + (1.5 if fades else 0.5) * half
    return end if end - stop < 0.3 * half else stop


def _start(time: FloatArray, values: FloatArray, run: Run) -> float:
    """When a run begins: with its piece if that begins in the free motion, not in a hold or a pull.

    The first sample must then lie on the cosine that the first half cycles continue.
    """
    begin, start = float(time[0]), float(run.middle_s[0])
    half_period = float(run.middle_s[1]) - start
    turn = start - 0.5 * half_period
    late = turn - begin > 1.1 * half_period or begin - turn > 0.6 * half_period
    if run.before or run.first > 1 or late:
        return start
    if run.first == 0:
        return begin if begin > turn - 0.2 * half_period else start
    top, bottom = run.cycles.turn[run.first : run.first + 2].tolist()
    centre, amplitude = 0.5 * (top + bottom), 0.5 * (top - bottom)
    expected = centre + amplitude * math.cos(math.pi * (begin - turn) / half_period)
    return begin if abs(float(values[0]) - expected) < 0.15 * abs(amplitude) else start


def measure_recording(
    recording: Recording,
    place: str | Path,
    provenance: Mapping[str, Any] | None = None,
    *,
    length_m: float | None = None,
) -> tuple[TurningPoints, Recording]:
    """Find the free decay of a recording and measure its turning points.

    Parameters
    ----------
    recording
        In rad or m.
    place
        Named in messages.
    provenance
        Goes into the table's head.
    length_m
        Length of a simple pendulum, along whose swing an unknown unit is read.

    Returns
    -------
    points, part
        The turning points, with the cuts; and the part of the recording they are from.
    """
    decay = find_free_decay(recording, place)
    part = decay.of(recording)
    points = find_turning_points(part, place)
    if (told := as_pendulum(recording, points, length_m)) is not None:
        return measure_recording(told, place, provenance)
    notes = (*decay.notes, *points.notes)
    metadata = {key: str(value) for key, value in (provenance or {}).items() if value is not None}
    metadata = {**points.metadata, **metadata}
    points = replace(points, cuts=tuple(decay.cuts), beats=decay.beats, notes=notes)
    return replace(points, metadata=metadata), part
