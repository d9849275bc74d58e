"""Cycles of a motion: each reading counts once, whatever its phase does."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pendpipe.analysis.demodulation import by_cycle, cycle_starts, normal_equations


@given(
    st.lists(st.floats(-4.0, 9.0), min_size=2, max_size=60).filter(lambda steps: sum(steps) > 0.0),
    st.integers(1, 3),
)
def test_each_reading_is_in_one_cycle_also_where_the_phase_falls_back(
    steps: list[float], cycles: int
) -> None:
    """A clock that steps back, or a trial motion that is hardly resolved, begins no cycle again."""
    phase = np.cumsum(steps)
    starts = cycle_starts(phase, cycles)
    ones = np.ones(len(phase))
    gram, _ = normal_equations(ones[None], ones, starts)
    assert gram.sum() == pytest.approx(len(phase))


def test_a_cosine_is_the_cosine_of_each_cycle() -> None:
    phase = np.linspace(0.0, 20.0 * np.pi, 1000, endpoint=False)
    found, rest = by_cycle(2.0 * np.cos(phase), phase, harmonics=2)
    cosine = np.sqrt(0.5 * 100) * 2.0  # a unit vector of 100 readings has the peak sqrt(2/100)
    assert found[:, 1] == pytest.approx(np.full(10, cosine))
    assert np.delete(found, 1, axis=1) == pytest.approx(np.zeros((10, 4)), abs=1e-9)
    assert rest == pytest.approx(np.zeros(1000), abs=1e-9)
