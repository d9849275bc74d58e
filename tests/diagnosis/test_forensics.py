"""Tests of the measurement: what they find, in any unit, and what they leave alone."""

import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import gather
from pendpipe.diagnosis.faults import _applied, correct
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.glitches import _described, find_in_misfit, smallest_p_value
from pendpipe.diagnosis.forensics.sampling_times import gap_note
from pendpipe.diagnosis.forensics.slips import LostSamples, find_lost_samples, loss_confirmed
from pendpipe.diagnosis.forensics.tails import Tail
from pendpipe.diagnosis.found import Confirmation, Finding
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.effects.catalogue.restoring import cubic_stiffness
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from .faults import (
    AIR,
    FAULTS,
    NOISE,
    STEP_12,
    STEP_16,
    TESTS,
    Fitted,
    Pendulum,
    drawn_white,
    examine,
    fitted,
    rounded,
    speed,
)
from .records import FREQUENCY_HZ, hypothesis_of, null_fit, task_of, white

# Each fault of the measurement is found, measured, and not taken for another.

FOUND = 1e-3


@pytest.fixture(scope="module")
def clean() -> FloatArray:
    return AIR.model().reading(AIR.values())


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng([17, seed])


def found(record: Fitted) -> dict[str, Finding]:
    findings = examine(record)
    return {
        name: finding
        for name, finding in zip(TESTS, findings, strict=True)
        if finding.p_value < FOUND
    }


@pytest.mark.parametrize("fault", list(FAULTS))
def test_a_fault_is_found_and_no_other(fault: str, clean: FloatArray) -> None:
    test, make = FAULTS[fault]
    findings = found(make(clean, generator(1)))
    assert list(findings) == [test]
    assert findings[test].delta_chi2 > 10.0
    assert findings[test].summary
    told = findings[test].parameters
    effects = [effect for effect in CATALOGUE if effect.identifier == test]
    declared = {p.name: p.unit_in("rad") for effect in effects for p in effect.parameters}
    assert all(told[name].unit == unit for name, unit in declared.items() if name in told)


GLITCHES = {
    "of either sign, two on end": ([5, 700, 701, 2000, 3998], [1.0, -1.0, 1.0, 1.0, -1.0], 15.0),
    # Seven standard deviations: one is as rare as 3e-12, and two make no tail.
    **{
        f"{number} of one size": (np.linspace(300, 3700, number).astype(int).tolist(), [1.0], 7.0)
        for number in range(1, 6)
    },
}


@pytest.mark.parametrize("kind", GLITCHES)
def test_glitches_are_counted_and_masked(kind: str, clean: FloatArray) -> None:
    where, signs, size = GLITCHES[kind]
    noise = drawn_white(generator(3), AIR.count)
    noise[where] = size * NOISE * np.resize(signs, len(where))
    finding = found(fitted(AIR, clean + noise))["glitches"]
    assert finding.mask is not None
    assert np.flatnonzero(finding.mask).tolist() == where
    assert finding.parameters["number"].value == len(where)
    assert finding.parameters["rms"].value == pytest.approx(size * NOISE, rel=0.15)
    assert finding.location.time_s == (AIR.times()[where[0]], AIR.times()[where[-1]])


def test_glitches_stand_out_of_noise_with_memory_and_of_a_sensor_that_bends(
    clean: FloatArray,
) -> None:
    """Wrong readings at random places are masked; those at the tops are left to the sensor."""
    noisy = clean + drawn_white(generator(), AIR.count)
    remembering = FAULTS["memory 0.5"].make(clean, generator()).data.values.copy()
    bent = noisy - 1e-3 * np.exp((clean - clean.max()) / 1e-3)
    assert "glitches" not in found(fitted(AIR, bent))
    for readings, where, size in ((remembering, [300, 2500], 20), (noisy, [700, 1501, 2600], 12)):
        readings[where] -= size * NOISE
        finding = found(fitted(AIR, readings))["glitches"]
        assert finding.mask is not None
        assert np.flatnonzero(finding.mask).tolist() == where


def test_more_glitches_are_more_certain() -> None:
    """Of 600 readings: any number of equal ones is tested without one that thickens the tails."""
    error = np.abs(generator(3).standard_normal(600))
    chances = []
    for number in range(1, 15):
        error[number - 1] = 8.0
        chances.append(smallest_p_value(np.sort(error), 0.0))
    assert all(np.diff(np.log(chances)) < 0.0)


def test_a_step_of_the_offset_is_not_a_glitch(clean: FloatArray) -> None:
    readings = clean + drawn_white(generator(), AIR.count)
    readings[1500:] += 10.0 * NOISE
    finding = found(fitted(AIR, readings)).get("glitches")
    assert finding is None or finding.mask is None or np.count_nonzero(finding.mask) < 3


@pytest.mark.slow
def test_the_ends_of_a_range_are_found_where_they_are(clean: FloatArray) -> None:
    readings = rounded(np.clip(clean + drawn_white(generator(), AIR.count), -0.125, 0.13), STEP_16)
    finding = found(fitted(AIR, readings))["clipping"]
    assert finding.parameters["upper_level"].value == pytest.approx(0.13, abs=STEP_16)
    assert finding.parameters["lower_level"].value == pytest.approx(-0.125, abs=STEP_16)
    assert finding.mask is not None
    assert np.array_equal(finding.mask, (readings > 0.1299) | (readings < -0.1249))
    ends = [round(level / STEP_16) for level in (0.13, -0.125)]
    assert finding.location.adc_codes == pytest.approx(ends, abs=1)


@pytest.mark.parametrize("codes", [(20,), (-40, -7, 11)])
def test_codes_that_never_occur_are_named(codes: tuple[int, ...], clean: FloatArray) -> None:
    exact = np.round((clean + 10.0 * drawn_white(generator(), AIR.count)) / STEP_12).astype(
        np.int64
    )
    finding = found(fitted(AIR, STEP_12 * (exact - np.isin(exact, codes))))["missing-codes"]
    assert finding.location.adc_codes == codes
    missed = np.mean(np.isin(exact, codes))
    assert finding.parameters["share"].value == pytest.approx(missed, abs=4e-3)
    assert finding.parameters["found"].value == 0.0


@pytest.mark.parametrize("bit", [2, 4])
def test_a_stuck_bit_is_named(bit: int, clean: FloatArray) -> None:
    code = np.round((clean + drawn_white(generator(), AIR.count)) / STEP_16).astype(np.int64)
    finding = found(fitted(AIR, STEP_16 * (code & ~(1 << bit))))["missing-codes"]
    assert finding.parameters["bit"].value == bit


def test_a_coarse_step_is_reported_only_where_it_matters(clean: FloatArray) -> None:
    noise = generator().standard_normal(AIR.count)
    coarse = fitted(AIR, rounded(clean + 0.1 * STEP_12 * noise, STEP_12))
    finding = TESTS["coarse-quantisation"](coarse.data, coarse.fit, coarse.noise, coarse.samples)
    assert finding.p_value < 1e-10
    # The amplitude ends at 12 steps.
    assert finding.kind == "fault"
    assert finding.parameters["step"].value == pytest.approx(STEP_12, rel=1e-6)
    assert finding.parameters["noise_over_step"].value == pytest.approx(0.1, rel=0.3)
    fine = fitted(AIR, rounded(clean + 0.1 * STEP_16 * noise, STEP_16))
    finding = TESTS["coarse-quantisation"](fine.data, fine.fit, fine.noise, fine.samples)
    assert finding.kind == "property"


@pytest.mark.parametrize("sigma_t", [1.5e-4, 1e-3])
@pytest.mark.parametrize("step", [0.0, STEP_16, 0.25 * STEP_12])
def test_jitter_is_measured(sigma_t: float, step: float, clean: FloatArray) -> None:
    pulls = []
    for seed in range(4):
        draw = generator(seed)
        readings = clean + drawn_white(draw, AIR.count)
        readings = readings + sigma_t * speed(clean) * draw.standard_normal(AIR.count)
        record = fitted(AIR, rounded(readings, step) if step else readings)
        finding = TESTS["jitter"](record.data, record.fit, record.noise, record.samples)
        estimate = finding.parameters["sigma_t"]
        pulls.append((estimate.value - sigma_t) / estimate.sd)
    assert np.mean(np.abs(pulls)) < 2.0


DYING = 1.0 + 1.5 * np.exp(-AIR.times() / 60.0)


@pytest.mark.parametrize(("dying", "of_the_gain"), [(DYING, 0.0), (1.0, 2e-3)])
def test_noise_that_dies_with_the_amplitude_and_that_of_the_gain_are_no_jitter(
    dying: FloatArray | float, of_the_gain: float, clean: FloatArray
) -> None:
    draw = generator()
    readings = clean * (1.0 + of_the_gain * draw.standard_normal(AIR.count))
    assert "jitter" not in found(fitted(AIR, readings + dying * drawn_white(draw, AIR.count)))


@pytest.mark.parametrize("seed", range(6))
def test_a_constant_amplitude_shows_no_jitter_and_stops_nothing(seed: int) -> None:
    """As in a recording that is driven first: the mean of v^2 looks like the noise's variance."""
    held = Pendulum(quality_factor=1e10, quadratic=0.0, coulomb=0.0)
    clean = held.model().reading(held.values())
    record = fitted(held, clean + drawn_white(generator(seed), held.count))
    finding = TESTS["jitter"](record.data, record.fit, record.noise, record.samples)
    assert finding.p_value > 1e-4


def test_colour_is_measured(clean: FloatArray) -> None:
    finding = found(FAULTS["memory 0.5"].make(clean, generator(3)))["coloured-noise"]
    # AR(1) of 0.5: at 0.9 Hz of 20, S/mean = 0.75/(1.25 - cos(2 pi 0.045)) = 2.57; the band
    # reaches to three times that.
    assert 1.9 < finding.parameters["density_ratio"].value < 2.8


def test_a_random_torque_is_measured(clean: FloatArray) -> None:
    pulls = []
    for seed in range(4):
        finding = found(FAULTS["torque of 1e-8"].make(clean, generator(seed)))["broadband-drive"]
        estimate = finding.parameters["acceleration_density"]
        pulls.append((estimate.value - 1e-8) / estimate.sd)
        assert finding.margin > 2.0  # kicks, and not a smooth misfit
    assert np.mean(np.abs(pulls)) < 2.0


def test_missing_stiffness_is_not_a_random_torque() -> None:
    stiff = Model(AIR.times(), 1.0 / AIR.rate_hz, (cubic_stiffness,))
    readings = stiff.reading(np.append(AIR.values(), 3e-3)) + drawn_white(generator(), AIR.count)
    record = fitted(AIR, readings)
    assert record.fit.chi2 > 1.1 * AIR.count
    assert found(record) == {}


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_time_stamps_are_used_where_they_are_right(share: float, clean: FloatArray) -> None:
    draw = generator()
    stamps = AIR.times() + draw.uniform(-5e-4, 5e-4, AIR.count)
    true = stamps + share * (AIR.times() - stamps)
    readings = Model(true, 1.0 / AIR.rate_hz).reading(AIR.values()) + drawn_white(draw, AIR.count)
    record = fitted(AIR, readings, stamps)
    finding = TESTS["time-stamps"](record.data, record.fit, record.noise, record.samples)
    estimate = finding.parameters["share"]
    assert estimate.value == pytest.approx(share, abs=4.0 * estimate.sd)
    assert (finding.p_value < FOUND) == (share == 1.0)
    if share == 1.0:
        assert finding.time_s == pytest.approx(AIR.times(), abs=5e-5)


def test_gaps_in_the_time_stamps_are_noted_and_are_not_a_fault(clean: FloatArray) -> None:
    kept = np.ones(AIR.count, dtype=bool)
    kept[1000:1050] = kept[3000] = False
    record = fitted(AIR, (clean + drawn_white(generator(), AIR.count))[kept], AIR.times()[kept])
    assert not found(record)
    note = gap_note(record.samples.time_s, 0.5 / FREQUENCY_HZ, counts=False)
    assert note is not None
    assert f"2 gaps, the longest of {51 / AIR.rate_hz:.4g} s" in note


@pytest.mark.parametrize("lost", [{1234: 1}, {200: 1, 900: 1, 1500: 2, 2600: 1}, {1500: -1}])
def test_lost_samples_are_found_before_they_spoil_the_rest(lost: dict[int, int]) -> None:
    longer = Pendulum(count=AIR.count + 10)
    motion, row = longer.model().reading(longer.values()), np.arange(AIR.count)
    for place, number in lost.items():
        row = row + number * (row >= place)
    readings = motion[row] + drawn_white(generator(), AIR.count)
    record = fitted(AIR, readings)
    candidates = find_lost_samples(record.data, record.fit)
    assert [candidate.number for candidate in candidates] == list(lost.values())
    begun = np.flatnonzero(np.diff(row) != 1) + 1
    for candidate, place in zip(candidates, begun, strict=True):
        assert candidate.measured == pytest.approx(candidate.number, abs=0.1)
        assert candidate.time_s == pytest.approx(AIR.times()[place], abs=2.1 / AIR.rate_hz)


def test_a_loss_is_as_probable_by_chance_as_the_noise_makes_it() -> None:
    """One sample, of which five times the noise are five times the standard deviations."""
    longer, row = Pendulum(count=AIR.count + 10), np.arange(AIR.count)
    motion = longer.model().reading(longer.values())[row + (row >= 1234)]
    chances = []
    for times in (5.0, 15.0, 25.0):
        record = fitted(AIR, motion + times * drawn_white(generator(), AIR.count))
        finding = TESTS["dropped-samples"](record.data, record.fit, record.noise, record.samples)
        chances.append(finding.p_value)
    assert 0.0 < chances[0] < 1e-30 < chances[1] < 1e-15 < chances[2] < 1e-6


def folded(pendulum: Pendulum, readings: FloatArray) -> Fitted:
    """Means of several readings, as the diagnosis takes them of a very long record."""
    record = fitted(pendulum, readings)
    data = gather(
        record.samples.time_s,
        readings,
        step=record.samples.step,
        unit="rad",
        counts=False,
        period_s=1.0 / FREQUENCY_HZ,
        noise_rms=record.samples.noise_rms,
        most=5000,
    )
    assert len(data) < pendulum.count // 3
    model = Model(data.time_s, data.interval_s)
    noise = white_noise(data, record.noise.rms * math.sqrt(len(data) / pendulum.count))
    fit = refine(model, data, noise, pendulum.values())
    return Fitted(data, fit, noise, record.samples)


def test_codes_are_tested_after_a_corrected_clock() -> None:
    """Ten samples are lost in the middle; the data's times are right, the samples' are not."""
    longer = Pendulum(count=AIR.count + 10)
    kept = np.delete(np.arange(longer.count), slice(2000, 2010))
    noise = 1e-3 * generator().standard_normal(longer.count)
    noisy = longer.model().reading(longer.values()) + noise
    exact = np.round(noisy / STEP_12).astype(np.int64)
    readings = (STEP_12 * (exact + np.isin(exact, (20,))))[kept]
    corrected = fitted(AIR, readings, longer.times()[kept])
    samples = replace(corrected.samples, time_s=AIR.times()[: len(kept)])
    finding = TESTS["missing-codes"](corrected.data, corrected.fit, corrected.noise, samples)
    assert finding.location.adc_codes == (20,)


FAST = Pendulum(rate_hz=400.0, count=20_000)


def test_the_codes_of_averaged_readings_are_tested() -> None:
    noisy = FAST.model().reading(FAST.values()) + 1e-3 * generator().standard_normal(FAST.count)
    exact = np.round(noisy / STEP_12).astype(np.int64)
    findings = found(folded(FAST, STEP_12 * (exact + np.isin(exact, (30,)))))
    assert list(findings) == ["missing-codes"]
    assert findings["missing-codes"].location.adc_codes == (30,)


def test_the_range_of_averaged_readings_is_tested() -> None:
    noisy = FAST.model().reading(FAST.values()) + drawn_white(generator(), FAST.count)
    record = folded(FAST, rounded(np.minimum(noisy, 0.15), STEP_16))
    findings = found(record)
    assert list(findings) == ["clipping"]
    clipping = findings["clipping"]
    assert clipping.parameters["upper_level"].value == pytest.approx(0.15, abs=STEP_16)
    assert clipping.mask.shape == record.data.values.shape
    assert 20 < np.count_nonzero(clipping.mask) < 0.1 * len(record.data)


def test_glitches_need_no_model(clean: FloatArray) -> None:
    """The clock is wrong by a hundredth; single readings are found, a shifted stretch is none."""
    noisy = clean + drawn_white(generator(), AIR.count)
    right = fitted(AIR, noisy)
    off = right.fit.model.evaluate(1.01 * right.fit.value)
    far = replace(right.fit, evaluation=replace(right.fit.evaluation, at=off))
    where = np.array([420, 1501, 3300])
    for wrong, expected in ((where, where.tolist()), (np.arange(1500, 1508), [])):
        readings = noisy.copy()
        readings[wrong] += 30.0 * NOISE
        data = replace(right.data, values=readings)
        finding = find_in_misfit(Evidence(data, far, right.noise, right.samples))
        found_at = [] if finding is None else np.flatnonzero(finding.mask).tolist()
        assert found_at == expected
        assert finding is None or finding.p_value < 1e-3


def test_the_largest_glitch_is_the_largest_beside_the_right_readings(clean: FloatArray) -> None:
    """Of neighbours the first to be found looks large until the others are left out."""
    right = fitted(AIR, clean + drawn_white(generator(), AIR.count))
    mask, error, at_first = (np.zeros(AIR.count, kind) for kind in (bool, float, float))
    mask[[420, 1501]] = True
    error[mask], at_first[mask] = (5.0 * NOISE, 60.0 * NOISE), (50.0, 20.0)
    evidence = Evidence(right.data, right.fit, right.noise, right.samples)
    residual = right.data.residual(right.fit.at.reading) + error
    tail = Tail(*np.array([[1e3], [1.0], [1.0]]))
    found = _described(evidence, residual, at_first, mask, 0.0, tail).parameters
    assert found["largest"].value == pytest.approx(60.0 * NOISE, rel=0.1)
    assert found["largest"].value > found["rms"].value


def test_lost_samples_that_no_motion_could_follow_are_not_corrected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After a loss longer than the motion there is nothing to compare: the record stays."""
    fit, data, noise = null_fit()
    late = LostSamples(float(data.time_s[-20]), 10**9, 1e9)
    monkeypatch.setattr("pendpipe.diagnosis.forensics.slips.find_lost_samples", lambda *_: [late])
    samples = prepare(Recording(data.time_s, data.values, "angle_rad"), "the test")
    state = correct(hypothesis_of(fit, data, noise, (), fit, samples), task_of(samples))
    assert np.array_equal(state.data.time_s, data.time_s)
    assert "dropped-samples" not in [fault.identifier for fault in state.faults]


@pytest.mark.parametrize("late", [-1, 0, 1])
def test_a_loss_that_is_placed_a_reading_off_makes_no_glitch(
    late: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    longer, place = Pendulum(count=AIR.count + 10), 1234
    row = np.arange(AIR.count)
    motion = longer.model().reading(longer.values())[row + 2 * (row >= place)]
    record = fitted(AIR, motion + drawn_white(generator(), AIR.count))
    (lost,) = find_lost_samples(record.data, record.fit)
    placed = lost._replace(time_s=float(AIR.times()[place + late]))
    monkeypatch.setattr("pendpipe.diagnosis.forensics.slips.find_lost_samples", lambda *_: [placed])
    begun = hypothesis_of(record.fit, record.data, record.noise, (), record.fit, record.samples)
    state = correct(begun, task_of(record.samples))
    (fault,) = state.faults
    assert fault.identifier == "dropped-samples"
    # What the readings beside it took from chi^2 is no gain of the correction.
    assert len(np.flatnonzero(state.data.weight == 0.0)) == 4


def test_readings_left_out_beside_a_step_are_no_gain_of_a_correction() -> None:
    fit, data, noise = null_fit()
    mask = np.isin(np.arange(len(data)), np.arange(50, len(data), 30))
    samples = prepare(Recording(data.time_s, data.values, "angle_rad"), "the test")
    state = hypothesis_of(fit, data, noise, (), fit, samples)
    found = Finding("clock-slips", 1e-9, mask=mask, time_s=data.time_s)
    assert _applied(found, state, task_of(samples)) is None


@pytest.mark.parametrize("stale", [True, False])
def test_a_stale_reading_in_heavy_tails_is_wrong_since_it_repeats_the_one_before(
    clean: FloatArray, stale: bool
) -> None:
    """Noise of Student's nu = 3 has one as far off in a hundred records, but never the same."""
    noise = NOISE * generator(5).standard_t(3.0, AIR.count)
    readings = rounded(clean + noise, STEP_16)
    row = 1000 + int(np.argmax(np.abs(np.diff(clean[1000:1100])))) + 1
    readings[row] = readings[row - 1] + (0.0 if stale else 3.0 * STEP_16)
    assert abs(readings[row] - clean[row]) > 100.0 * NOISE
    record = fitted(AIR, readings)
    finding = TESTS["glitches"](record.data, record.fit, record.noise, record.samples)
    assert (finding.p_value < 1e-4) == stale
    assert ("repeats the one before" in finding.summary) == stale


def test_a_short_record_of_coloured_noise_is_tested_for_glitches_without_a_filter() -> None:
    """Too few readings lie far enough from both ends for the whitening filter."""
    random = np.random.default_rng(1)
    for _ in range(37):
        cycles, count = random.uniform(3, 10), int(random.integers(80, 260))
        quality, amplitude = float(random.uniform(2, 12)), float(10 ** random.uniform(-2, 0.2))
        noise, dry = 10 ** random.uniform(-5, -1.5), float(random.choice([0, 1e-2 * amplitude]))
        phase, hertz = random.uniform(0, 6.28), 10 ** random.uniform(-1, 1)
        angle = 2 * np.pi * cycles * np.arange(count) / count
        envelope = np.maximum(amplitude * np.exp(-angle / 2 / quality) - dry * angle, 0)
        swing = envelope * np.cos(angle + phase) + noise * amplitude * random.normal(size=count)
        if random.random() < 0.4:
            swing = np.round(swing / (amplitude / 200)) * (amplitude / 200)
    recording = pp.Recording(time_s=angle / (2 * np.pi * hertz), angle_rad=swing)
    assert pp.diagnose(recording).verdict == "consistent"


# The tests of the measurement know no second and no radian: Eq. 8 looks the same in any unit.


@dataclass(frozen=True)
class Scaled(Pendulum):
    """The same decay, slower and larger by two factors."""

    slower: float = 1.0
    larger: float = 1.0

    def values(self) -> FloatArray:
        a, b, c, share, omega, angle, start, offset = super().values()
        slow, large = self.slower, self.larger
        losses = a / (slow * large), b / slow, c * large / slow
        motion = omega / slow, angle * large, start * slow, offset * large
        return np.array([*losses, share, *motion])


def judged(record: Fitted) -> dict[str, tuple[float, float]]:
    """By test: the p-value's logarithm, and the gain."""
    found = {}
    for name, find in TESTS.items():
        finding = find(record.data, record.fit, record.noise, record.samples)
        found[name] = float(np.log(max(finding.p_value, 1e-290))), finding.delta_chi2
    return found


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_as_clear_in_other_units(fault: str, clean: FloatArray) -> None:
    slower, larger = 1.0 / 16.0, 64.0
    record = FAULTS[fault].make(clean, np.random.default_rng([17, 5]))
    scaled = fitted(
        Scaled(rate_hz=AIR.rate_hz / slower, slower=slower, larger=larger),
        larger * record.data.values,
        slower * record.data.time_s,
    )
    expected, found = judged(record), judged(scaled)
    for name in TESTS:
        assert found[name] == pytest.approx(expected[name], rel=1e-3, abs=1e-3), name


# A clock that jumps moves angle and velocity along one path; a knock or an offset does not.

OMEGA, LOSS, AT = 5.3, 0.006, 31.0
PERIOD_S = 2.0 * math.pi / OMEGA
STAMPS = np.arange(6000) / 100.0


def swing(time_s: FloatArray) -> FloatArray:
    return np.asarray(0.4 * np.exp(-LOSS * time_s) * np.cos(OMEGA * time_s))


def second_test(angle: FloatArray, seed: int) -> Confirmation:
    return loss_confirmed(
        Samples(STAMPS, angle + white(seed, len(angle), 2e-4), "rad", None, 2e-4),
        AT + 0.02,
        PERIOD_S,
    )


@pytest.mark.parametrize("lost_s", [0.03, -0.05, 0.07])
def test_a_jump_of_the_clock_is_confirmed_and_its_size_told(lost_s: float) -> None:
    found = second_test(swing(STAMPS + np.where(STAMPS >= AT, lost_s, 0.0)), 1)
    assert found.p_value < 1e-3
    for value, sd in re.findall(r"by (\S+) ± (\S+) ms", found.summary):
        assert abs(float(value) - 1e3 * lost_s) < 4.0 * float(sd) + 0.02 * abs(1e3 * lost_s)


@pytest.mark.slow
def test_neither_a_knock_nor_an_offset_nor_nothing_is_a_jump_of_the_clock() -> None:
    after = np.where(STAMPS >= AT, STAMPS - AT, 0.0)
    knock = 0.05 * np.exp(-LOSS * after) * np.sin(OMEGA * after)
    offset = np.where(STAMPS >= AT, 0.02, 0.0)
    for change in (knock, offset, 0.0 * after):
        assert min(second_test(swing(STAMPS) + change, seed).p_value for seed in range(5)) > 1e-3


def test_too_few_readings_say_nothing() -> None:
    samples = Samples(STAMPS[::20], swing(STAMPS[::20]), "rad", None, 1e-4)
    assert loss_confirmed(samples, AT, PERIOD_S).p_value == 1.0
