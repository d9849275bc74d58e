"""Faults of the measurement within a search: tested, corrected and reported.

One lost sample changes chi^2 more than most physics. So faults that can corrupt the fit are
tested before the catalogue, and those that only small residuals reveal after it. Tests are
functions from a hypothesis to a better one; what is not significant leaves it as it is.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray
from pendpipe.diagnosis.data import Data, at_even_times
from pendpipe.diagnosis.detect import TESTS_SHARE
from pendpipe.diagnosis.forensics import TESTS, Test, corrections
from pendpipe.diagnosis.forensics.glitches import find_in_misfit
from pendpipe.diagnosis.hypothesis import (
    RANDOM,
    Fault,
    Hypothesis,
    Task,
    is_further,
    is_gross,
    loses_phase,
    price_of_another,
)
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import SETTLED, refine
from pendpipe.diagnosis.remainder import remainder_of
from pendpipe.diagnosis.result import Finding, Location
from pendpipe.diagnosis.rivals import Rival
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.estimate import Estimate

_TESTED_BEFORE: Final = ("clipping", "glitches")
_TESTED_AFTER: Final = (
    "missing-codes",
    "coarse-quantisation",
    "jitter",
    "coloured-noise",
    "broadband-drive",
)
_SHARE_OF_EACH: Final = TESTS_SHARE / (len(_TESTED_BEFORE) + len(_TESTED_AFTER))
_ROUNDS: Final = 3
_CLEAN_CHI2: Final = 1.3
"""Largest chi^2 per degree of freedom at which the fine tests are made."""
_IN_PHASE: Final = 0.3
"""Largest phase error in rad at which residuals reveal errors of the time stamps."""
SLIPS: Final = {"count-slips": 3.0, "clock-slips": _IN_PHASE}
"""Slips that are looked for, and the largest phase error in rad: the level hardly depends on it."""


def correct(state: Hypothesis, task: Task) -> Hypothesis:
    """Correct what would corrupt the fit: time stamps, lost samples, clipping, glitches."""
    if state.samples is None:
        return state
    for find in (_even_times, _lost_samples, _tracking, _slips):
        state = find(state, task)
    if is_gross(state.fit, state.data):
        return _examined("glitches", state, task, find_in_misfit)[0]
    for name in _TESTED_BEFORE:
        for _ in range(_ROUNDS):
            state, again = _examined(name, state, task)
            if not again:
                break
    return state


def examine(state: Hypothesis, task: Task) -> Hypothesis:
    """Make the tests that need a clean residual: a misfit could look like any fault."""
    if state.samples is None:
        return state
    # Dead bits show in the codes themselves, whatever the model.
    dead = state.samples.promised_step is not None
    tests: tuple[str, ...] = ("coarse-quantisation",) if dead else ()
    if not is_gross(state.fit, state.data) and state.fit.chi2 <= _CLEAN_CHI2 * state.data.used:
        tests = _TESTED_AFTER
    known = [fault.finding.identifier for fault in state.faults]
    for name in [name for name in tests if name not in known]:
        state, _ = _examined(name, state, task)
    return state


def _examined(
    name: str, state: Hypothesis, task: Task, test: Test | None = None
) -> tuple[Hypothesis, bool]:
    """Make one test and keep its finding; return whether to repeat it."""
    assert state.samples is not None
    finding = (test or TESTS[name])(state.data, state.fit, state.noise, state.samples)
    p_value = _global(finding)
    known = next((each for each in state.faults if each.finding.identifier == name), None)
    if finding.kind != "fault":
        return state, False
    pays = _pays(finding, state)
    if p_value > task.level or not pays:
        # What does not pay its price is no more than chance, whatever its p-value.
        least = p_value if pays else max(p_value, task.level)
        return (state if known else _unremarkable(state, name, least)), False
    task.progress(f"{name}: {finding.summary}")
    if known is None:
        known = Fault(finding, p_value, len(state.steps), finding.mask)
        state = replace(state, faults=(*state.faults, known))
    if finding.mask is None or not np.any(finding.mask & (state.data.weight > 0.0)):
        return state, False
    if known.mask is not None:
        more = replace(known, mask=known.mask[: len(state.data)] | finding.mask)
        state = replace(state, faults=_exchanged(state, known, more))
    return _refit(state, (state.data.weight == 0.0) | finding.mask), True


def _unremarkable(state: Hypothesis, name: str, p_value: float) -> Hypothesis:
    """Keep the p-value of a test that found nothing: the record is no less likely than that."""
    least = min(p_value, state.quiet.get(name, 1.0))
    return replace(state, quiet={**state.quiet, name: least})


def _exchanged(state: Hypothesis, known: Fault, *others: Fault) -> tuple[Fault, ...]:
    """Return the faults with others in the place of one."""
    at = next(number for number, each in enumerate(state.faults) if each is known)
    return (*state.faults[:at], *others, *state.faults[at + 1 :])


def examine_again(state: Hypothesis, task: Task) -> Hypothesis:
    """Repeat, with the final model, the tests that masked readings.

    A misfit of the motion (or another fault) displaces readings in a local fit. With complete
    physics in the model they may be as good as any.
    """
    if state.samples is None:
        return state
    for fault in [fault for fault in state.faults if fault.mask is not None]:
        if is_gross(state.fit, state.data):
            break
        state = _tested_again(fault, state, task)
    return state


def _tested_again(fault: Fault, state: Hypothesis, task: Task) -> Hypothesis:
    name, masked = fault.finding.identifier, state.data
    assert fault.mask is not None
    assert state.samples is not None
    others = (masked.weight == 0.0) & ~fault.mask[: len(masked)]
    whole = replace(masked, weight=np.where(others, 0.0, 1.0))
    noise, fit = replace(state.noise, weight=whole.weight), state.fit
    if any(effect.local for effect in fit.model.effects):
        # Without the readings about it an instant is known less well.
        fit = refine(fit.model, whole, noise, fit.value, held=state.held)
        fit = with_better_instants(fit, whole, noise, state.held)
    finding = TESTS[name](whole, fit, noise, state.samples)
    p_value = _global(finding)
    if p_value > task.level or finding.mask is None:
        task.progress(f"{name}: no longer needed with the final model")
        state = replace(
            state, faults=_exchanged(state, fault), quiet={**state.quiet, name: p_value}
        )
        return _refit(state, others)
    anew = Fault(finding, p_value, fault.after, finding.mask)
    state = replace(state, faults=_exchanged(state, fault, anew))
    if np.any((others | finding.mask) != (masked.weight == 0.0)):
        return _refit(state, others | finding.mask)
    return state


def _even_times(state: Hypothesis, task: Task) -> Hypothesis:
    """Use the times of a regular clock if the readings agree better with it."""
    if state.fit.max_phase_error_rad > _IN_PHASE or state.clock_notes:
        return state
    assert state.samples is not None
    finding = TESTS["time-stamps"](state.data, state.fit, state.noise, state.samples)
    if finding.time_s is None or finding.p_value > task.level * _SHARE_OF_EACH:
        return state
    data = at_even_times(state.data, finding.time_s)
    noise = white_noise(data, state.noise.white_rms)
    model = state.fit.model.at_times(data.time_s)
    fit = refine(model, data, noise, state.fit.value, held=state.held)
    if fit.chi2 / data.used > state.fit.chi2 / state.data.used:
        return state
    task.progress(finding.summary)
    noted = replace(state, clock_notes=(*state.clock_notes, finding.summary))
    return noted.settle(fit, data, noise)


def _lost_samples(state: Hypothesis, task: Task) -> Hypothesis:
    """Correct the times of the readings after lost samples."""
    data = state.data
    interval = data.interval_s / data.fold
    lost = corrections.find_lost_samples(data, state.fit)
    if not lost:
        return state
    time = data.time_s.copy()
    for each in lost:
        time[data.time_s >= each.time_s - 1e-9] += each.number * interval
    number = sum(each.number for each in lost)
    found = Finding(
        "dropped-samples",
        0.0,
        parameters={
            "d": Estimate(number * interval, 0.0, "s"),
            "samples": Estimate(float(number), 0.0, ""),
        },
        location=Location(time_s=(lost[0].time_s, lost[-1].time_s)),
        summary="samples were lost at "
        + ", ".join(f"{each.time_s:.6g} s ({each.number})" for each in lost[:6]),
    )
    rows = np.searchsorted(data.time_s, [each.time_s - 1e-9 for each in lost])
    weight = corrections.weight_beside(data, rows)
    corrected = replace(data, time_s=time, uniform=False, weight=weight)
    return corrected_by(state, task, corrected, found, least=0.1 * state.fit.chi2)


def _tracking(state: Hypothesis, task: Task) -> Hypothesis:
    """Take the wander of a tracked mark from the readings: more with each better model."""
    if loses_phase(state.fit) or task.samples is None:
        return state
    known = [f for f in state.faults if f.finding.identifier == corrections.TRACKING_NOISE]
    taken = known[0].finding.parameters["kappa"].value if known else 0.0
    corrected, finding = corrections.find_wander(state.data, state.fit, task.samples, taken)
    kappa = finding.parameters.get("kappa")
    if kappa is None or abs(kappa.value - taken) < kappa.sd:
        return state
    gained = sum(fault.finding.delta_chi2 for fault in known)
    after = corrected_by(state, task, corrected, replace(finding, delta_chi2=gained))
    if after is state:
        return state
    return replace(after, faults=tuple(each for each in after.faults if each not in known))


def _slips(state: Hypothesis, task: Task) -> Hypothesis:
    """Correct the values of an encoder that loses counts, or the times of a slipping clock.

    Where none were found they are looked for again once the squares left have halved.
    """
    # Slips that go on and on are as steady as noise, but never white.
    if state.fit.chi2 <= _CLEAN_CHI2 * state.data.used and not state.noise.coloured:
        return state
    assert state.samples is not None
    left = float(np.sum((state.data.residual(state.fit.at.reading) * state.data.weight) ** 2))
    for name, most in SLIPS.items():
        if (
            state.fit.max_phase_error_rad > most
            or any(fault.finding.identifier == name for fault in state.faults)
            or left > 0.5 * state.squares.get(name, math.inf)
        ):
            continue
        state = replace(state, squares={**state.squares, name: left})
        assert state.samples is not None
        corrected, finding = corrections.find_slips(name, state.data, state.fit, state.samples)
        state = corrected_by(state, task, corrected, finding)
    return state


def corrected_by(
    state: Hypothesis, task: Task, corrected: Data, finding: Finding, least: float = SETTLED
) -> Hypothesis:
    """Keep a significant finding and its correction if chi^2 falls by more than `least`."""
    model, p_value = state.fit.model, _global(finding)
    if p_value > task.level:
        return state
    if corrected.time_s is not state.data.time_s:
        model = model.at_times(corrected.time_s)
    noise = replace(state.noise, weight=corrected.weight)
    before = replace(state.data, weight=corrected.weight)
    try:
        fit = refine(model, corrected, noise, state.fit.value, held=state.held)
        as_it_was = refine(state.fit.model, before, noise, state.fit.value, held=state.held)
    except NoMotionError:
        return state  # the model comes to rest before the corrected times
    gain = as_it_was.chi2 - fit.chi2
    if gain <= least:
        return state
    task.progress(finding.summary)
    found = replace(finding, delta_chi2=finding.delta_chi2 + gain)
    # The later tests look at the values as they were recorded.
    samples = state.samples
    assert samples is not None
    row = np.searchsorted(state.data.time_s, samples.time_s, side="right") - 1
    lost = (state.data.values - corrected.values)[np.maximum(row, 0)]
    after = replace(
        state,
        samples=replace(samples, values=samples.values - lost),
        faults=(*state.faults, Fault(found, p_value, len(state.steps))),
    )
    return after.settle(fit, corrected, noise)


def random_torque(state: Hypothesis, rival: Rival, task: Task) -> Hypothesis | None:
    """Test whether random kicks explain more than an effect that leaves more than noise."""
    name = "broadband-drive"
    if state.samples is None or not remainder_of(rival.fit, state.data, state.noise).systematic:
        return None
    finding = TESTS[name](state.data, state.fit, state.noise, state.samples)
    p_value = _global(finding)
    if p_value > task.level or not _pays(finding, state):
        return None
    if finding.delta_chi2 < rival.gain - rival.charge:
        return None
    task.progress(f"{name}: {finding.summary}")
    return replace(state, faults=(*state.faults, Fault(finding, p_value, len(state.steps))))


def _pays(finding: Finding, state: Hypothesis) -> bool:
    """Whether a random cause gains the price of a further name; other faults have none."""
    if finding.identifier not in RANDOM:
        return True
    names = sum(map(is_further, state.steps))
    names += sum(fault.finding.identifier in RANDOM for fault in state.faults)
    return finding.delta_chi2 > price_of_another(names)


def _global(finding: Finding) -> float:
    """Return a global p-value, by the test's share of the level."""
    return min(finding.p_value / _SHARE_OF_EACH, 1.0)


def _refit(state: Hypothesis, out: BoolArray) -> Hypothesis:
    """Refit without the readings that are `out`, and with all others."""
    data = replace(state.data, weight=np.where(out, 0.0, 1.0))
    noise = replace(state.noise, weight=data.weight)
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.held)
    return state.settle(fit, data, noise)
