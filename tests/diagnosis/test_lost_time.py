"""A clock that jumps moves angle and velocity along one path; a knock or an offset does not."""

import math
import re

import numpy as np
import pytest

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.lost_samples import loss_confirmed
from pendpipe.diagnosis.result import Confirmation

OMEGA, LOSS, AT = 5.3, 0.006, 31.0
PERIOD_S = 2.0 * math.pi / OMEGA
STAMPS = np.arange(6000) / 100.0


def swing(time_s: FloatArray) -> FloatArray:
    return np.asarray(0.4 * np.exp(-LOSS * time_s) * np.cos(OMEGA * time_s))


def second_test(angle: FloatArray, seed: int) -> Confirmation:
    noise = 2e-4 * np.random.default_rng(seed).standard_normal(len(angle))
    return loss_confirmed(Samples(STAMPS, angle + noise, "rad", None, 2e-4), AT + 0.02, PERIOD_S)


@pytest.mark.parametrize("lost_s", [0.03, -0.05, 0.07])
def test_a_jump_of_the_clock_is_confirmed_and_its_size_told(lost_s: float) -> None:
    found = second_test(swing(STAMPS + np.where(STAMPS >= AT, lost_s, 0.0)), 1)
    assert found.p_value < 1e-3
    for value, sd in re.findall(r"by (\S+) ± (\S+) ms", found.summary):
        assert abs(float(value) - 1e3 * lost_s) < 4.0 * float(sd) + 0.02 * abs(1e3 * lost_s)


def test_neither_a_knock_nor_an_offset_nor_nothing_is_a_jump_of_the_clock() -> None:
    after = np.where(STAMPS >= AT, STAMPS - AT, 0.0)
    knock = 0.05 * np.exp(-LOSS * after) * np.sin(OMEGA * after)
    offset = np.where(STAMPS >= AT, 0.02, 0.0)
    for change in (knock, offset, 0.0 * after):
        assert min(second_test(swing(STAMPS) + change, seed).p_value for seed in range(5)) > 1e-3


def test_too_few_readings_say_nothing() -> None:
    samples = Samples(STAMPS[::20], swing(STAMPS[::20]), "rad", None, 1e-4)
    assert loss_confirmed(samples, AT, PERIOD_S).p_value == 1.0
