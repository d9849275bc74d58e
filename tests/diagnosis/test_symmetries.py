"""Fit and diagnosis say the same of a decay in other units, seen later, or in a mirror.

Powers of two are exact in binary numbers, so that little but the search itself could differ.
"""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest

from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.fit.result import FitResult
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.estimate import Estimate
from pendpipe.recording import Quantity, Recording

from .records import pulled, recording, with_effects

NAMES = ("circular-error", "equilibrium-step", "frequency-drift", "tone-pickup")


@dataclass(frozen=True)
class View:
    """How the same decay is written down."""

    slower: float = 1.0
    larger: float = 1.0
    later_s: float = 0.0
    quantity: Quantity = "angle_rad"

    def of(self, seen: Recording) -> Recording:
        return Recording(
            self.slower * seen.time_s + self.later_s, self.larger * seen.values, self.quantity
        )

    def factor(self, unit: str) -> float:
        """By how much a number of a unit is larger; an angle stays one."""
        found = 1.0
        above, _, below = unit.partition("/")
        for side, sign in ((above, 1), (below, -1)):
            for name, power in re.findall(r"([A-Za-z]+)(?:\^(\d+))?", side):
                of = {"s": self.slower, "Hz": 1.0 / self.slower, "m": abs(self.larger)}
                found *= of.get(name, 1.0) ** (sign * int(power or 1))
        return found


VIEWS = {
    "faster": View(slower=0.125),
    "slower": View(slower=8.0),
    "later": View(later_s=1024.0),
    "mirrored": View(larger=-1.0),
    "faster and mirrored": View(slower=0.125, larger=-1.0),
    "slower and later": View(slower=8.0, later_s=1024.0),
}
METRES = {
    name: View(quantity="displacement_m", larger=larger, slower=slower)
    for name, larger, slower in (
        ("as it is", 1.0, 1.0),
        ("small", 2.0**-5, 1.0),
        ("slow", 64.0, 8.0),
    )
}


@functools.cache
def seen(name: str) -> Recording:
    return recording(pulled() if name == "a magnet" else with_effects(name), 1)


def same(one: Mapping[str, Estimate], other: Mapping[str, Estimate], view: View) -> None:
    """Values and errors, up to the sign and to what is counted from the first second."""
    assert set(one) == set(other)
    for name, estimate in one.items():
        factor = view.factor(estimate.unit)
        value = abs(estimate.value)
        if name == "time":
            assert other[name].value == pytest.approx(value * factor + view.later_s, rel=1e-4)
        elif name != "phase":
            assert abs(other[name].value) == pytest.approx(value * factor, rel=1e-3), name
        if name != "phase" or not view.later_s:
            assert other[name].sd == pytest.approx(estimate.sd * factor, rel=1e-3), name


@functools.cache
def fit_of(name: str, view: View) -> FitResult:
    return fit_recording(view.of(seen(name)))


@functools.cache
def diagnosis_of(name: str, view: View) -> Diagnosis:
    return diagnose_recording(view.of(seen(name)))


def fits_agree(name: str, one: View, other: View) -> None:
    """The fit by the first view is that by the other: `one` has the units of angles or metres."""
    first, second = fit_of(name, one), fit_of(name, other)
    change = View(other.slower, other.larger / one.larger, other.later_s)
    same(first.parameters, second.parameters, change)
    assert (second.light, second.restoring, second.method) == (
        first.light,
        first.restoring,
        first.method,
    )
    assert second.chi2_per_dof == pytest.approx(first.chi2_per_dof, rel=1e-5)
    size = abs(change.larger)
    # Of the half cycles, whose places are locked to a tenth of a radian from wherever they begin.
    assert second.noise_rms_rad == pytest.approx(size * first.noise_rms_rad, rel=1e-5)
    assert second.residual_rms_rad == pytest.approx(size * first.residual_rms_rad, rel=1e-6)
    assert len(first.decrement_check) == len(second.decrement_check) > 0
    for before, after in zip(first.decrement_check, second.decrement_check, strict=True):
        rate = 1.0 / change.slower
        assert after.amplitude_rad == pytest.approx(size * before.amplitude_rad, rel=1e-4)
        assert after.fitted == pytest.approx(rate * before.fitted, rel=1e-3)
        assert after.seen == pytest.approx(rate * before.seen, rel=1e-3)
        assert after.seen_sd == pytest.approx(rate * before.seen_sd, rel=1e-3)
        # A ratio of variances, in any units.
        assert after.scatter == pytest.approx(before.scatter, rel=1e-3)


def diagnoses_agree(name: str, one: View, other: View) -> None:
    first, second = diagnosis_of(name, one), diagnosis_of(name, other)
    change = View(other.slower, other.larger / one.larger, other.later_s)
    size = abs(change.larger)
    assert second.verdict == first.verdict
    assert second.p_value == pytest.approx(first.p_value, rel=0.01)
    assert second.noise_rms_rad == pytest.approx(size * first.noise_rms_rad, rel=1e-4)
    left = size * first.unexplained_rms_rad
    assert second.unexplained_rms_rad == pytest.approx(left, rel=1e-5)
    same(first.improved.parameters, second.improved.parameters, change)
    assert [each.identifier for each in second.effects] == [
        each.identifier for each in first.effects
    ]
    for found, again in zip(first.effects, second.effects, strict=True):
        assert again.delta_chi2 == pytest.approx(found.delta_chi2, rel=1e-4)
        # A search ends where the next step gains some hundredths of chi^2: as much of the odds.
        assert again.probability == pytest.approx(found.probability, abs=0.02)
        assert dict(again.indistinguishable) == pytest.approx(
            dict(found.indistinguishable), abs=0.02
        )
        same(found.parameters, again.parameters, change)
        if found.location.time_s is not None:
            when = change.slower * np.array(found.location.time_s) + change.later_s
            assert again.location.time_s == pytest.approx(when, rel=1e-4)
    if first.held_out is not None:
        assert second.held_out.better == first.held_out.better
        gain = first.held_out.after - first.held_out.before
        assert second.held_out.after - second.held_out.before == pytest.approx(gain, rel=1e-3)
        rms = size * first.held_out.rms_after
        assert second.held_out.rms_after == pytest.approx(rms, rel=1e-3)


@pytest.mark.parametrize("view", ["faster", "slower", "later", "mirrored"])
@pytest.mark.parametrize("name", [*NAMES, "a magnet"])
def test_a_fit_of_angles_is_the_same_fit(name: str, view: str) -> None:
    fits_agree(name, View(), VIEWS[view])


@pytest.mark.parametrize("view", ["small", "slow"])
@pytest.mark.parametrize("name", ["equilibrium-step", "frequency-drift"])
def test_a_fit_of_displacements_is_the_same_fit(name: str, view: str) -> None:
    fits_agree(name, METRES["as it is"], METRES[view])


@pytest.mark.parametrize(
    ("name", "view"),
    [
        ("circular-error", "slower and later"),
        ("equilibrium-step", "slower and later"),
        ("equilibrium-step", "faster and mirrored"),
        ("frequency-drift", "faster and mirrored"),
        ("tone-pickup", "later"),
        ("a magnet", "faster and mirrored"),
    ],
)
def test_a_diagnosis_of_angles_is_the_same_diagnosis(name: str, view: str) -> None:
    diagnoses_agree(name, View(), VIEWS[view])


@pytest.mark.parametrize("name", ["equilibrium-step", "frequency-drift"])
def test_a_diagnosis_of_displacements_is_the_same_diagnosis(name: str) -> None:
    diagnoses_agree(name, METRES["as it is"], METRES["slow"])
