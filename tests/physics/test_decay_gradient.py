"""The derivatives of Eq. 14 against those of its implicit relation, at many digits."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pendpipe.physics import amplitude, amplitude_and_gradient, stopping_time, time_at


def solution(t: mp.mpf, y0: mp.mpf, a: mp.mpf, b: mp.mpf, c: mp.mpf) -> mp.mpf:
    """Eq. 14 as the fraction of two solutions of the linear system, in mpmath."""
    r = mp.sqrt(mp.mpc(b * b - 4 * a * c))
    even = mp.cosh(r * t / 2)
    odd = 2 * mp.sinh(r * t / 2) / r if r != 0 else t
    return mp.re((y0 * even - (b * y0 / 2 + c) * odd) / (even + (a * y0 + b / 2) * odd))


def slow_gradient(t: float, arguments: tuple[float, ...]) -> list[float]:
    """Central differences with a step of 1e-50 at 160 digits."""
    gradient = []
    with mp.workdps(160):
        for index, value in enumerate(arguments):
            step = mp.mpf(10) ** -50 * (mp.mpf(value) or mp.mpf(10) ** -6)
            ends = []
            for sign in (1, -1):
                moved = [mp.mpf(argument) for argument in arguments]
                moved[index] += sign * step
                ends.append(solution(mp.mpf(t), *moved))
            gradient.append(float((ends[0] - ends[1]) / (2 * step)))
    return gradient


decades = st.floats(-10, 2).map(lambda power: 10.0**power)
rates = st.tuples(*[st.one_of(st.just(0.0), decades)] * 3)


@given(
    y0=st.floats(-6, 0).map(lambda power: 10.0**power), abc=rates, fraction=st.floats(1e-6, 0.999)
)
@settings(max_examples=200)
def test_gradient_over_many_decades(
    y0: float, abc: tuple[float, float, float], fraction: float
) -> None:
    end = float(stopping_time(y0, *abc))
    t = fraction * (end if np.isfinite(end) else float(time_at(1e-20 * y0, y0, *abc)))
    assume(np.isfinite(t) and 0.0 < t < 1e25)
    y, gradient = amplitude_and_gradient(t, y0, *abc)
    assert y == amplitude(t, y0, *abc)
    np.testing.assert_allclose(gradient, slow_gradient(t, (y0, *abc)), rtol=1e-11)


@pytest.mark.parametrize("nearness", [-1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-9, 1e-3])
def test_gradient_is_smooth_through_r_equal_zero(nearness: float) -> None:
    a, b = 0.5, 0.02
    arguments = (0.05, a, b, b * b / (4 * a) * (1.0 + nearness))
    _, gradient = amplitude_and_gradient(40.0, *arguments)
    np.testing.assert_allclose(gradient, slow_gradient(40.0, arguments), rtol=1e-12)


def test_gradient_vanishes_after_the_stop() -> None:
    stop = float(stopping_time(0.068, 0.45, 0.0119, 1.4e-6))
    _, gradient = amplitude_and_gradient([0.9 * stop, 1.1 * stop], 0.068, 0.45, 0.0119, 1.4e-6)
    assert gradient.shape == (2, 4)
    assert gradient[0, 0] > 0.0
    assert np.all(gradient[0, 1:] < 0.0)
    np.testing.assert_array_equal(gradient[1], 0.0)


def test_gradient_broadcasts_like_the_amplitude() -> None:
    y, gradient = amplitude_and_gradient(
        np.arange(1.0, 4.0)[:, None], [0.1, 0.2], [0.0, 1.0], 0.0, [0.01, 0.03]
    )
    assert y.shape == (3, 2)
    assert gradient.shape == (3, 2, 4)
    _, single = amplitude_and_gradient(3.0, 0.2, 1.0, 0.0, 0.03)
    np.testing.assert_allclose(gradient[2, 1], single, rtol=1e-15)
