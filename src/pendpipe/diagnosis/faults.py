"""Faults of the measurement within a search: one loop applies the finding that pays most.

One lost sample changes chi^2 more than most physics. So what can corrupt the fit is tested before
the catalogue is, and what only small residuals reveal after it (`Finder.last`). Each round makes
every test that the model is good enough for; the finding that gains most is applied, and the model
fitted again, until none pays. A finding that no longer pays with a better model goes the same way.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data, at_even_times
from pendpipe.diagnosis.detect import TESTS_SHARE
from pendpipe.diagnosis.forensics import FINDERS, RANDOM_TORQUE, Finder
from pendpipe.diagnosis.hypothesis import RANDOM, Hypothesis, Task, is_further, price_of_another
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import SETTLED, Fit, refine
from pendpipe.diagnosis.remainder import remainder_of
from pendpipe.diagnosis.result import Finding
from pendpipe.diagnosis.rivals import Rival
from pendpipe.dynamics.any_law import NoMotionError

_ANY: Final = 7
"""Tests that are made on any recording; others need uneven stamps, a tracked mark, or a misfit."""
_SHARE_OF_EACH: Final = TESTS_SHARE / _ANY
_MOST_ROUNDS: Final = 12


class Applied(NamedTuple):
    """A hypothesis with a finding applied, or withdrawn, what that gains, and what is said."""

    gain: float
    state: Hypothesis
    said: str


def correct(state: Hypothesis, task: Task) -> Hypothesis:
    """Correct what corrupts the fit: time stamps, lost samples, clipping, glitches."""
    if state.tested is state.fit:
        return state
    state = _with_findings(state, task, last=False)
    return replace(state, tested=state.fit)


def examine(state: Hypothesis, task: Task) -> Hypothesis:
    """Make the tests that need the final model: any misfit could look like what they find."""
    return _with_findings(state, task, last=True)


def _with_findings(state: Hypothesis, task: Task, *, last: bool) -> Hypothesis:
    """Apply the finding that pays most, and fit again, until none pays."""
    for _ in range(_MOST_ROUNDS if state.samples is not None else 0):
        found = [
            finding
            for finder in FINDERS
            if finder.last is last
            and (finder.repeats or _known(finder.name, state) is None)
            and finder.may_ask(state.data, state.fit)
            and (finding := _asked(finder, state, task)) is not None
        ]
        better = [after for each in found if (after := _applied(each, state, task)) is not None]
        if not better:
            return _measured_anew(found, state, task)
        _, state, said = max(better, key=lambda after: after.gain)
        task.progress(said)
    return state


def _asked(finder: Finder, state: Hypothesis, task: Task) -> Finding | None:
    """Make a test on the readings, with what its earlier finding left out or took off put back."""
    data, fit, noise = state.data, state.fit, state.noise
    samples = task.samples if finder.as_recorded else state.samples
    known = _known(finder.name, state)
    if known is not None:
        data = _without(known, data)
        noise = replace(noise, weight=data.weight)
        if data.used > state.data.used and any(effect.local for effect in fit.model.effects):
            # Without the readings about it an instant is known less well.
            fit = refine(fit.model, data, noise, fit.value, held=state.held)
            fit = with_better_instants(fit, data, noise, state.held)
    finding = finder.find(data, fit, noise, samples) if samples is not None else None
    if finding is None:
        return None
    p_value = min(finding.p_value / _SHARE_OF_EACH, 1.0)
    return replace(finding, p_value=p_value, after=known.after if known else len(state.steps))


def _known(name: str, state: Hypothesis) -> Finding | None:
    """Return an earlier finding of a test, unless it moved the times: those stay."""
    found = (each for each in state.faults if each.identifier == name)
    return next((each for each in found if each.time_s is None), None)


def _without(finding: Finding, data: Data) -> Data:
    """Put back what a finding left out, or took off."""
    count = len(data)
    if finding.mask is not None:
        data = replace(data, weight=np.where(finding.mask[:count], 1.0, data.weight))
    if finding.taken is not None:
        data = replace(data, values=data.values + finding.taken[:count])
    return data


def _with(finding: Finding, data: Data) -> Data:
    """Leave out, take off and give other times as a finding says."""
    if finding.mask is not None:
        data = data.masked((data.weight == 0.0) | finding.mask)
    if finding.taken is not None:
        data = replace(data, values=data.values - finding.taken)
    return data if finding.time_s is None else at_even_times(data, finding.time_s)


def _applied(finding: Finding, state: Hypothesis, task: Task) -> Applied | None:
    """Apply a finding that is significant and pays, withdraw one that does no more."""
    known, others = _known(finding.identifier, state), state.faults
    if finding.kind == "property" and known is None:
        return None
    data = state.data
    if known is not None:
        others = tuple(each for each in others if each is not known)
        data = _without(known, data)
    if finding.p_value > task.level or not _pays(finding, state):
        if known is None:
            return None
        said = f"{finding.identifier}: no longer needed with the final model"
        return Applied(math.inf, _settled(data, state, others), said)
    if finding.taken is None and finding.time_s is None:
        return _left_out(finding, state, _with(finding, data), others)
    data = _with(finding, data)
    before = replace(state.data.first(len(data)), weight=data.weight)
    try:
        fit, noise = _refined(data, state)
        gain = _refined(before, state)[0].chi2 - fit.chi2
    except NoMotionError:
        return None  # the model comes to rest before the corrected times
    if gain <= max(finding.price, SETTLED):
        return None
    if finding.kind == "note":
        after = replace(state, clock_notes=(*state.clock_notes, finding.summary))
    else:
        gains = gain + (known.delta_chi2 if known else 0.0)
        found = replace(finding, delta_chi2=finding.delta_chi2 + gains)
        after = replace(state, faults=(*others, found))
    after = _less(before.values - data.values, data, after)
    return Applied(gain, after.settle(fit, data, noise), finding.summary)


def _left_out(
    finding: Finding, state: Hypothesis, data: Data, others: tuple[Finding, ...]
) -> Applied | None:
    """Report a finding, and leave out the readings that are wrong."""
    said, faults = f"{finding.identifier}: {finding.summary}", (*others, finding)
    if not np.array_equal(data.weight, state.data.weight):
        return Applied(finding.delta_chi2, _settled(data, state, faults), said)
    if len(others) < len(state.faults):
        return None  # it is known
    return Applied(finding.delta_chi2, replace(state, faults=faults), said)


def _pays(finding: Finding, state: Hypothesis) -> bool:
    """Whether a random cause gains the price of a further name; other faults have none."""
    if finding.identifier not in RANDOM:
        return True
    names = sum(map(is_further, state.steps))
    names += sum(fault.identifier in RANDOM for fault in state.faults)
    return finding.delta_chi2 > price_of_another(names)


def _refined(data: Data, state: Hypothesis) -> tuple[Fit, Noise]:
    """Fit the model to other readings."""
    model, noise = state.fit.model, replace(state.noise, weight=data.weight)
    if data.time_s is not state.data.time_s:
        model = model.at_times(data.time_s)
    if len(data) < len(state.data):
        noise = state.noise.first(len(data), data.weight)
    return refine(model, data, noise, state.fit.value, held=state.held), noise


def _settled(data: Data, state: Hypothesis, faults: tuple[Finding, ...]) -> Hypothesis:
    """Return the hypothesis with other readings and findings, and its noise estimated anew."""
    fit, noise = _refined(data, state)
    return replace(state, faults=faults).settle(fit, data, noise)


def _less(taken: FloatArray, data: Data, state: Hypothesis) -> Hypothesis:
    """Take off the recorded readings, which later tests look at, what was taken off these."""
    samples = state.samples
    if samples is None or not np.any(taken):
        return state
    reading = (np.arange(len(samples)) - data.row) // (data.fold * data.every)
    values = samples.values - taken[np.clip(reading, 0, len(data) - 1)]
    return replace(state, samples=replace(samples, values=values))


def _measured_anew(found: list[Finding], state: Hypothesis, task: Task) -> Hypothesis:
    """Keep what the tests say of the last model.

    A test that found nothing counts by its p-value: the record is no less likely than that. What
    does not pay its price is no more than chance, whatever its p-value.
    """
    faults, quiet = list(state.faults), dict(state.quiet)
    for finding in found:
        known = _known(finding.identifier, state)
        if known is not None and finding.taken is None:
            faults[faults.index(known)] = finding
        elif known is None and finding.kind == "fault":
            least = finding.p_value if _pays(finding, state) else max(finding.p_value, task.level)
            quiet[finding.identifier] = min(least, quiet.get(finding.identifier, 1.0))
    return replace(state, faults=tuple(faults), quiet=quiet)


def random_torque(state: Hypothesis, rival: Rival, task: Task) -> Hypothesis | None:
    """Test whether random kicks explain more than an effect that leaves more than noise."""
    if state.samples is None or not remainder_of(rival.fit, state.data, state.noise).systematic:
        return None
    finding = _asked(RANDOM_TORQUE, state, task)
    if finding is None or finding.delta_chi2 < rival.gain - rival.charge:
        return None
    after = _applied(finding, state, task)
    if after is None:
        return None
    task.progress(after.said)
    return after.state
