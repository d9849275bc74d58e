"""The half derivative of a sine that begins at rest is made of Fresnel's integrals."""

import math

import numpy as np
import pytest
from scipy.special import fresnel

from pendpipe.dynamics.any_law import Clock, Motion
from pendpipe.dynamics.half_derivative import half_derivative

OMEGA = 5.0


def steady(half_cycles: int) -> Motion:
    """cos(omega t)."""
    clock = Clock(half_cycles, 24)
    return Motion(clock, OMEGA, np.zeros_like(clock.psi), clock.psi / OMEGA)


@pytest.mark.parametrize(("half_cycles", "first"), [(1, 0), (2, 1), (3, 0), (40, 7), (2001, 0)])
def test_a_sine_from_rest(half_cycles: int, first: int) -> None:
    """D^(1/2) sin(w t) = sqrt(2 w) [cos(w t) C(z) + sin(w t) S(z)], z = sqrt(2 w t/pi)."""
    motion = steady(half_cycles)
    phase = motion.clock.psi[first:] - math.pi * first
    s, c = fresnel(np.sqrt(2.0 * phase / math.pi))
    sign = -1.0 if first % 2 else 1.0
    exact = -sign * OMEGA * math.sqrt(2.0 * OMEGA) * (np.cos(phase) * c + np.sin(phase) * s)
    found = half_derivative(motion, first)
    assert np.all(found[:first] == 0.0)
    assert found[first:] == pytest.approx(exact, abs=1e-5 * OMEGA**1.5)


def test_long_after_the_release_friction_and_added_mass_remain() -> None:
    """D^(1/2) e^(i w t) is sqrt(i w) e^(i w t): a half derivative leads by an eighth of a turn."""
    motion = steady(4001)
    expected = -(OMEGA**1.5) * np.sin(motion.clock.psi[-1] + 0.25 * math.pi)
    # The release fades with 1/t^(3/2).
    assert half_derivative(motion)[-1] == pytest.approx(expected, abs=1e-5 * OMEGA**1.5)
