"""How a diagnosis begins, and that it is the same in any unit."""

import functools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.free_decay import measure_recording
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.hypothesis import first_noise
from pendpipe.diagnosis.refine import alignment, anchored, refine, unwrapped
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.eq8 import OMEGA, START, TIME, B, Restoring
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.estimate import Estimate
from pendpipe.recording import Quantity, Recording

from ..effects.integration import swung
from .records import (
    INTERVAL_S,
    TIME_S,
    TRUTH,
    beginning_of,
    null_fit,
    prepared,
    pulled,
    recording,
    white,
    with_effects,
)

# A diagnosis begins with the fit: sin x is presumed and fitted, and no finding.

LARGE = np.array(TRUTH)
LARGE[START] = 1.2 * np.sign(TRUTH[START])


def swinging(restoring: Restoring) -> FloatArray:
    a, b, c, share, omega, angle, start_s, offset = LARGE.tolist()
    law = Eq8(omega, a, share * b, (1.0 - share) * b, c, restoring)
    return sample(law, Release(start_s, angle, offset), TIME_S)


@pytest.mark.slow
def test_a_diagnosis_begins_with_the_fit_that_is_printed() -> None:
    record = recording(swinging("sine"), 4)
    points, part = measure_recording(record, "the test")
    fit, begun = fit_recording(part, points=points), beginning_of(record)
    assert fit.restoring == begun.model.restoring == "sine"
    noise = first_noise(begun)
    there = refine(begun.model, begun.data, noise, begun.value, rounds=0).chi2
    best = refine(begun.model, begun.data, noise, begun.value, held=begun.held)
    # Other than the fit, the diagnosis has a prior on the share of b: it has yet to move a little.
    assert there - best.chi2 < 1.0
    assert begun.value[OMEGA] == pytest.approx(LARGE[OMEGA], rel=1e-5)
    answer = diagnose_recording(record).to_dict()
    assert answer["baseline"]["parameters"] == {
        name: each.as_json() for name, each in fit.parameters.items()
    }
    for name in ("noise_rms_rad", "residual_rms_rad", "chi2_per_dof", "fit_p_value"):
        assert answer["baseline"][name] == getattr(fit, name)
    assert answer["noise_rms_rad"] == fit.noise_rms_rad
    assert answer["restoring"] == "sine"
    (presumed,) = answer["effects"]
    assert presumed["id"] == "circular-error"
    assert presumed["presumed"]
    assert presumed["delta_chi2"] > 1e4
    assert answer["verdict"] == "consistent"


@pytest.mark.slow
def test_a_short_record_of_a_pendulum_is_a_pendulums_first() -> None:
    """The linear law keeps the phase; a cubic torque takes up what a second plane changes too."""
    time_s, values = TIME_S[:600], np.append(TRUTH, [1.0, 6e-3, 2e-3, 0.01])
    values[[0, 1, 2, 3, START]] = 0.0, 0.02, 0.0, 0.0, 0.26
    effects = by_identifier("circular-error"), by_identifier("plane-coupling")
    readings = Model(time_s, INTERVAL_S, effects).reading(values) + white(1, 600, 1.4e-3)
    found = diagnose_recording(Recording(time_s, readings, "angle_rad"))
    presumed = found.effects[0]
    assert (presumed.identifier, presumed.presumed) == ("circular-error", True)
    assert "cubic-stiffness" not in {each.identifier for each in found.missing}


@pytest.mark.slow
def test_time_stamps_are_corrected_after_sin_x_was_fitted_to_them() -> None:
    """1511 readings at even times, stamped late at random: a regular clock keeps 1500 of them."""
    time_s, values = INTERVAL_S * np.arange(1511), np.append(TRUTH, 1.0)
    values[START] = 0.3
    readings = Model(time_s, INTERVAL_S, (by_identifier("circular-error"),)).reading(values)
    late_s = 0.1 * INTERVAL_S * np.random.default_rng(2).random(1511)
    found = diagnose_recording(Recording(time_s + late_s, readings + white(2, 1511), "angle_rad"))
    assert len(found.search.data) == 1500
    assert found.effects[0].identifier == "circular-error"
    assert any("the readings are not" in note for note in found.search.notes.values())


@pytest.mark.slow
def test_at_the_nodes_of_a_beat_no_rows_are_lost() -> None:
    """There the phase turns by half a cycle; the modes are as large to 1 %, and read to 1."""
    time_s = np.round(np.arange(2070) * 0.0507, 3)
    low, high = (np.cos(2.0 * np.pi * f * time_s) for f in (0.70823, 0.7351))
    values = np.round(
        500.0 + 107.0 * np.exp(-0.0236 * time_s) * (low + 0.99 * high) + white(1, len(time_s), 0.3)
    )
    record = Recording(time_s, values, "reading", metadata={"unit": "1"}, resolution=1.0)
    found = diagnose_recording(record)
    assert found.effects[0].identifier == "second-mode"
    assert "dropped-samples" not in {each.identifier for each in found.effects}
    other = found.effects[0].parameters["f_2"].value
    assert other == pytest.approx(0.7351, abs=3e-5)
    # Curves without a name share the small misfit of rounding to 1, and widen what is quoted.
    quotes = found.improved.parameters["frequency"]
    assert abs(quotes.value - 0.70823) < 2.0 * quotes.sd < 0.5 * (0.7351 - 0.70823)
    # Here the fit prints no T0, so that none is compared.
    assert re.match(r"T0 [\d.]+\(\d+\) s, other mode 1\.360\d*\(\d+\) s", found.summary.quote)
    assert found.summary.consequence[0].quantity == "a"


@pytest.mark.slow
def test_two_coupled_pendulums_are_two_modes_at_their_frequencies() -> None:
    # x'' = -omega^2 x - kappa (x - z) and z'' = -omega^2 z - kappa (z - x), released at x alone.
    omega, kappa, loss = 4.5, 0.9, 0.015
    time_s = np.arange(0.0, 80.0, 0.05)
    low, high = omega, np.sqrt(omega**2 + 2.0 * kappa)
    envelope = 0.06 * np.exp(-loss * time_s)
    angle_rad = envelope * (np.cos(low * time_s) + np.cos(high * time_s))
    found = diagnose_recording(
        Recording(time_s, angle_rad + white(4, len(time_s), 3e-4), "angle_rad")
    )
    assert [each.identifier for each in found.effects] == ["second-mode"]
    assert found.effects[0].probability > 0.95
    own, other = (
        found.improved.parameters["frequency"],
        found.effects[0].parameters["f_2"],
    )
    modes = sorted((2.0 * np.pi * each.value, 2.0 * np.pi * each.sd) for each in (own, other))
    for (value, sd), truth in zip(modes, (low, high), strict=True):
        # Damping lowers a frequency by loss^2/(2 omega).
        assert value == pytest.approx(truth, abs=4.0 * sd + loss**2 / (2.0 * truth))
    assert found.improved.chi2_per_dof == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_a_pendulum_seen_from_the_side_shows_sin_x_and_no_bent_sensor() -> None:
    """In pixels, 300 of which are its length."""
    time_s = np.arange(0.0, 40.0, 0.02)
    angle = swung(time_s, 0.4, 4.1, 0.004, 0.015)[0]
    values = 300.0 * (0.1 + np.sin(angle) + white(3, len(time_s), 1e-3))
    answer = diagnose_recording(Recording(time_s, values, "reading", metadata={"unit": "pixels"}))
    names = [each.identifier for each in answer.effects]
    assert names[0] == "circular-error"
    assert not {"cubic-stiffness", "sensor-cubic"} & set(names)
    curvature = answer.effects[0].parameters["inverse_length_squared"]
    assert curvature.value**-0.5 == pytest.approx(300.0, rel=0.02)


@pytest.mark.parametrize("torque", [np.sin, float])
def test_a_brake_leaves_few_cycles_that_show_sin_x(torque: type) -> None:
    # Q = 10: the misfit is a line as wide as the loss, which is no noise of the readings.
    time_s = np.arange(0.0, 6.0, 0.01)
    angle = swung(time_s, 0.42, 4.6, 0.23, torque=torque)[0]
    answer = diagnose_recording(Recording(time_s, angle + white(1, len(time_s), 1e-3), "angle_rad"))
    assert [each.identifier for each in answer.effects] == ["circular-error"] * (torque is np.sin)


# Readings against a model, along the motion: amplitude and phase, turns counted.


@settings(max_examples=40)
@given(st.floats(-0.01, 0.01), st.floats(-2e-4, 2e-4), st.floats(-0.03, 0.03), st.floats(0.0, 1e-3))
def test_small_residuals_hide_neither_phase_nor_amplitude(
    late_s: float, detuning: float, damping: float, noise_rad: float
) -> None:
    """Where a model is called in phase, a fit cycle by cycle says so as well."""
    fit, _, _ = null_fit()
    other = TRUTH.copy()
    other[TIME] += late_s
    other[OMEGA] *= 1.0 + detuning
    other[B] *= 1.0 + damping
    readings = Model(TIME_S, INTERVAL_S).reading(other) + white(1, rms=noise_rad)
    data, _ = prepared(readings)
    plain, slip = unwrapped(data, fit.at)
    found = alignment(replace(data, noise_rms=0.0), fit.at, plain)
    if slip == 0.0:
        assert np.max(np.abs(found.phase)) < 0.1
        assert np.max(np.abs(found.log_ratio)) < 0.1


def test_a_whole_turn_is_no_agreement() -> None:
    """Readings of the same motion a cycle later are a turn behind, where turns are counted."""
    fit, data, _ = null_fit()
    data = replace(data, anchor=anchored(data, fit.at))
    assert unwrapped(data, fit.at)[1] < 0.01
    when, turned = data.anchor or (0.0, 0.0)
    behind = replace(data, anchor=(when, turned - 2.0 * math.pi))
    assert abs(unwrapped(behind, fit.at)[1] - 2.0 * math.pi) < 0.01


# Fit and diagnosis say the same of a decay in other units, seen later, or in a mirror.
#
# Powers of two are exact in binary numbers, so that little but the search itself could differ.

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


def same(
    one: Mapping[str, Estimate], other: Mapping[str, Estimate], view: View, errors: float = 1e-3
) -> None:
    """Values and errors, up to the sign and to what is counted from the first second."""
    assert set(one) == set(other)
    for name, estimate in one.items():
        factor = view.factor(estimate.unit)
        value = abs(estimate.value)
        if name == "time":
            assert other[name].value == pytest.approx(value * factor + view.later_s, rel=1e-4)
        elif name != "phase":
            off = errors * estimate.sd * factor
            assert abs(other[name].value) == pytest.approx(value * factor, 1e-3, abs=off), name
        if name != "phase" or not view.later_s:
            # A spread that turning points ask for: they are the same to 1e-3 (`fits_agree`).
            assert other[name].sd == pytest.approx(estimate.sd * factor, rel=errors), name


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
    left = size * first.improved.residual_rms_rad
    assert second.improved.residual_rms_rad == pytest.approx(left, rel=1e-5)
    # Averages: the errors go as the root of probabilities, which are the same to 0.02 of 0.2.
    same(first.improved.parameters, second.improved.parameters, change, errors=0.05)
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "view"),
    [
        ("circular-error", "slower and later"),
        ("equilibrium-step", "faster and mirrored"),
        ("tone-pickup", "later"),
        ("a magnet", "faster and mirrored"),
    ],
)
def test_a_diagnosis_of_angles_is_the_same_diagnosis(name: str, view: str) -> None:
    diagnoses_agree(name, View(), VIEWS[view])


@pytest.mark.slow
def test_a_diagnosis_of_displacements_is_the_same_diagnosis() -> None:
    diagnoses_agree("frequency-drift", METRES["as it is"], METRES["slow"])
