"""Faults of the measurement within a search: tested, corrected and reported.

One lost sample changes chi^2 more than most physics. So faults that can corrupt the fit are
tested before the catalogue, and those that only small residuals reveal after it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import BoolArray
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.data import Data, at_even_times
from pendpipe.diagnosis.detect import TESTS_SHARE
from pendpipe.diagnosis.evidence import Rival
from pendpipe.diagnosis.forensics import TESTS, Test, corrections
from pendpipe.diagnosis.forensics.glitches import find_in_misfit
from pendpipe.diagnosis.gauss_newton import SETTLED
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import TAPS, white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.remainder import remainder_of
from pendpipe.diagnosis.result import Finding, Location
from pendpipe.diagnosis.state import (
    Fault,
    State,
    is_further,
    is_gross,
    loses_phase,
    price_of_another,
)
from pendpipe.diagnosis.summary import COLOURED_NOISE
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
RANDOM: Final = ("jitter", "broadband-drive")
"""Faults that count as names: a random cause can take what a wrong name leaves."""
_SHARE_OF_EACH: Final = TESTS_SHARE / (len(_TESTED_BEFORE) + len(_TESTED_AFTER))
_ROUNDS: Final = 3
_FAR: Final = 8.0
"""Usual errors from which a reading at an end is wrong, where the tests can't tell."""
_CLEAN_CHI2: Final = 1.3
"""Largest chi^2 per degree of freedom at which the fine tests are made."""
_IN_PHASE: Final = 0.3
"""Largest phase error in rad at which residuals reveal errors of the time stamps."""
SLIPS: Final = {"count-slips": 3.0, "clock-slips": _IN_PHASE}
"""Slips that are looked for, and the largest phase error in rad: the level hardly depends on it."""


class Forensics:
    """The tests of the measurement, on one recording.

    Parameters
    ----------
    samples
        The readings as recorded.
    level
        The significance level (global p-value).
    """

    def __init__(self, samples: Samples, level: float) -> None:
        self.samples, self.level = samples, level
        self._recorded = samples
        self._quiet: dict[str, float] = {}
        self._left: dict[str, float] = {}
        self.clock_notes: list[str] = []

    def p_value(self, faults: Sequence[Fault]) -> float:
        """Return the smallest global p-value, of the reported faults and of the other tests.

        Properties of the record that do no harm (a coarse step at large amplitude) don't count,
        nor does the colour of its noise.
        """
        told = [fault.p_value for fault in faults if fault.finding.identifier != COLOURED_NOISE]
        return min([1.0, *self._quiet.values(), *told])

    def before(self, state: State, progress: Progress) -> None:
        """Correct what would corrupt the fit: time stamps, lost samples, clipping, glitches."""
        self._correct_time_stamps(state, progress)
        self._correct_lost_samples(state, progress)
        self._correct_tracking(state, progress)
        self._correct_slips(state, progress)
        if is_gross(state.fit, state.data):
            self._examine("glitches", state, progress, find_in_misfit)
            return
        for name in _TESTED_BEFORE:
            for _ in range(_ROUNDS):
                if not self._examine(name, state, progress):
                    break

    def after(self, state: State, progress: Progress) -> None:
        """Make the tests that need a clean residual: a misfit could look like any fault."""
        clean = not is_gross(state.fit, state.data)
        # Dead bits show in the codes themselves, whatever the model.
        dead = self.samples.promised_step is not None
        tests: tuple[str, ...] = ("coarse-quantisation",) if dead else ()
        if clean and state.fit.chi2 <= _CLEAN_CHI2 * state.data.used:
            tests = _TESTED_AFTER
        known = [fault.finding.identifier for fault in state.faults]
        for name in [name for name in tests if name not in known]:
            self._examine(name, state, progress)

    def _tested(self, name: str, state: State, test: Test | None = None) -> tuple[Finding, float]:
        """Make one test; return its finding and the global p-value."""
        made = test or TESTS[name]
        finding = made(state.data, state.fit, state.noise, self.samples)
        return finding, _global(finding)

    def _examine(
        self, name: str, state: State, progress: Progress, test: Test | None = None
    ) -> bool:
        """Make one test and keep its finding; return whether to repeat it."""
        finding, p_value = self._tested(name, state, test)
        known = next((each for each in state.faults if each.finding.identifier == name), None)
        if finding.kind != "fault":
            return False
        pays = _pays(finding, state)
        if p_value > self.level or not pays:
            if known is None:
                # What does not pay its price is no more than chance, whatever its p-value.
                least = p_value if pays else max(p_value, self.level)
                self._quiet[name] = min(least, self._quiet.get(name, 1.0))
            return False
        progress(f"{name}: {finding.summary}")
        if known is None:
            state.faults.append(Fault(finding, p_value, len(state.steps), finding.mask))
        if finding.mask is None or not np.any(finding.mask & (state.data.weight > 0.0)):
            return False
        if known is not None and known.mask is not None:
            more = replace(known, mask=known.mask[: len(state.data)] | finding.mask)
            state.faults[state.faults.index(known)] = more
        _refit(state, (state.data.weight == 0.0) | finding.mask)
        return True

    def again(self, state: State, progress: Progress) -> bool:
        """Repeat, with the final model, the tests that masked readings; return whether some return.

        A misfit of the motion (or another fault) displaces readings in a local fit. With complete
        physics in the model they may be as good as any.
        """
        before = state.data.weight
        for fault in [fault for fault in state.faults if fault.mask is not None]:
            if is_gross(state.fit, state.data):
                break
            self._test_again(fault, state, progress)
        return bool(np.any(state.data.weight > before))

    def _test_again(self, fault: Fault, state: State, progress: Progress) -> None:
        name, masked = fault.finding.identifier, state.data
        number = state.faults.index(fault)
        assert fault.mask is not None
        others = (masked.weight == 0.0) & ~fault.mask[: len(masked)]
        whole = replace(masked, weight=np.where(others, 0.0, 1.0))
        noise = replace(state.noise, weight=whole.weight)
        fit = state.fit
        if any(effect.local for effect in fit.model.effects):
            # Without the readings about it an instant is known less well.
            fit = refine(fit.model, whole, noise, fit.value, held=state.held)
            fit = with_better_instants(fit, whole, noise, state.held)
        finding = TESTS[name](whole, fit, noise, self.samples)
        p_value = _global(finding)
        if p_value > self.level or finding.mask is None:
            if _wrong_at_an_end(fault.mask[: len(masked)], state):
                return
            progress(f"{name}: no longer needed with the final model")
            del state.faults[number]
            self._quiet[name] = p_value
            _refit(state, others)
            return
        state.faults[number] = Fault(finding, p_value, fault.after, finding.mask)
        if np.any((others | finding.mask) != (masked.weight == 0.0)):
            _refit(state, others | finding.mask)

    def _correct_time_stamps(self, state: State, progress: Progress) -> None:
        """Use the times of a regular clock if the readings agree better with it."""
        if state.fit.max_phase_error_rad > _IN_PHASE or self.clock_notes:
            return
        finding = TESTS["time-stamps"](state.data, state.fit, state.noise, self.samples)
        if finding.time_s is None or finding.p_value > self.level * _SHARE_OF_EACH:
            return
        data = at_even_times(state.data, finding.time_s)
        noise = white_noise(data, state.noise.white_rms)
        model = state.fit.model.at_times(data.time_s)
        fit = refine(model, data, noise, state.fit.value, held=state.held)
        if fit.chi2 / data.used > state.fit.chi2 / state.data.used:
            return
        progress(finding.summary)
        self.clock_notes.append(finding.summary)
        state.settle(fit, data, noise)

    def _correct_lost_samples(self, state: State, progress: Progress) -> None:
        """Correct the times of the readings after lost samples."""
        data = state.data
        interval = data.interval_s / data.fold
        lost = corrections.find_lost_samples(data, state.fit)
        if not lost:
            return
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
        if self._correct(state, corrected, found, least=0.1 * state.fit.chi2):
            progress(f"{number} samples were lost without a gap")

    def _correct_tracking(self, state: State, progress: Progress) -> None:
        """Take the wander of a tracked mark from the readings: more with each better model."""
        if loses_phase(state.fit):
            return
        known = [f for f in state.faults if f.finding.identifier == corrections.TRACKING_NOISE]
        taken = known[0].finding.parameters["kappa"].value if known else 0.0
        corrected, finding = corrections.find_wander(state.data, state.fit, self._recorded, taken)
        kappa = finding.parameters.get("kappa")
        if kappa is None or abs(kappa.value - taken) < kappa.sd:
            return
        gained = sum(fault.finding.delta_chi2 for fault in known)
        if self._correct(state, corrected, replace(finding, delta_chi2=gained)):
            progress(finding.summary)
            state.faults = [fault for fault in state.faults if fault not in known]

    def _correct_slips(self, state: State, progress: Progress) -> None:
        """Correct the values of an encoder that loses counts, or the times of a slipping clock.

        Where none were found they are looked for again once the squares left have halved.
        """
        # Slips that go on and on are as steady as noise, but never white.
        clean = state.fit.chi2 <= _CLEAN_CHI2 * state.data.used and not state.noise.coloured
        left = float(np.sum((state.data.residual(state.fit.at.reading) * state.data.weight) ** 2))
        for name, most in SLIPS.items():
            if (
                clean
                or state.fit.max_phase_error_rad > most
                or any(fault.finding.identifier == name for fault in state.faults)
                or left > 0.5 * self._left.get(name, math.inf)
            ):
                continue
            self._left[name] = left
            corrected, finding = corrections.find_slips(name, state.data, state.fit, self.samples)
            if self._correct(state, corrected, finding):
                progress(finding.summary)

    def _correct(
        self, state: State, corrected: Data, finding: Finding, least: float = SETTLED
    ) -> bool:
        """Keep a significant finding and its correction if chi^2 falls by more than `least`."""
        model, p_value = state.fit.model, _global(finding)
        if p_value > self.level:
            return False
        if corrected.time_s is not state.data.time_s:
            model = model.at_times(corrected.time_s)
        noise = replace(state.noise, weight=corrected.weight)
        before = replace(state.data, weight=corrected.weight)
        try:
            fit = refine(model, corrected, noise, state.fit.value, held=state.held)
            as_it_was = refine(state.fit.model, before, noise, state.fit.value, held=state.held)
        except NoMotionError:
            return False  # the model comes to rest before the corrected times
        gain = as_it_was.chi2 - fit.chi2
        if gain <= least:
            return False
        found = replace(finding, delta_chi2=finding.delta_chi2 + gain)
        state.faults.append(Fault(found, p_value, len(state.steps)))
        # The later tests look at the values as they were recorded.
        row = np.searchsorted(state.data.time_s, self.samples.time_s, side="right") - 1
        lost = (state.data.values - corrected.values)[np.maximum(row, 0)]
        self.samples = replace(self.samples, values=self.samples.values - lost)
        state.settle(fit, corrected, noise)
        return True

    def kicked_at_random(self, state: State, rival: Rival, progress: Progress) -> bool:
        """Test whether random kicks explain more than an effect that leaves more than noise."""
        name = "broadband-drive"
        if not remainder_of(rival.fit, state.data, state.noise).systematic:
            return False
        finding, p_value = self._tested(name, state)
        if p_value > self.level or not _pays(finding, state):
            return False
        if finding.delta_chi2 < rival.gain - rival.charge:
            return False
        progress(f"{name}: {finding.summary}")
        state.faults.append(Fault(finding, p_value, len(state.steps)))
        return True


def _pays(finding: Finding, state: State) -> bool:
    """Whether a random cause gains the price of a further name; other faults have none."""
    if finding.identifier not in RANDOM:
        return True
    names = sum(map(is_further, state.steps))
    names += sum(fault.finding.identifier in RANDOM for fault in state.faults)
    return finding.delta_chi2 > price_of_another(names)


def _global(finding: Finding) -> float:
    """Return a global p-value, by the test's share of the level."""
    return min(finding.p_value / _SHARE_OF_EACH, 1.0)


def _wrong_at_an_end(mask: BoolArray, state: State) -> bool:
    """Whether masked readings lie near an end, and far from the model that was fitted without."""
    rows, count = np.flatnonzero(mask), len(mask)
    error = np.abs(state.data.residual(state.fit.at.reading))
    usual = float(np.sqrt(np.mean(error[state.data.weight > 0.0] ** 2)))
    near = np.minimum(rows, count - 1 - rows) < TAPS
    return bool(np.all(near & (error[rows] > _FAR * usual)))


def _refit(state: State, out: BoolArray) -> None:
    """Refit without the readings that are `out`, and with all others."""
    data = replace(state.data, weight=np.where(out, 0.0, 1.0))
    noise = replace(state.noise, weight=data.weight)
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.held)
    state.settle(fit, data, noise)
