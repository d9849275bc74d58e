"""Which loss takes how much, as far as a fit tells it."""

from __future__ import annotations

import numpy as np

import pendpipe as pp
from pendpipe.analysis.fit.result import qualities


def decay(lasts_s: float, noise_rad: float) -> pp.Recording:
    """Viscous: 0.3 rad, omega 6 1/s, b 0.03 1/s."""
    time_s = np.arange(0.0, lasts_s, 0.02)
    noise = noise_rad * np.random.default_rng(2).standard_normal(len(time_s))
    angle_rad = 0.3 * np.exp(-0.03 * time_s) * np.cos(6.0 * time_s) + noise
    return pp.Recording(time_s=time_s, angle_rad=angle_rad)


def test_a_long_decay_tells_which_loss_takes_it() -> None:
    """It falls to a fiftieth: drag and dry friction would have taken it otherwise."""
    fit = pp.fit(decay(130.0, 1e-4), restoring="linear")
    for each in qualities(fit):
        assert each.share.sd < 0.05
        assert abs(each.share.value - 1.0) < 3.0 * each.share.sd + 0.01
        assert each.cause.endswith("% viscous and hysteretic loss (b)")


def test_six_swings_tell_the_loss_but_not_which() -> None:
    fit = pp.fit(decay(6.0, 2e-3), restoring="linear")
    for each in qualities(fit):
        # pi f/b, whichever loss it is.
        assert abs(each.quality_factor.value - 100.0) < 4.0 * each.quality_factor.sd
        assert each.share.sd > 0.15
        assert "does not tell apart" in each.cause
    assert "does not tell apart" in str(fit)
