"""The light says what the misfit does to the numbers, and not how loud it is."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.fit.consequence import unsure
from pendpipe.analysis.fit.result import FitResult
from pendpipe.arrays import FloatArray

OMEGA, LOSS = 6.0, 0.03
TIME = np.arange(0.0, 80.0, 0.02)
PERIOD = 2.0 * math.pi / math.hypot(OMEGA, LOSS)


def viscous(time_s: FloatArray, phase: FloatArray | None = None) -> FloatArray:
    """0.3 rad, Q = omega/(2 b) = 100."""
    turn = OMEGA * time_s if phase is None else phase
    return np.asarray(0.3 * np.exp(-LOSS * time_s) * np.cos(turn))


def fitted(values: FloatArray, rms: float = 1e-4, **options: Any) -> FitResult:
    noise = rms * np.random.default_rng(5).standard_normal(len(values))
    recording = pp.Recording(time_s=TIME[: len(values)], angle_rad=values + noise)
    return pp.fit(recording, restoring="linear", **options)


def test_noise_alone_widens_nothing() -> None:
    fit = fitted(viscous(TIME))
    assert (fit.light, fit.refuted) == ("green", False)
    assert fit.widening == (1.0, 1.0)
    assert {"period", "Q"} <= set(fit.quotable)


def test_a_loud_even_harmonic_of_the_sensor_moves_neither_period_nor_q() -> None:
    """A sensor's x + 0.05 x^2: a hundred times the noise."""
    angle = viscous(TIME)
    fit = fitted(angle + 0.05 * angle**2)
    assert fit.chi2_per_dof > 20.0
    assert fit.refuted
    assert fit.light == "green"
    assert "right to 5 %" in fit.light_reason
    assert "diagnose" in fit.light_reason
    assert abs(fit["Q"].value - 100.0) < 0.5
    assert abs(fit["period"].value / PERIOD - 1.0) < 1e-5
    # chi^2 would have asked for the root of it.
    assert fit.widening.losses < 0.8 * math.sqrt(fit.chi2_per_dof)


def test_a_period_that_drifts_is_quoted_with_an_error_that_covers_it() -> None:
    """A frequency that falls by 0.5 % along the record."""
    drift = 0.005
    phase = OMEGA * TIME * (1.0 - 0.5 * drift * TIME / TIME[-1])
    fit = fitted(viscous(TIME, phase))
    assert fit.refuted
    assert fit.widening.period > 5.0
    assert 0.05 * drift < fit["period"].sd / PERIOD < drift
    parts = fit.period_check[1:]
    assert abs(parts[-1].seen / parts[0].seen - 1.0 - 0.6 * drift) < 0.3 * drift
    assert abs(fit["Q"].value - 100.0) < 5.0


def test_amber_names_what_cannot_be_quoted() -> None:
    fit = fitted(viscous(TIME[:400]), rms=0.01)
    assert fit.light == "amber"
    assert fit.light_reason.startswith("don't quote ")
    assert "Q at" in fit.light_reason
    assert "Q" not in fit.quotable
    assert fit.light_reason in str(fit)


@pytest.mark.parametrize(("p_value", "doubted"), [(0.4, []), (1e-6, [0])])
def test_a_loss_is_doubted_only_where_more_than_noise_is_left(
    p_value: float, doubted: list[int]
) -> None:
    """Turning points 2.6 of their errors, and 8 %, off: chance, unless the law misses something."""
    fit = fitted(viscous(TIME))
    large = fit.decrement_check[0]
    chance = large._replace(seen=large.fitted / 1.08, seen_sd=0.08 * large.fitted / 1.08 / 2.6)
    checks = (chance, *fit.decrement_check[1:])
    off, unseen = unsure(replace(fit, decrement_check=checks, fit_p_value=p_value))
    assert [checks.index(each) for each in off] == doubted
    assert not unseen


def test_small_and_noisy_swings_of_the_law_itself_are_green() -> None:
    """Sixteen decays whose turning points show Q to 3 to 10 %: chance lights nothing."""
    lights = []
    for seed in range(16):
        noise = 2e-3 * np.random.default_rng(seed).standard_normal(len(TIME))
        recording = pp.Recording(time_s=TIME, angle_rad=0.1 * viscous(TIME) / 0.3 + noise)
        lights.append(pp.fit(recording).light)
    assert lights.count("green") >= 15


def test_red_keeps_the_period_and_q_of_the_turning_points() -> None:
    fit = fitted(viscous(TIME), fixed={"b": 2.0 * LOSS})
    assert fit.light == "red"
    assert abs(fit["period"].value / PERIOD - 1.0) < 1e-3
    for each in fit.quality_factors:
        assert abs(each.quality_factor.value - 100.0) < 4.0 * each.quality_factor.sd
    assert "from the turning points alone" in str(fit)
    assert "−dy/dt" not in str(fit)


@pytest.mark.parametrize("b", [LOSS, 2.0 * LOSS])
def test_what_stands_in_fit_json_comes_back(b: float) -> None:
    fit = fitted(viscous(TIME), fixed={"b": b})
    again = FitResult.from_json(fit.to_dict())
    assert again.to_dict() == fit.to_dict()
    assert again.period == fit.period


def test_damping_time_half_life_and_decrement_are_q_in_other_words() -> None:
    found = fitted(viscous(TIME)).damping()
    assert found["damping_time_s"].value == pytest.approx(1.0 / LOSS, rel=2e-3)
    assert found["half_life_s"].value == pytest.approx(math.log(2.0) / LOSS, rel=2e-3)
    assert found["logarithmic_decrement"].value == pytest.approx(LOSS * PERIOD, rel=2e-3)


def test_what_the_clock_leaves_out_is_said_or_enters_the_error() -> None:
    fit = fitted(viscous(TIME))
    assert "one off by 50 ppm adds" in str(fit)
    known = fitted(viscous(TIME), clock_ppm=20.0)
    both = math.hypot(fit["period"].sd, 2e-5 * PERIOD)
    assert known["period"].sd == pytest.approx(both, rel=1e-3)
    assert "50 ppm" not in str(known)


def test_a_scale_that_may_be_off_enters_amplitude_a_and_c_and_the_period_by_sin_x() -> None:
    """The amplitude of the small-angle period's correction A^2/16 is known as well as the scale."""
    plain, wide = (pp.fit("examples/string-pendulum.csv", scale_percent=p) for p in (None, 2.0))
    for name in ("amplitude", "a"):
        sd = math.hypot(plain[name].sd, 0.02 * plain[name].value)
        assert wide[name].sd == pytest.approx(sd)
    assert wide["b"].sd == plain["b"].sd
    moved = math.sqrt(wide["frequency"].sd ** 2 - plain["frequency"].sd ** 2)
    assert moved / plain["frequency"].value == pytest.approx(0.02 * 0.42**2 / 8.0, rel=0.1)
    assert wide.to_dict()["scale_percent"] == 2.0
    with pytest.raises(pp.InputError, match="scale_percent"):
        pp.fit("examples/string-pendulum.csv", scale_percent=-1.0)
