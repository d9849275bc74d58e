"""Which codes come: coarser lattices, combs, and what is neither."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.forensics import TESTS, Finding
from pendpipe.diagnose.forensics.combs import worst_comb
from pendpipe.diagnose.forensics.lattice import with_true_step
from pendpipe.diagnose.run import diagnose_recording
from pendpipe.recording import Recording

from .decays import fitted
from .faults import AIR, STEP_16, white


@pytest.fixture(scope="module")
def code() -> FloatArray:
    """Codes of a good converter, its noise a step and a quarter."""
    clean = AIR.model().reading(AIR.values())
    noisy = clean + white(np.random.default_rng(71), AIR.count)
    return np.asarray(np.round(noisy / STEP_16))


def asked(readings: FloatArray, name: str) -> Finding:
    """One test, where the file says what the converter's step is."""
    record = fitted(AIR, readings)
    samples = with_true_step(replace(record.samples, step=STEP_16, promised_step=None))
    return TESTS[name](record.data, record.fit, record.noise, samples)


@pytest.mark.parametrize("dead", [1, 2, 3])
def test_bits_that_do_not_move_make_a_coarser_step(dead: int, code: FloatArray) -> None:
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


@pytest.mark.parametrize("period", [4, 16, 64])
def test_a_comb_of_missing_codes_is_no_coarser_step(period: int, code: FloatArray) -> None:
    """No single code may be due often enough; all of them together are."""
    readings = STEP_16 * (code + (code % period == 3))
    finding = asked(readings, "missing-codes")
    assert finding.p_value < 1e-6
    assert finding.parameters["period"].value == period
    assert finding.parameters["found"].value == 0.0
    assert all(each % period == 3 for each in finding.location.adc_codes)
    assert asked(readings, "coarse-quantisation").kind == "property"


def test_a_good_converters_codes_lie_on_its_own_lattice(code: FloatArray) -> None:
    record = fitted(AIR, STEP_16 * code)
    assert with_true_step(record.samples) is record.samples
    assert asked(STEP_16 * code, "missing-codes").p_value > 1e-3


def test_combs_that_chance_makes_are_as_rare_as_they_say() -> None:
    """Codes drawn at random from where they are due."""
    generator, seldom = np.random.default_rng(5), 0
    due = np.pad(np.full((3, 398), 8000 / 398), ((0, 0), (1, 1)))
    for _ in range(200):
        codes = generator.integers(1, 399, 8000)
        codes[:2] = 1, 398
        seldom += worst_comb(codes, due).p_value < 0.05
    # Ten are due at most, since residues of two periods share their codes.
    assert seldom <= binom.isf(1e-3, 200, 0.05)


def test_one_stuck_bit_is_told_as_either(code: FloatArray) -> None:
    time = AIR.times()
    readings = STEP_16 * 2.0 * np.floor(code / 2.0)
    record = Recording(time, readings, "angle_rad", resolution=STEP_16)
    effect = diagnose_recording(record).diagnosis.effects[0]
    assert effect.identifier == "coarse-quantisation"
    ((other, probability),) = effect.indistinguishable
    assert other == "missing-codes"
    assert probability == effect.probability < 0.5
