"""A diagnosis from a recording to its verdict."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

import pendpipe as pp
from pendpipe.analysis.free_decay import measure_recording
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import SmallSwings, small_swings
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.eq8 import A, B, C, Restoring
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model, pendulum_of
from pendpipe.errors import InputError
from pendpipe.recording import Recording
from pendpipe.simulation.model import read_model, simulate

from .faults import rounded
from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    LATER_S,
    LINEAR,
    TIME_S,
    TRUTH,
    VALUES,
    diagnosed,
    null_fit,
    other_engine,
    prepared,
    recording,
    white,
    with_effects,
)

# The diagnosis as a whole: the right effect, the right size, and nothing from noise.


@pytest.mark.slow
def test_eq_8_by_the_other_engine_is_consistent_but_for_one_in_a_hundred() -> None:
    seeds = range(1, 9)
    alarms = sum(diagnosed("null", seed).p_value < 0.01 for seed in seeds)
    assert alarms <= binom.ppf(0.999, len(seeds), 0.01)


def test_what_lacks_nothing_is_scanned_once() -> None:
    said: list[str] = []
    diagnose_recording(recording(other_engine(TRUTH), 1), progress=said.append)
    assert sum(line.startswith("scanning") for line in said) == 1


@pytest.mark.slow
def test_what_happens_twice_is_reported_twice_each_with_its_own_size_and_instant() -> None:
    effects = diagnosed("two steps").effects
    assert [effect.identifier for effect in effects] == ["equilibrium-step"] * 2
    size, instant_s = VALUES["equilibrium-step"]
    for effect, sign, at_s in zip(effects, (1.0, -0.5), (instant_s, LATER_S), strict=True):
        jump, time_s = effect.parameters["J"], effect.parameters["time"]
        assert abs(jump.value - sign * size) < 4.0 * jump.sd
        assert abs(time_s.value - at_s) < 4.0 * time_s.sd


@pytest.mark.slow
def test_a_viscous_baseline_lacks_coulomb_friction() -> None:
    truth = LINEAR.copy()
    truth[2] = 3e-4
    outcome = diagnose_recording(recording(other_engine(truth), 3), baseline="viscous")
    effect = outcome.effects[0]
    assert effect.identifier == "coulomb-friction"
    (estimate,) = effect.parameters.values()
    assert abs(estimate.value - 3e-4) < 4.0 * estimate.sd
    assert len(outcome.effects) == 1


def test_a_viscous_pendulum_is_consistent_with_a_viscous_baseline() -> None:
    outcome = diagnose_recording(recording(other_engine(LINEAR), 4), baseline="viscous")
    assert outcome.verdict == "consistent"
    linear = outcome.baseline.parameters["b"]
    assert abs(linear.value - LINEAR[B]) < 4.0 * linear.sd


def test_a_right_prediction_is_consistent() -> None:
    given = {"a": float(TRUTH[0]), "b": float(TRUTH[B]), "c": float(TRUTH[2])}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    assert outcome.verdict == "consistent"
    assert outcome.baseline.parameters["b"].value == TRUTH[B]


def quality_factor(rate: float) -> float:
    """Of a part of b, 1/s, by itself."""
    return float(np.pi * FREQUENCY_HZ / rate)


@pytest.mark.slow
def test_no_part_of_the_loss_is_more_than_the_whole() -> None:
    """One part given by itself, and too large, is reported; b was free to be larger only."""
    given = {"quality_factor_hysteretic": quality_factor(1.2 * float(TRUTH[B]))}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    assert names(outcome) == {"parameter-quality_factor_hysteretic"}
    least = outcome.baseline.parameters["b"]
    assert least.at_bound
    assert least.value == pytest.approx(1.2 * TRUTH[B], rel=1e-4)  # by the apparent frequency
    found = outcome.improved.parameters["b"]
    assert abs(found.value - TRUTH[B]) < 4.0 * found.sd


@pytest.mark.parametrize(("part", "share"), [("hysteretic", 0.4), ("viscous", 0.6)])
def test_a_part_of_the_loss_is_held_while_the_other_is_fitted(part: str, share: float) -> None:
    rate = share * float(TRUTH[B])
    given = {f"quality_factor_{part}": quality_factor(rate)}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    assert outcome.verdict == "consistent"
    kept = getattr(pendulum_of(outcome.search.baseline.value), part)
    assert kept == pytest.approx(rate, rel=1e-4)  # by the apparent frequency
    found = outcome.baseline.parameters["b"]
    assert 0.0 < abs(found.value - TRUTH[B]) < 4.0 * found.sd


@pytest.mark.slow
def test_a_viscous_baseline_has_one_part_and_holds_it() -> None:
    given = {"quality_factor_viscous": quality_factor(1.1 * float(LINEAR[B]))}
    record = recording(other_engine(LINEAR), 4)
    outcome = diagnose_recording(record, baseline="viscous", fixed=given)
    assert names(outcome) == {"parameter-quality_factor_viscous"}
    assert outcome.baseline.parameters["b"].sd == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("given", [{"c": 1.0}, {"mass": 1.0}, {"b": -0.1}])
def test_what_cannot_be_held_is_refused_in_one_line(given: dict[str, float]) -> None:
    """A friction that stops the pendulum at once, no parameter, and a gain of energy."""
    with pytest.raises(InputError, match="; "):
        diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)


def test_gaps_of_the_whole_recording_are_told_though_the_decay_has_none() -> None:
    """They say what the recorder does: here it paused for 7 s before the release."""
    record = recording(other_engine(TRUTH), 1)
    points, part = measure_recording(record, "the test")
    rest = np.arange(TIME_S[0] - 12.0, TIME_S[0] - 7.0, TIME_S[1])
    whole = Recording(np.append(rest, TIME_S), np.append(0.0 * rest, record.values), "angle_rad")
    told, silent = (
        diagnose_recording(part, points=points, whole=given).warnings for given in (whole, record)
    )
    (gap,) = set(told) - set(silent)
    assert f"a gap of {TIME_S[0] - rest[-1]:.4g} s" in gap


@pytest.mark.slow
def test_the_seed_decides_the_draws_and_nothing_else() -> None:
    record = recording(other_engine(TRUTH), 1)
    again, other = (
        diagnose_recording(record, restoring="linear", seed=seed).to_dict() for seed in (0, 1)
    )
    once = diagnosed("null").to_dict()
    assert again == once
    # Only p-values count trials by random draws.
    assert {key for key in once if other[key] != once[key]} == {"excluded"}


@pytest.mark.slow
def test_red_noise_beside_sin_x_is_noise() -> None:
    """Ten times what neighbouring readings show: no tone, drift or curve is missing."""
    wander = lfilter([1.0], [1.0, -0.97], white(50))
    angle = with_effects("circular-error", base=np.r_[TRUTH[:5], 0.8, TRUTH[6:]])
    found = diagnose_recording(Recording(TIME_S, angle + wander, "angle_rad"))
    assert not found.search.steps
    assert found.search.baseline.model.restoring == "sine"
    assert found.search.noise.coloured
    b = found.improved.parameters["b"]
    assert abs(b.value - TRUTH[B]) < 4.0 * b.sd


@pytest.mark.slow
def test_four_swings_at_uneven_times_are_answered() -> None:
    """A wheel with a strong brake, read by an instrument that skips rows."""
    random = np.random.default_rng(8)
    time_s = np.cumsum(random.choice([0.01, 0.02, 0.11], 200, p=[0.6, 0.3, 0.1]))
    angle_rad = 0.15 * np.exp(-0.48 * time_s) * np.cos(3.14 * time_s)
    reading = angle_rad + 5e-4 * random.standard_normal(len(time_s))
    found = diagnose_recording(Recording(time_s, reading, "angle_rad"))
    assert found.verdict == "consistent"


@pytest.mark.slow
def test_the_answer_does_not_depend_on_the_unit() -> None:
    """Two modes, in radians and in counts of a thousandth: the bounds of sizes go with it."""
    time_s = np.arange(0.0, 35.0, 0.05)
    pairs = ((0.131, 0.7073, 80.0, 0.3), (0.11, 0.7353, 60.0, 2.0))
    modes = [
        size * np.exp(-time_s / tau) * np.cos(2.0 * np.pi * f * time_s + phase)
        for size, f, tau, phase in pairs
    ]
    readings = sum(modes) + 5e-4 * np.random.default_rng(4).standard_normal(len(time_s))
    answers = [
        diagnose_recording(Recording(time_s, scale * readings, quantity, metadata={"unit": unit}))
        for scale, quantity, unit in ((1.0, "angle_rad", "rad"), (1000.0, "reading", "counts"))
    ]
    names = [[each.identifier for each in answer.effects] for answer in answers]
    assert names[0] == names[1]
    assert names[0][0] == "second-mode"
    sizes = [answer.effects[0].parameters["q_cosine"].value for answer in answers]
    assert sizes[1] == pytest.approx(1000.0 * sizes[0], rel=1e-2)


def test_of_noise_below_the_rounding_nothing_is_said() -> None:
    """A wheel read by an encoder and nothing else: five readings a second, a step of 0.62 deg."""
    time_s, step_rad = 0.2 * np.arange(300), 0.0108814
    angle_rad = 1.79 * np.exp(-0.0036 * time_s) * np.cos(2.0 * np.pi / 1.822 * (time_s - 0.28))
    found = diagnose_recording(Recording(time_s, rounded(angle_rad, step_rad), "angle_rad"))
    assert found.verdict == "consistent"
    assert not [line for line in found.warnings if "noise" in line]
    assert found.improved.residual_rms_rad < step_rad / 12.0**0.5
    assert "less than the rounding adds (3.14 mrad)" in found.details


# Fit, diagnosis and simulation mean one law, and tell one noise: that of a reading.

HERTZ = 0.87


def simulated(
    rate_hz: float = 50.0,
    amplitude: float = 1.0,
    restoring: Restoring = "sine",
    effects: tuple[str, ...] = (),
) -> "pp.Recording":
    """160 s of a pendulum with white noise of 100 urad."""
    described = {
        "seed": 1,
        "noise_rad": 1e-4,
        "pendulum": {
            "frequency_hz": HERTZ,
            "release_angle_rad": amplitude,
            "restoring": restoring,
            "quality_factor_hysteretic": 200.0,
        },
        "sampling": {"sample_rate_hz": rate_hz, "duration_s": 160.0},
        "effects": [{"id": each} for each in effects],
    }
    return simulate(read_model(described))


def judged(recording: "pp.Recording") -> "tuple[pp.FitResult, dict]":  # type: ignore[type-arg]
    return pp.fit(recording), pp.diagnose(recording).to_dict()


@pytest.mark.slow
@pytest.mark.parametrize(("restoring", "effects"), [("sine", ()), ("linear", ("circular-error",))])
def test_nothing_is_missing_from_a_pendulum_with_hysteretic_loss(
    restoring: Restoring, effects: tuple[str, ...]
) -> None:
    """By the compiled engine and by the general one: Q 200, 1 rad, as both have it."""
    fit, answer = judged(simulated(restoring=restoring, effects=effects))
    assert fit.light == "green"
    assert answer["verdict"] == "consistent"
    truth = {"a": 0.0, "b": math.pi * HERTZ / 200.0, "c": 0.0}
    for name, value in truth.items():
        low, high = fit[name].bounds95
        assert low - 2.0 * fit[name].sd <= value <= high + 2.0 * fit[name].sd


@pytest.mark.parametrize("rate_hz", [45.0, 500.0])
def test_the_noise_is_that_of_a_reading_whatever_was_averaged(rate_hz: float) -> None:
    fit, answer = judged(simulated(rate_hz, amplitude=0.1))
    left = answer["baseline"]
    # Of n readings the rms is good to 1 part in the root of 2 n.
    within = 4.0 / math.sqrt(2.0 * 160.0 * rate_hz)
    assert answer["noise_rms_rad"] == pytest.approx(1e-4, rel=within)
    assert answer["noise_rms_rad"] == fit.noise_rms_rad
    assert left["residual_rms_rad"] == pytest.approx(1e-4, rel=within)
    assert left["chi2_per_dof"] == pytest.approx(1.0, abs=2.0 * within)


def test_a_position_is_diagnosed_as_l_sin_x() -> None:
    """Read as x it has another torque; the angle of its fit lacks nothing."""
    omega, time_s = 5.0, np.arange(0.0, 60.0, 0.01)
    law = Eq8(omega, 0.02, 0.004, 0.006, 1e-3, restoring="sine")
    position = 9.80665 / omega**2 * np.sin(sample(law, Release(-0.2, 0.5), time_s)) + white(
        1, len(time_s), 1e-5
    )
    recording = pp.Recording(time_s, position, "displacement_m")
    found = pp.diagnose(recording, restoring="sine")
    assert (found.verdict, found.restoring) == ("consistent", "sine")
    assert abs(found.baseline.parameters["frequency"].value - 0.5 * omega / math.pi) < 1e-6


@pytest.mark.slow
def test_the_amplitude_of_the_baseline_is_that_of_the_model_with_what_is_missing() -> None:
    """|y| at the first turning point kept, before the first reading: no half cycle later."""
    law, time_s = Eq8(4.0, 0.0, 0.0, 0.03, restoring="sine"), np.arange(0.0, 60.0, 0.02)
    hum = 2e-3 * np.cos(23.0 * time_s) + 2e-4 * np.random.default_rng(1).standard_normal(3000)
    angle = sample(law, Release(-1e-3, 0.3), time_s) + hum
    found = pp.diagnose(pp.Recording(time_s, angle, "angle_rad"))
    before, after = (each.parameters["amplitude"] for each in (found.baseline, found.improved))
    assert "tone-pickup" in names(found)
    assert abs(before.value - 0.3) < 4.0 * before.sd
    assert abs(after.value - 0.3) < 4.0 * after.sd


# A wrong prediction, missing physics, or both: distinguished from each other.


def names(outcome: Diagnosis) -> set[str]:
    return {effect.identifier for effect in outcome.effects}


@pytest.mark.slow
@pytest.mark.parametrize("factors", [{"b": 0.6}, {"a": 0.5, "c": 2.0}, {"a": 1.5, "b": 1, "c": 1}])
def test_wrong_losses_are_no_drift_and_no_unnamed_third_and_come_out_right(
    factors: dict[str, float],
) -> None:
    """However far off: to first order a drift or a curve may look the better."""
    truth = dict(zip("abc", TRUTH[[A, B, C]].tolist(), strict=True))
    given = {name: factor * truth[name] for name, factor in factors.items()}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    wrong = [name for name, factor in factors.items() if factor != 1]
    assert names(outcome) == {f"parameter-{name}" for name in wrong}
    assert {effect.kind for effect in outcome.effects} == {"parameter"}
    assert outcome.effects[0].probability > 0.9
    for name in wrong:
        found = outcome.improved.parameters[name]
        assert abs(found.value - truth[name]) < 4.0 * found.sd


@pytest.mark.slow
def test_a_wrong_frequency_and_circular_error_are_both_reported() -> None:
    """The one shifts the frequency throughout, the other with the amplitude's square."""
    given = {"frequency": 1.005 * FREQUENCY_HZ}
    outcome = diagnose_recording(recording(with_effects("circular-error"), 3), fixed=given)
    assert names(outcome) == {"parameter-frequency", "circular-error"}
    found = outcome.improved.parameters["frequency"]
    assert abs(found.value - FREQUENCY_HZ) < 4.0 * found.sd


@pytest.mark.slow
def test_right_predictions_are_not_blamed_for_missing_physics() -> None:
    """All losses given and true, and one that nobody knew: a free a and b would do as well."""
    effect = by_identifier("cubic-damping")
    readings = Model(TIME_S, INTERVAL_S, (effect,)).reading(np.append(TRUTH, [0.05, 1.0]))
    given = {"a": float(TRUTH[A]), "b": float(TRUTH[B]), "c": float(TRUTH[C])}
    (found,) = diagnose_recording(recording(readings, 3), fixed=given).effects
    assert not found.identifier.startswith("parameter")
    suspected = dict(found.indistinguishable)
    assert "cubic-damping" in {found.identifier, *suspected}
    assert sum(odds for name, odds in suspected.items() if name.startswith("parameter")) < 0.1


@pytest.mark.slow
def test_q_beside_a_zero_that_creeps_is_that_of_the_decay() -> None:
    """Its turning points are off by the creep; Q = omega/(2 b), at any amplitude."""
    b, omega, time_s = 0.0334, 3.7, np.arange(1500) / 25.0
    angle = 0.3 * np.exp(-b * time_s) * np.cos(omega * time_s)
    creeping = angle + 0.25 * (1.0 - np.exp(-time_s / 20.0))
    found = diagnose_recording(
        Recording(time_s, creeping + white(1, len(time_s), 1e-3), "angle_rad"), restoring="linear"
    )
    shown = [each for each in found.summary.consequence if each.quantity == "Q"]
    assert len(shown) == 3
    for each in shown:
        assert each.with_missing.sd < 0.01 * each.with_missing.value
        assert abs(each.with_missing.value - 0.5 * omega / b) < 3.0 * each.with_missing.sd
    assert "independent of any law" not in found.summary.quote


# The last cycles are judged by the scatter of all spans of cycles before them.


def last_cycles(late_s: FloatArray) -> SmallSwings:
    """The last cycles of a record whose phase is late, beside a model that knows nothing of it."""
    fit, _, _ = null_fit()
    readings = other_engine(TRUTH, TIME_S - late_s) + white(9)
    found = small_swings(fit, *prepared(readings))
    assert found is not None
    return found


def bend(size: float) -> FloatArray:
    """A frequency that falls by a share over the last twelfth of the record."""
    return size * np.maximum(TIME_S - 11.0 / 12.0 * TIME_S[-1], 0.0)


def waver(size_s: float) -> FloatArray:
    """A phase that comes and goes within the middle of the record."""
    inside = (TIME_S > 30.0) & (TIME_S < 70.0)
    return np.where(inside, size_s * np.sin(2.0 * np.pi * (TIME_S - 30.0) / 8.0), 0.0)


@pytest.mark.parametrize("share", [1e-2, -1e-2])
def test_a_change_of_the_last_cycles_alone_is_seen_and_measured(share: float) -> None:
    found = last_cycles(bend(share))
    assert found.significant
    assert found.frequency_excess == pytest.approx(-share, abs=3.0 * found.frequency_excess_sd)
    assert 0.04 < found.amplitude_rad < 0.06


def test_a_frequency_that_wavers_anyway_makes_the_last_cycles_uncertain() -> None:
    """Wherever among the others it wavers; a calm one is known by its noise."""
    calm, wavering = last_cycles(bend(0.0)), last_cycles(waver(0.02))
    assert wavering.frequency_excess == calm.frequency_excess
    assert calm.frequency_excess_sd < 1e-4
    # An amplitude of 0.02 s in a period of 8 s makes 1.1 % rms, in two fifths of the spans.
    slope = 0.02 * 2.0 * np.pi / 8.0 / np.sqrt(2.0) * np.sqrt(0.4)
    assert wavering.frequency_excess_sd == pytest.approx(slope, rel=0.4)
    assert not last_cycles(waver(0.02) + bend(1e-2)).significant
