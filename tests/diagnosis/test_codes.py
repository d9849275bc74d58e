"""Which codes occur: coarser lattices, combs, and neither."""

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.codes import spacing_of, with_true_step
from pendpipe.diagnosis.forensics.converter import worst_comb
from pendpipe.diagnosis.result import Finding
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.recording import Recording

from .decays import fitted, rounded
from .examine import TESTS
from .faults import AIR, STEP_16, white


@pytest.fixture(scope="module")
def code() -> FloatArray:
    """Codes of a good converter, its noise a step and a quarter."""
    clean = AIR.model().reading(AIR.values())
    noisy = clean + white(np.random.default_rng(71), AIR.count)
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
    noise = times * white(np.random.default_rng(72), AIR.count)
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
