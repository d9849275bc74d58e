"""Readings that fall behind at the ends of the range."""

import numpy as np
import pytest

from pendpipe.effects.catalogue.reading import SoftClipping
from pendpipe.effects.model import Model

from .pendulums import Floats, baseline, plain, times

TIME = times(60.0, 0.04)
BASE = baseline(b=0.01)
OWN = plain(BASE, TIME)


def clipped(upper: float, lower: float, width: float) -> Floats:
    model = Model(TIME, 0.04, (SoftClipping(),))
    return model.reading(np.concatenate([BASE, [upper, lower, width]]))


@pytest.mark.parametrize("width", [2e-4, 2e-3, 1.5e-2])
def test_it_is_a_range_that_ends_smoothly(width: float) -> None:
    """Its law is y = L - w ln(1 + e^((L - x)/w)), with L where the largest angle loses d."""
    depth, top = 2e-3, OWN.max()
    level = top - width * np.log(np.expm1(depth / width))
    expected = level - width * np.logaddexp(0.0, (level - OWN) / width)
    np.testing.assert_allclose(clipped(depth, 0.0, width), expected, 0.0, 1e-9)


def test_narrow_it_is_a_flat_top() -> None:
    found = clipped(3e-3, 5e-3, 1e-7)
    np.testing.assert_allclose(found, np.clip(OWN, OWN.min() + 5e-3, OWN.max() - 3e-3), 0.0, 1e-6)


def test_the_largest_angle_loses_its_depth_and_the_middle_nothing() -> None:
    lost = OWN - clipped(1e-3, 0.0, 4e-3)
    assert lost[np.argmax(OWN)] == pytest.approx(1e-3, rel=1e-9)
    assert np.all(lost >= 0.0)
    assert np.all(lost[np.abs(OWN) < 0.05] < 1e-11)
