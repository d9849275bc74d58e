"""The paper's route: Eq. 14 and Eq. 8's frequency from turning points."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.analysis.fit.by_points import fit_envelope, fit_points
from pendpipe.analysis.fit.period import fit_period
from pendpipe.analysis.torque import period_excess
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, turning_points
from pendpipe.physics.decay import amplitude

OMEGA = 2.0 * math.pi * 0.516


def table(
    time_s: FloatArray, amplitudes: FloatArray, sd: float, seed: int | None = None
) -> TurningPoints:
    """Turning points on alternating sides, with noise where a seed is given."""
    number = np.arange(len(time_s))
    side = 1.0 - 2.0 * (number % 2)
    noise = 0.0 if seed is None else sd * np.random.default_rng(seed).standard_normal(len(time_s))
    return TurningPoints(
        half_cycle=number,
        time_s=time_s,
        time_sd_s=sd / (OMEGA * amplitudes),
        angle_rad=side * amplitudes + noise,
        angle_sd_rad=np.full(len(time_s), sd),
        level_rad=np.zeros(len(time_s)),
        level_sd_rad=0.1 * sd,
        noise_rms_rad=7.0 * sd,
        start_s=float(time_s[0]) - 0.1,
        samples=30000,
    )


def engine_table(model: Eq8, count: int, sd: float, y0: float = 0.068) -> TurningPoints:
    truth = turning_points(model, Release(0.5, y0), count=count)
    return table(truth.time_s, np.abs(truth.angle_rad), sd)


REGIMES = {
    "all": (0.45, 0.01192, 1.4e-6),
    "quadratic": (0.45, 0.0, 0.0),
    "exponential": (0.0, 0.01192, 0.0),
    "Coulomb, to the stop": (0.0, 0.0, 3e-4),
    "tangent (4 a c > b^2)": (0.45, 0.002, 1e-4),
    "b^2 = 4 a c": (0.4, 0.02, 2.5e-4),
}


@pytest.mark.parametrize("regime", REGIMES)
def test_eq_14_is_recovered_in_every_regime(regime: str) -> None:
    rates = REGIMES[regime]
    time = np.arange(260) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *rates))
    moving = exact > 1e-5
    fit = fit_envelope(table(time[moving], exact[moving], 1e-8))
    assert fit.converged
    assert fit.value[:3] == pytest.approx(rates, rel=1e-4, abs=1e-8)
    assert fit.value[3] == pytest.approx(0.068, rel=1e-5)


def test_pulls_are_standard() -> None:
    time = np.arange(309) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *REGIMES["all"]))
    pulls = []
    for seed in range(300):
        fit = fit_envelope(table(time, exact, 1.4e-5, seed))
        sd = np.sqrt(np.diag(np.linalg.inv(fit.quadratic.normal)))
        pulls.append((fit.value - np.array([*REGIMES["all"], 0.068, 0.0]))[:4] / sd[:4])
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 3.5 / math.sqrt(300))
    assert np.all(np.abs(np.std(pulls, axis=0) - 1.0) < 3.5 / math.sqrt(600))


def test_an_absent_loss_lies_at_its_bound_with_a_one_sided_interval() -> None:
    time = np.arange(200) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, 0.45, 0.0119, 0.0))
    fitted = [fit_points(table(time, exact, 1.4e-5, seed)).parameters["c"] for seed in range(60)]
    ends = [c.interval95 or (math.nan, math.nan) for c in fitted]
    assert all(low >= 0.0 and high > 0.0 for low, high in ends)
    assert sum(low == 0.0 for low, _ in ends) >= 55
    assert 15 <= sum(c.at_bound for c in fitted) <= 45
    assert all((c.value == 0.0) == c.at_bound for c in fitted)


@pytest.mark.parametrize(
    ("model", "leading"),
    [
        (Eq8(OMEGA, viscous=OMEGA / 40.0), 1.0 / (8.0 * 20.0**2)),
        (Eq8(OMEGA, hysteretic=OMEGA / 40.0), math.pi**2 / (32.0 * 20.0**2)),
        (Eq8(OMEGA, coulomb=1e-4), 0.0),
    ],
    ids=["viscous: Eq. 6", "hysteretic", "Coulomb: no shift"],
)
def test_the_period_is_lengthened_as_eq_8_says(model: Eq8, leading: float) -> None:
    truth = turning_points(model, Release(0.0, 0.068), count=2)
    b = model.viscous + model.hysteretic
    share = model.hysteretic / b if b else 0.0
    excess = truth.time_s[1] * OMEGA / math.pi - 1.0
    middle = np.array([0.5 * (0.068 + abs(truth.angle_rad[1]))])
    formula = period_excess(middle, OMEGA, model.quadratic, b, model.coulomb, share)[0]
    assert formula == pytest.approx(leading, abs=1e-15)
    assert excess == pytest.approx(formula, rel=0.01, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    quadratic=st.floats(0.0, 1.0),
    linear=st.floats(0.005, 0.05),
    coulomb=st.floats(0.0, 1e-5),
    share=st.floats(0.0, 1.0),
)
def test_the_frequency_is_eq_8s_and_not_the_shifted_one(
    quadratic: float, linear: float, coulomb: float, share: float
) -> None:
    model = Eq8(OMEGA, quadratic, share * linear, (1.0 - share) * linear, coulomb)
    points = engine_table(model, 60, 1e-9)
    period = fit_period(points, points.amplitude_rad, (quadratic, linear, coulomb), share=share)
    shift = (linear / OMEGA) ** 2 + (quadratic * 0.068 / OMEGA) ** 2
    assert period.angular_frequency / OMEGA - 1.0 == pytest.approx(0.0, abs=0.05 * shift)


def test_the_unknown_share_widens_the_frequency() -> None:
    """At Q = 10 the shift lies between 0.125 % and 0.31 %, either part alone as likely as both."""
    for share in (0.0, 1.0):
        b = OMEGA / 20.0
        points = engine_table(Eq8(OMEGA, 0.0, share * b, (1.0 - share) * b), 12, 1e-9)
        frequency = fit_points(points).parameters["frequency"]
        low, high = frequency.interval95 or (math.nan, math.nan)
        assert low < 0.516 < high
        assert frequency.sd / frequency.value == pytest.approx(0.00117 / math.sqrt(2.0), rel=0.1)


def test_the_unknown_share_widens_the_time_of_release() -> None:
    """By where the line begins with either part of b, and b/(4 omega^2) of a half cycle's shape."""
    b = OMEGA / 20.0
    points = engine_table(Eq8(OMEGA, 0.0, 0.5 * b, 0.5 * b), 12, 1e-9)
    known, viscous, hysteretic, either = (
        fit_period(points, points.amplitude_rad, (0.0, b, 0.0), share=share)
        for share in (0.5, 0.0, 1.0, None)
    )
    ends = [viscous.time_s - known.time_s, hysteretic.time_s - known.time_s]
    shape = b / (4.0 * OMEGA**2)
    # An arcsine law's variance is half of the square of its end.
    added = 0.5 * (max(np.abs(ends)) ** 2 + shape**2)
    assert shape > 0.2 * max(np.abs(ends))
    found = either.covariance[1, 1] - known.covariance[1, 1]
    assert found == pytest.approx(added, rel=0.03)


def test_the_level_error_does_not_reach_the_rates() -> None:
    """A level 5 sd off shifts the halves apart; a, b, c stay, and the offset is mended."""
    time = np.arange(309) * (math.pi / OMEGA)
    points = table(time, np.asarray(amplitude(time, 0.068, *REGIMES["all"])), 1e-5)
    error = 5e-6
    shifted = TurningPoints(
        **{
            **points.__dict__,
            "angle_rad": points.angle_rad - error * points.level_coupling,
            "level_rad": points.level_rad + error,
            "level_sd_rad": error,
        }
    )
    result = fit_points(shifted)
    for name, rate in zip("abc", REGIMES["all"], strict=True):
        estimate = result.parameters[name]
        assert abs(estimate.value - rate) < 0.05 * estimate.sd
    assert abs(result.value("offset")) < 0.05 * error


def test_held_parameters_stay() -> None:
    time = np.arange(200) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *REGIMES["all"]))
    points = table(time, exact, 1e-5, seed=1)
    result = fit_points(points, fixed={"b": 0.0125, "frequency": 0.52, "offset": 1e-5})
    assert result.value("b") == 0.0125
    assert result.parameters["b"].sd == 0.0
    assert result.value("frequency") == pytest.approx(0.52)
    assert result.value("offset") == pytest.approx(1e-5)
    assert result.chi2_per_dof > 1.5
    viscous = fit_points(points, baseline="viscous")
    assert viscous.value("a") == viscous.value("c") == 0.0


def test_a_tail_is_called_a_tail() -> None:
    """The paper's warning: of a tail alone, a can't be told, and the fit says so."""
    time = np.arange(309) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *REGIMES["all"]))
    tail = fit_points(table(time[250:], exact[250:], 1.4e-5, seed=3))
    whole = fit_points(table(time, exact, 1.4e-5, seed=3))
    assert any("(a tail)" in warning for warning in tail.warnings)
    assert not any("(a tail)" in warning for warning in whole.warnings)


def test_no_exponential_loss_no_quality_factor() -> None:
    time = np.arange(200) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, 0.45, 0.0, 1e-4))
    result = fit_points(table(time, exact, 1e-7), fixed={"b": 0.0})
    assert result.quality_factor_limit is None
    assert any("quality_factor_limit" in warning for warning in result.warnings)
    assert result.to_dict()["quality_factor_limit"]["value"] != 0.0
