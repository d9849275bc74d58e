"""Converters, encoders and clocks: codes, rounding, lost counts and slips."""

import math
import tracemalloc
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.special import ndtr
from scipy.stats import binom

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.data import Data, gather, rounding_bias, with_lattice
from pendpipe.diagnosis.faults import _with
from pendpipe.diagnosis.forensics import slips
from pendpipe.diagnosis.forensics.codes import noise_before_rounding, spacing_of, with_true_step
from pendpipe.diagnosis.forensics.converter import worst_comb
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.local import Local
from pendpipe.diagnosis.found import Finding
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from ..effects.integration import swung
from .faults import AIR, STEP_16, TESTS, drawn_white, fitted, rounded
from .records import INTERVAL_S, TIME_S, TRUTH, hypothesis_of, other_engine, white

# Which codes occur: coarser lattices, combs, and neither.


@pytest.fixture(scope="module")
def code() -> FloatArray:
    """Codes of a good converter, its noise a step and a quarter."""
    clean = AIR.model().reading(AIR.values())
    noisy = clean + drawn_white(np.random.default_rng(71), AIR.count)
    return np.asarray(np.round(noisy / STEP_16))


def asked(readings: FloatArray, name: str) -> Finding:
    """One test, where the file gives the converter's step."""
    record = fitted(AIR, readings)
    samples = with_true_step(replace(record.samples, step=STEP_16, promised_step=None))
    return TESTS[name](record.data, record.fit, record.noise, samples)


@pytest.mark.parametrize("dead", [1, 2, 3])
def test_dead_bits_make_a_coarser_step(dead: int, code: FloatArray) -> None:
    """And no code is missing on the lattice that is left."""
    coarse = 2**dead * np.floor(code / 2**dead)
    finding = asked(STEP_16 * coarse, "coarse-quantisation")
    assert finding.p_value < 1e-10
    assert finding.kind == "fault"
    assert finding.parameters["dead_bits"].value == dead
    assert finding.parameters["step"].value == pytest.approx(2**dead * STEP_16)
    # Every second code missing is the same as a lowest bit that is stuck.
    assert finding.also == (("missing-codes",) if dead == 1 else ())
    assert asked(STEP_16 * coarse, "missing-codes").p_value > 1e-3


@pytest.mark.parametrize("times", [2.37, 5.5, 12.62, 25.23, 100.9])
def test_a_step_of_any_size_before_the_converter_is_a_coarser_step(times: float) -> None:
    """Its readings are rounded to the converter's codes, and no code of its own is missing."""
    noise = times * drawn_white(np.random.default_rng(72), AIR.count)
    coarse = rounded(AIR.model().reading(AIR.values()) + noise, times * STEP_16)
    readings = rounded(coarse, STEP_16)
    finding = asked(readings, "coarse-quantisation")
    assert finding.p_value < 1e-6
    assert finding.kind == "fault"
    assert finding.parameters["step"].value == pytest.approx(times * STEP_16, rel=1e-3)
    assert "dead_bits" not in finding.parameters
    for other in ("missing-codes", "clipping", "jitter"):
        assert asked(readings, other).p_value > 1e-3


def test_a_coarse_step_before_the_converter_is_all_that_is_reported(code: FloatArray) -> None:
    readings = rounded(rounded(STEP_16 * code, 12.62 * STEP_16), STEP_16)
    record = Recording(AIR.times(), readings, "angle_rad", resolution=STEP_16)
    effects = diagnose_recording(record).effects
    assert [effect.identifier for effect in effects] == ["coarse-quantisation"]
    assert effects[0].parameters["step"].value == pytest.approx(12.62 * STEP_16, rel=1e-3)


@pytest.mark.parametrize("spacing", [2.2, math.e, math.pi, 7.3, 25.2, 1e3 / 3.0])
def test_the_spacing_of_codes_is_that_of_the_lattice_they_are_roundings_of(spacing: float) -> None:
    """Though every fourth of them never occurs."""
    for seed in range(20):
        generator = np.random.default_rng(seed)
        number = np.flatnonzero(generator.random(200) < 0.75)
        found = spacing_of(np.round(spacing * number + generator.uniform(-0.5, 0.5)))
        # Where a rounding at one end differs, the whole length does by one at most.
        assert found == pytest.approx(spacing, abs=1.0 / 150.0)


@given(st.floats(3.0, 1e3), st.integers(0, 2**32 - 1))
def test_codes_that_lie_anywhere_have_no_spacing(usual: float, seed: int) -> None:
    gaps = np.random.default_rng(seed).integers(2, int(3.0 * usual), 60).astype(np.float64)
    assert spacing_of(np.cumsum(np.append(gaps, [2.0, 3.0]))) is None


@pytest.mark.parametrize("period", [4, 16, 64])
def test_a_comb_of_missing_codes_is_no_coarser_step(period: int, code: FloatArray) -> None:
    """No single code may be expected often enough; all of them together are."""
    readings = STEP_16 * (code + (code % period == 3))
    finding = asked(readings, "missing-codes")
    assert finding.p_value < 1e-6
    assert finding.parameters["period"].value == period
    assert finding.parameters["found"].value == 0.0
    assert all(each % period == 3 for each in finding.location.adc_codes)
    assert asked(readings, "coarse-quantisation").kind == "property"


@pytest.mark.parametrize("stuck", [False, True])
def test_codes_of_a_fine_step_are_asked_by_residue_alone(stuck: bool) -> None:
    """Of tens of millions of codes for 4,000 readings none alone is expected once."""
    step = STEP_16 / 2**14
    noise = 30.0 * step * np.random.default_rng(73).normal(size=AIR.count)
    code = np.round((AIR.model().reading(AIR.values()) + noise) / step)
    record = fitted(AIR, step * (code + (stuck & (code % 64 == 3))))
    samples = replace(record.samples, step=step, promised_step=None)
    tracemalloc.start()
    finding = TESTS["missing-codes"](record.data, record.fit, record.noise, samples)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (finding.p_value < 1e-6) == stuck
    if stuck:
        assert finding.parameters["period"].value == 64
    assert peak_bytes < 4000 * AIR.count


def test_a_good_converters_codes_lie_on_its_own_lattice(code: FloatArray) -> None:
    record = fitted(AIR, STEP_16 * code)
    assert with_true_step(record.samples) is record.samples
    assert asked(STEP_16 * code, "missing-codes").p_value > 1e-3


def test_combs_that_chance_makes_are_as_rare_as_their_p_value() -> None:
    """Codes drawn at random from their expectation."""
    generator, seldom = np.random.default_rng(5), 0
    due = np.zeros((3, 512))
    due[:, 2:398] = 8000 / 398
    for _ in range(200):
        codes = generator.integers(1, 399, 8000)
        codes[:2] = 1, 398
        seldom += worst_comb(codes, due).p_value < 0.05
    # Ten are due at most, since residues of two periods share their codes.
    assert seldom <= binom.isf(1e-3, 200, 0.05)


def test_one_stuck_bit_may_be_either_effect(code: FloatArray) -> None:
    time = AIR.times()
    readings = STEP_16 * 2.0 * np.floor(code / 2.0)
    record = Recording(time, readings, "angle_rad", resolution=STEP_16)
    effect = diagnose_recording(record).effects[0]
    assert effect.identifier == "coarse-quantisation"
    ((other, probability),) = effect.indistinguishable
    assert other == "missing-codes"
    assert probability == effect.probability < 0.5


# Rounded readings: where the noise is too small to hide the steps.


def mean_code(angle: float, step: float, noise_rms: float) -> float:
    """The mean of round((angle + noise)/step) step, code by code."""
    codes = np.arange(-30, 31) + round(angle / step)
    edges = (np.append(codes - 0.5, codes[-1] + 0.5) * step - angle) / noise_rms
    return float(step * np.sum(codes * np.diff(ndtr(edges))))


@given(st.floats(-4.0, 4.0), st.floats(0.02, 1.5), st.floats(1e-6, 1e2))
def test_rounding_shifts_the_mean_of_noisy_readings(
    angle: float, noise: float, step: float
) -> None:
    """All in steps; the edges that are passed against the sum over the codes."""
    found = rounding_bias(np.array([angle * step]), step, noise * step)[0]
    assert found / step == pytest.approx(mean_code(angle, 1.0, noise) - angle, abs=1e-6)


@pytest.mark.parametrize("share", [0.12, 0.25])
@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_the_noise_before_the_rounding_is_found(share: float, shift: float) -> None:
    """And the origin of the converter's steps; with it the residual has no bias."""
    step = 1e-3
    plain = other_engine(TRUTH)
    readings = shift * step + rounded(plain - shift * step + white(4, rms=share * step), step)
    data = Data(TIME_S, readings, INTERVAL_S, True, np.ones(len(TIME_S)), step)
    found = with_lattice(data, plain)
    assert found.lattice is not None
    known = rounding_bias(plain - shift * step, step, share * step)
    assert np.std(found.lattice - known) < 0.15 * np.std(known)
    assert np.std(found.residual(plain)) < np.std(data.residual(plain))


@pytest.mark.parametrize("share", [0.12, 0.25, 0.4])
def test_the_noise_before_the_rounding_is_found_where_the_model_is_the_truth(share: float) -> None:
    step, plain = 1e-3, other_engine(TRUTH)
    left = rounded(plain + white(4, rms=share * step), step) - plain
    every = np.ones(len(left), dtype=bool)
    local = Local(left, float(np.std(left)), np.zeros(len(left)), every)
    assert noise_before_rounding(local, step) / step == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize(("share", "step"), [(1.0, 1e-3), (0.3, 0.0)])
def test_noise_of_a_step_or_no_step_leaves_nothing_to_find(share: float, step: float) -> None:
    plain = other_engine(TRUTH)
    readings = plain + white(4, rms=share * 1e-3)
    readings = rounded(readings, step) if step else readings
    data = Data(TIME_S, readings, INTERVAL_S, True, np.ones(len(TIME_S)), step)
    assert with_lattice(data, plain).lattice is None


@given(st.integers(24, 4000))
def test_a_quick_length_has_small_factors_and_loses_little(count: int) -> None:
    time = np.arange(count) * INTERVAL_S
    told = {"step": None, "unit": "rad", "counts": False, "period_s": 1.0, "noise_rms": 1.0}
    found = len(gather(time, np.zeros(count), **told))  # type: ignore[arg-type]
    left = found
    for prime in (2, 3, 5, 7, 11):
        while left % prime == 0:
            left //= prime
    assert left == 1
    assert 0.9 * count < found <= count


@pytest.mark.parametrize("rate_hz", [24.0, 29.97, 30.0, 60.0])
def test_stamps_rounded_to_milliseconds_are_evenly_spaced(rate_hz: float) -> None:
    """Their intervals, of 33 and 34 ms at 30 Hz, differ by up to six per cent."""
    exact = np.arange(900) / rate_hz
    data = gather(
        np.round(exact, 3),
        np.zeros(900),
        step=None,
        unit="rad",
        counts=False,
        period_s=1.0,
        noise_rms=1.0,
    )
    assert data.uniform
    assert data.interval_s == pytest.approx(1.0 / rate_hz, rel=1e-4)


@pytest.mark.parametrize("period_s", [0.2, 0.4, 1.1, 5.0])
def test_readings_are_averaged_only_where_many_are_left_in_a_cycle(period_s: float) -> None:
    """Of 20000 at 200 Hz; the noise of a mean falls with the root of their number."""
    time_s = np.arange(20_000) / 200.0
    data = gather(
        time_s, time_s**2, step=1e-3, unit="rad", counts=False, period_s=period_s, noise_rms=1e-4
    )
    assert data.interval_s == pytest.approx(data.fold / 200.0)
    assert data.fold == 1 or period_s / data.interval_s >= 24.0
    assert data.noise_rms == pytest.approx(1e-4 / data.fold**0.5)
    assert data.step == (1e-3 if data.fold == 1 else 0.0)
    assert data.values[0] == pytest.approx(np.mean(time_s[: data.fold] ** 2))
    assert data.time_s[0] == pytest.approx(np.mean(time_s[: data.fold]))


# Lost counts and clock slips: found and undone where they are whole, and else not.

OMEGA, LOSS, START, COUNT, RATE_HZ = 5.0, 0.004, 0.6, 0.02, 60.0


class Swing(NamedTuple):
    """A pendulum under sin x, by scipy's integrator, every millisecond."""

    time_s: FloatArray
    angle: FloatArray


@pytest.fixture(scope="module")
def swing() -> Swing:
    time = np.arange(0.0, 62.0, 1e-3)
    return Swing(time, swung(time, START, OMEGA, LOSS)[0])


def counted(swing: Swing, level: FloatArray) -> Samples:
    """An encoder that writes a row at each edge that it passes; the level is what it counts."""
    edges = np.floor(swing.angle / COUNT).astype(np.int64)
    passed = np.flatnonzero(np.diff(edges)) + 1
    angle = COUNT * np.maximum(edges[passed], edges[passed - 1])
    # Where within the millisecond it passed.
    late = (angle - swing.angle[passed - 1]) / (swing.angle[passed] - swing.angle[passed - 1])
    time = swing.time_s[passed - 1] + 1e-3 * late
    keep = np.append(True, np.diff(time) > 0.0)
    return Samples(
        time[keep], (angle + level[passed])[keep], "rad", None, 0.05 * COUNT, counts=True
    )


def after_reversals(swing: Swing, random: np.random.Generator, sizes: FloatArray) -> FloatArray:
    """A level that steps after some turning points."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(swing.angle)))) + 30
    level = np.zeros(len(swing.time_s))
    level[random.choice(turns[4:-4], len(sizes), replace=False)] = sizes
    return np.asarray(np.cumsum(level))


def fit_of(data: Data) -> Fit:
    model = Model(data.time_s, data.interval_s, (circular_error,), order=20)
    start = np.array([0.0, LOSS, 0.0, 0.5, OMEGA, START, 0.0, 0.0, 1.0])
    return refine(model, data, white_noise(data, 2e-4), start)


def test_counts_lost_after_reversals_are_found_and_undone(swing: Swing) -> None:
    random = np.random.default_rng(3)
    sizes = COUNT * random.choice([-1.0, 1.0], 18)
    level = after_reversals(swing, random, sizes)
    corrected, finding = found("count-slips", counted(swing, level))
    assert finding.p_value < 1e-6
    assert finding.parameters["number"].value == 18
    step = finding.parameters["step"]
    assert abs(step.value - COUNT) < 3.0 * step.sd < 0.02 * COUNT
    truth = counted(swing, np.zeros_like(level)).values
    wrong = np.abs(corrected.values - truth - (corrected.values - truth)[0]) > 0.5 * COUNT
    # Only between the reversal and the next row or two.
    assert np.mean(wrong) < 0.01
    assert finding.confirmed.p_value < 1e-3


def test_a_level_that_steps_by_any_amount_is_no_lost_count(swing: Swing) -> None:
    random = np.random.default_rng(4)
    named = 0
    for _ in range(3):
        sizes = COUNT * random.uniform(0.6, 2.6, 18) * random.choice([-1.0, 1.0], 18)
        _, finding = found("count-slips", counted(swing, after_reversals(swing, random, sizes)))
        named += finding.p_value < 1e-3
        assert finding.confirmed is None or finding.confirmed.p_value > 0.01
    assert named == 0


def test_an_encoder_that_loses_nothing_has_no_slips(swing: Swing) -> None:
    _, finding = found("count-slips", counted(swing, np.zeros(len(swing.time_s))))
    assert finding.p_value == 1.0


def found(name: str, samples: Samples) -> tuple[Data, Finding]:
    time, values = samples.time_s, samples.values
    uniform = not samples.counts
    data = Data(
        time,
        values,
        float(np.median(np.diff(time))),
        uniform,
        np.ones(len(time)),
        time_noise=samples.counts,
        noise_rms=samples.noise_rms,
    )
    find = slips.find_clock if name == "clock-slips" else slips.find_counts
    noise, fit = white_noise(data, 2e-4), fit_of(data)
    finding = find(Evidence(data, fit, noise, samples)) or Finding(name, 1.0)
    return _with(finding, hypothesis_of(fit, data, noise, (), fit, samples)).data, finding


def clocked(swing: Swing, rows: IntArray, sizes: FloatArray, seed: int) -> Samples:
    """Readings by a clock that is ahead of its stamps by whole samples, or parts of them."""
    stamps = np.arange(0.0, 60.0, 1.0 / RATE_HZ)
    late = np.zeros(len(stamps))
    late[rows] = sizes / RATE_HZ
    angle = np.interp(stamps + np.cumsum(late) + 1.0, swing.time_s, swing.angle)
    return Samples(stamps + 1.0, angle + white(seed, len(stamps), 1e-4), "rad", None, 1e-4)


@pytest.mark.parametrize("whole", [True, False])
def test_a_clock_slips_by_whole_samples_or_it_is_no_slip(swing: Swing, whole: bool) -> None:
    random = np.random.default_rng(5)
    rows = np.sort(random.choice(np.arange(200, 3400), 14, replace=False))
    sizes = random.choice([-1.0, 1.0], 14) * (1.0 if whole else random.uniform(0.6, 2.4, 14))
    corrected, finding = found("clock-slips", clocked(swing, rows, sizes, 6))
    if not whole:
        assert finding.p_value > 1e-3
        return
    assert finding.p_value < 1e-5
    # Without the model: the slips are steps of the time in the readings as they are.
    assert finding.confirmed.summary.startswith("14 steps")
    assert finding.parameters["number"].value == 14
    moved = corrected.time_s - (np.arange(len(corrected)) / RATE_HZ + 1.0)
    truth = np.cumsum(np.bincount(rows, sizes, len(corrected))) / RATE_HZ
    assert np.mean(np.abs(moved - moved[0] - truth) > 1e-3) < 0.01


@pytest.mark.parametrize("number", [4, 9, 30])
def test_steps_of_any_size_are_seldom_whole(number: int) -> None:
    sizes = np.random.default_rng(number).uniform(0.5, 3.5, (4000, number))
    rows = np.arange(number)
    p_values = np.array([slips.Slips(rows, each).p_value for each in sizes])
    for level in (0.05, 0.01):
        assert 0.5 * level < np.mean(p_values < level) < 1.5 * level


@pytest.mark.slow
def test_counts_are_lost_from_an_encoder_that_is_read_at_fixed_times(swing: Swing) -> None:
    # Undone in the readings as recorded too: a level one count higher is no end of the range.
    count, random = 2e-3, np.random.default_rng(5)
    rows = np.sort(random.choice(np.arange(200, 3500), 14, replace=False))
    level = np.zeros(len(swing.time_s[::16]))
    level[rows] = random.choice([-1.0, 1.0], len(rows))
    dither = 0.4 * random.standard_normal(len(level))
    angle = count * np.round(swing.angle[::16] / count + dither + np.cumsum(level))
    answer = diagnose_recording(Recording(swing.time_s[::16], angle, "angle_rad"))
    names = {each.identifier: each for each in answer.effects}
    assert {"circular-error", "count-slips"} <= set(names)
    assert set(names) <= {"circular-error", "count-slips", "coarse-quantisation"}
    lost = names["count-slips"].parameters
    assert lost["step"].value == pytest.approx(count, rel=0.02)
    assert abs(lost["number"].value - len(rows)) <= 3


def test_a_count_that_is_lost_and_soon_regained_is_undone_too(swing: Swing) -> None:
    """Two that are seen together only, in 20 and 25 readings of 750 that tell a level."""
    count, random = 2e-3, np.random.default_rng(6)
    time_s, angle = swing.time_s[::16], swing.angle[::16]
    level = np.zeros(len(time_s))
    level[np.sort(random.choice(np.arange(200, 3500), 14, replace=False))] = 1.0
    level[[1500, 2600]], level[[1520, 2625]] = -1.0, 1.0
    dithered = angle / count + 0.3 * random.standard_normal(len(level))
    readings = [count * np.round(dithered + lost) for lost in (np.cumsum(level), 0.0)]
    samples = Samples(time_s, readings[0], "rad", count, 0.3 * count)
    corrected, finding = found("count-slips", samples)
    assert finding.parameters["number"].value == np.count_nonzero(level)
    off = corrected.values - readings[1]
    assert np.mean(np.abs(off - np.median(off)) > 0.5 * count) < 0.005


@pytest.mark.parametrize(("readings", "kept"), [(19, 19), (20, 20), (21, 11), (40, 20), (41, 14)])
def test_of_uneven_readings_every_second_or_third_is_kept_where_they_are_too_many(
    readings: int, kept: int
) -> None:
    """Twice as many as of even ones, at most, and as many as that allows."""
    time_s = np.arange(readings) ** 1.5
    data = gather(
        time_s, time_s, step=None, unit="rad", counts=False, period_s=10.0, noise_rms=0.1, most=10
    )
    assert np.array_equal(data.time_s, time_s[:: data.every])
    assert len(data) == kept
