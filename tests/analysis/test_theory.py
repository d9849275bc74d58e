"""Theory stands beside a pendulum that has a sphere in its fluid, and beside no other."""

import numpy as np
import pytest

from pendpipe.analysis.compare import theory_curve
from pendpipe.physics import Fluid, Rod, Sphere

WATER = Fluid(998.0, 1.0e-3), 9.81
ROD = Rod(0.2, 0.8, 0.3)
BALL = Sphere(0.3, 0.02, 0.7, submerged=True)


def test_the_history_term_divides_q_by_one_and_a_over_delta() -> None:
    curve = theory_curve([ROD, BALL], *WATER)
    delta = np.sqrt(2.0 * 1.0e-3 / (998.0 * 2.0 * np.pi * curve["frequency_hz"]))
    assert curve["a_over_delta"] == pytest.approx(0.02 / delta)
    ratio = curve["quality_factor_viscous_steady"] / curve["quality_factor_viscous_theory"]
    assert ratio == pytest.approx(1.0 + curve["a_over_delta"])
    # Added mass and buoyancy both lengthen the period, and together more.
    parts = curve["lengthening_buoyancy"], curve["lengthening_added_mass"]
    assert 0.0 < max(parts) < curve["lengthening_both"]


def test_without_a_submerged_sphere_there_is_no_theory() -> None:
    assert theory_curve([ROD, Sphere(0.3, 0.02, 0.7)], *WATER) is None
    assert theory_curve([ROD], *WATER) is None
