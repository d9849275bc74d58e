"""The misfit beyond the noise, and its consequences for names and errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.remainder import Remainder, remainder_of
from pendpipe.diagnosis.values import parameters_of
from pendpipe.effects.model import Model

from .records import INTERVAL_S, NOISE_RAD, TIME_S, TRUTH, null_fit, other_engine, prepared, white


def left_by(extra: FloatArray) -> tuple[Fit, Remainder]:
    """Eq. 8 fitted to itself, noise, and something more."""
    data, noise = prepared(other_engine(TRUTH) + white(4) + extra)
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    return fit, remainder_of(fit, data, noise)


def test_noise_alone_leaves_nothing_and_enlarges_no_error() -> None:
    found = remainder_of(*null_fit())
    assert not found.systematic
    assert found.error_scale == 1.0
    assert found.over_noise == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * len(TIME_S)))


@pytest.mark.parametrize(
    ("where", "extra"),
    [
        ("harmonics", 4e-4 * np.cos(3.0 * 2.0 * np.pi * 0.9 * TIME_S)),
        ("offset", 6e-4 * np.sin(2.0 * np.pi * 0.02 * TIME_S)),
        ("between", 4e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S)),
    ],
)
def test_the_misfit_is_located_where_it_was_put(where: str, extra: FloatArray) -> None:
    """Its mean square adds to the noise's, and nine tenths of it are there."""
    _, found = left_by(extra)
    expected = math.sqrt(1.0 + np.mean(extra**2) / NOISE_RAD**2)
    assert found.systematic
    assert found.over_noise == pytest.approx(expected, rel=0.05)
    assert found.shares[where] > 0.9
    assert sum(found.shares.values()) == pytest.approx(1.0)


def test_errors_grow_with_what_is_left_and_one_line_is_few_numbers() -> None:
    _, small = left_by(4e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    _, large = left_by(8e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    assert large.error_scale == pytest.approx(2.0 * small.error_scale, rel=0.2)
    assert small.error_scale > small.over_noise
    assert large.numbers < 30.0


def test_a_misfit_widens_intervals_as_much_as_standard_deviations() -> None:
    fit, found = left_by(1e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    narrow = parameters_of(fit, "rad")
    wide = parameters_of(replace(fit, error_scale=found.error_scale), "rad")
    assert found.error_scale > 5.0
    for name in ("a", "b", "c"):
        assert wide[name].sd == pytest.approx(found.error_scale * narrow[name].sd)
        # A bound that another rate meets cuts a little of a wide interval.
        ratio = np.ptp(wide[name].interval95) / np.ptp(narrow[name].interval95)
        assert 0.8 * found.error_scale < ratio <= 1.001 * found.error_scale
