"""The last cycles are judged by the scatter of all spans of cycles before them."""

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import SmallSwings, small_swings

from .records import TIME_S, TRUTH, null_fit, other_engine, prepared, white


def judged(late_s: FloatArray) -> SmallSwings:
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
    found = judged(bend(share))
    assert found.significant
    assert found.excess == pytest.approx(-share, abs=3.0 * found.excess_sd)
    assert 0.04 < found.amplitude < 0.06


def test_a_frequency_that_wavers_anyway_makes_the_last_cycles_uncertain() -> None:
    """Wherever among the others it wavers; a calm one is known by its noise."""
    calm, wavering = judged(bend(0.0)), judged(waver(0.02))
    assert wavering.excess == calm.excess
    assert calm.excess_sd < 1e-4
    # An amplitude of 0.02 s in a period of 8 s makes 1.1 % rms, in two fifths of the spans.
    slope = 0.02 * 2.0 * np.pi / 8.0 / np.sqrt(2.0) * np.sqrt(0.4)
    assert wavering.excess_sd == pytest.approx(slope, rel=0.4)
    assert not judged(waver(0.02) + bend(1e-2)).significant
