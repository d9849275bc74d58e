"""Readings against a model, along the motion: amplitude and phase, turns counted."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.diagnosis.unwrapped import alignment, anchored, unwrapped
from pendpipe.effects.baseline import OMEGA, TIME, B
from pendpipe.effects.model import Model

from .records import INTERVAL_S, TIME_S, TRUTH, null_fit, prepared, white


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
