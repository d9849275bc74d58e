"""Faults of the measurement within a search: one loop applies the finding that pays most.

One lost sample changes chi^2 more than most physics. So what can corrupt the fit is tested before
the catalogue is, and what only small residuals reveal after it (`Finder.last`). Each round makes
every test that the model is good enough for; the finding that gains most is applied, and the model
fitted again, until none pays. A finding that no longer pays with a better model goes the same way.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data, at_even_times
from pendpipe.diagnosis.detect import TESTS_SHARE
from pendpipe.diagnosis.forensics import FINDERS, Finder
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.found import Finding
from pendpipe.diagnosis.hypothesis import RANDOM, Hypothesis, Task, is_further
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import SETTLED, Fit, refine
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.score import price_of_another

_SHARE_OF_EACH: Final = TESTS_SHARE / len(FINDERS)
_MOST_ROUNDS: Final = 12
"""Findings that are applied, and put back, of a record: about as many as there are tests."""


def examine(state: Hypothesis, task: Task) -> Hypothesis:
    """Make the tests that need the final model: any misfit could look like what they find."""
    again = {finder.name for finder in FINDERS if finder.last}
    notes = {name: said for name, said in state.notes.items() if name not in again}
    return correct(replace(state, notes=notes), task, last=True)


def correct(state: Hypothesis, task: Task, *, last: bool = False) -> Hypothesis:
    """Correct what corrupts the fit: time stamps, lost samples, clipping, glitches.

    The finding that pays most is applied, and the model fitted again, until none pays.
    """
    for _ in range(_MOST_ROUNDS if state.samples is not None else 0):
        evidence = _evidence(state)
        found = [
            finding
            for finder in FINDERS
            if finder.last is last
            and (finder.repeats or _known(finder.name, state) is None)
            and finder.may_ask(evidence)
            and (finding := _asked(finder, evidence, state)) is not None
        ]
        better = [after for each in found if (after := _applied(each, state, task)) is not None]
        if not better:
            return _measured_anew(found, state, task)
        state = max(better, key=lambda after: after.lower)
        task.progress(state.words)
    return state


def _evidence(state: Hypothesis) -> Evidence:
    assert state.samples is not None
    return Evidence(state.data, state.fit, state.noise, state.samples)


def _asked(finder: Finder, evidence: Evidence, state: Hypothesis) -> Finding | None:
    """Make a test on the readings, with what its earlier finding left out or took off put back."""
    known = _known(finder.name, state)
    if known is not None:
        before, held = _put_back(known, state), state.held
        fit, data, noise = state.fit, before.data, replace(state.noise, weight=before.data.weight)
        if data.used > state.data.used and any(effect.local for effect in fit.model.effects):
            # Without the readings about it an instant is known less well.
            fit = refine(fit.model, data, noise, fit.value, held=held)
            fit = with_better_instants(fit, data, noise, held)
        evidence = replace(_evidence(before), fit=fit, noise=noise)
    finding = finder.find(evidence)
    if finding is None:
        return None
    p_value = min(finding.p_value / _SHARE_OF_EACH, 1.0)
    return replace(finding, p_value=p_value, after=known.after if known else len(state.steps))


def _known(name: str, state: Hypothesis) -> Finding | None:
    """Return an earlier finding of a test, unless it moved the times: those stay."""
    found = (each for each in state.faults if each.identifier == name)
    return next((each for each in found if each.time_s is None), None)


def _put_back(finding: Finding, state: Hypothesis) -> Hypothesis:
    """Withdraw a finding, and put back what it left out or took off."""
    data, faults = state.data, tuple(each for each in state.faults if each is not finding)
    if finding.mask is not None:
        weight = np.where(finding.mask[: len(data)], 1.0, data.weight)
        data = replace(data, weight=weight)
    state = replace(state, data=data, faults=faults)
    return state if finding.taken is None else _less(-finding.taken[: len(data)], state)


def _with(finding: Finding, state: Hypothesis) -> Hypothesis:
    """Leave out, take off and give other times as a finding says."""
    state = state if finding.taken is None else _less(finding.taken, state)
    data = state.data
    if finding.mask is not None:
        data = data.masked((data.weight == 0.0) | finding.mask)
    if finding.time_s is not None:
        data = at_even_times(data, finding.time_s)
    return replace(state, data=data)


def _less(taken: FloatArray, state: Hypothesis) -> Hypothesis:
    """Take something off the readings, and off those that were recorded, which tests look at."""
    data, samples = state.data, state.samples
    if samples is not None:
        reading = (np.arange(len(samples)) - data.row) // (data.fold * data.every)
        values = samples.values - taken[np.clip(reading, 0, len(taken) - 1)]
        samples = replace(samples, values=values)
    return replace(state, data=replace(data, values=data.values - taken), samples=samples)


def _applied(finding: Finding, state: Hypothesis, task: Task) -> Hypothesis | None:
    """Apply a finding that is significant and pays, withdraw one that does no more."""
    known = _known(finding.identifier, state)
    if finding.kind == "property" and known is None:
        return None
    before = state if known is None else _put_back(known, state)
    if finding.p_value > task.level or not _pays(finding, state):
        if known is None:
            return None
        words = f"{finding.identifier}: no longer needed with the final model"
        return replace(_settled(before, state), lower=math.inf, words=words)
    after = _with(finding, before)
    if finding.taken is None and finding.time_s is None:
        after = replace(after, faults=(*before.faults, finding))
        if not np.array_equal(after.data.weight, state.data.weight):
            after = _settled(after, state)
        elif known is not None:
            return None
        words = f"{finding.identifier}: {finding.summary}"
        return replace(after, lower=finding.delta_chi2, words=words)
    data = after.data
    same = replace(state.data.first(len(data)), weight=data.weight)
    try:
        fit, noise = _refined(data, state)
        gain = _refined(same, state)[0].chi2 - fit.chi2
    except NoMotionError:
        return None  # the model comes to rest before the corrected times
    if gain <= max(finding.price, SETTLED):
        return None
    if finding.kind == "note":
        after = replace(after, notes={**state.notes, finding.identifier: finding.summary})
    else:
        gains = gain + (known.delta_chi2 if known else 0.0)
        found = replace(finding, delta_chi2=finding.delta_chi2 + gains)
        after = replace(after, faults=(*after.faults, found))
    return replace(after.settle(fit, data, noise), lower=gain, words=finding.summary)


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


def _settled(after: Hypothesis, state: Hypothesis) -> Hypothesis:
    """Return a hypothesis of other readings, fitted, and its noise estimated anew."""
    fit, noise = _refined(after.data, state)
    return after.settle(fit, after.data, noise)


def _measured_anew(found: list[Finding], state: Hypothesis, task: Task) -> Hypothesis:
    """Keep what the tests say of the last model.

    A test that found nothing counts by its p-value: the record is no less likely than that. What
    does not pay its price is no more than chance, whatever its p-value.
    """
    faults, quiet, notes = list(state.faults), dict(state.quiet), dict(state.notes)
    for finding in found:
        known = _known(finding.identifier, state)
        if known is not None and finding.taken is None:
            faults[faults.index(known)] = finding
        elif known is None and finding.kind == "fault":
            least = finding.p_value if _pays(finding, state) else max(finding.p_value, task.level)
            quiet[finding.identifier] = min(least, quiet.get(finding.identifier, 1.0))
        elif finding.kind == "note" and finding.time_s is None:
            notes[finding.identifier] = finding.summary
    return replace(state, faults=tuple(faults), quiet=quiet, notes=notes)
