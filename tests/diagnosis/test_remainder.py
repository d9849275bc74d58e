"""The misfit beyond the noise, and its consequences for names and errors."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.remainder import Remainder, remainder_of, with_errors
from pendpipe.diagnosis.values import constants_of
from pendpipe.effects.baseline import OMEGA, TIME, A, B, C
from pendpipe.effects.model import Model
from pendpipe.estimate import Z95

from .records import INTERVAL_S, NOISE_RAD, TIME_S, TRUTH, null_fit, other_engine, prepared, white


def left_by(extra: FloatArray) -> tuple[Fit, Remainder]:
    """Eq. 8 fitted to itself, noise, and something more."""
    data, noise = prepared(other_engine(TRUTH) + white(4) + extra)
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    return fit, remainder_of(fit, data, noise)


def test_noise_alone_leaves_nothing_and_enlarges_no_error() -> None:
    found = remainder_of(*null_fit())
    assert not found.systematic
    assert found.error_scale == 1.0
    assert found.over_noise == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * len(TIME_S)))


@pytest.mark.parametrize(
    ("where", "extra"),
    [
        ("harmonics", 4e-4 * np.cos(3.0 * 2.0 * np.pi * 0.9 * TIME_S)),
        ("offset", 6e-4 * np.sin(2.0 * np.pi * 0.02 * TIME_S)),
        ("between", 4e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S)),
    ],
)
def test_the_misfit_is_located_where_it_was_put(where: str, extra: FloatArray) -> None:
    """Its mean square adds to the noise's, and nine tenths of it are there."""
    _, found = left_by(extra)
    expected = math.sqrt(1.0 + np.mean(extra**2) / NOISE_RAD**2)
    assert found.systematic
    assert found.over_noise == pytest.approx(expected, rel=0.05)
    assert found.shares[where] > 0.9
    assert sum(found.shares.values()) == pytest.approx(1.0)


def test_errors_grow_with_what_is_left_and_one_line_is_few_numbers() -> None:
    _, small = left_by(4e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    _, large = left_by(8e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    assert large.error_scale == pytest.approx(2.0 * small.error_scale, rel=0.2)
    assert small.error_scale > small.over_noise
    assert large.numbers < 30.0


def of_a_cycle(wave: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A smooth random function of eight numbers, times a wave."""
    x = (np.arange(len(wave)) + 0.5) / len(wave)
    modes = np.cos(np.pi * np.arange(8)[:, None] * x)
    return np.asarray(3.0 * NOISE_RAD * (rng.standard_normal(8) @ modes) * wave)


@pytest.mark.parametrize(
    ("part", "moved", "still"),
    [
        ("amplitude", (A, B, C), (OMEGA, TIME)),
        ("phase", (OMEGA, TIME), (A, B, C)),
        ("harmonics", (), (A, B, C)),
    ],
)
def test_errors_are_those_that_a_random_misfit_of_one_part_makes(
    part: str, moved: tuple[int, ...], still: tuple[int, ...]
) -> None:
    """To first order the values move by J^+ r: against the errors stated for each draw."""
    fit, data, noise = null_fit()
    turned = fit.at.sampled.phase
    wave = {"amplitude": np.cos(turned), "phase": np.sin(turned), "harmonics": np.cos(3 * turned)}
    solve = np.linalg.pinv(fit.jacobian[:, fit.free])
    rng, pulls, widened = np.random.default_rng(7), [], []
    for seed in range(80):
        more = of_a_cycle(wave[part], rng) + white(seed)
        residual = np.append(noise.whiten(more), 0.0)
        here = replace(fit, evaluation=replace(fit.evaluation, residual=residual))
        found = with_errors(here, replace(data, values=fit.at.reading + more), noise)
        widened.append(np.sqrt(np.diag(found.covariance())[list(fit.free)]))
        pulls.append(solve @ residual / widened[-1])
    scatter = dict(zip(fit.free, np.std(pulls, axis=0), strict=True))

    assert max(scatter.values()) < 1.35
    assert all(scatter[index] > 0.6 for index in moved)
    noise_alone = np.sqrt(np.diag(fit.covariance())[list(fit.free)])
    wider = dict(zip(fit.free, np.median(widened, axis=0) / noise_alone, strict=True))
    assert all(wider[index] > 10.0 for index in moved)
    assert all(wider[index] < 5.0 for index in still)


@pytest.mark.parametrize("harmonic_rad", [2e-4, 4e-4])
def test_intervals_far_from_a_bound_are_those_of_the_errors(harmonic_rad: float) -> None:
    """Derivatives by the frequency are 1e8 times those by the share: no direction is lost."""
    extra = harmonic_rad * np.cos(3.0 * 2.0 * np.pi * 0.9 * TIME_S)
    data, noise = prepared(other_engine(TRUTH) + white(4) + extra)
    fit = with_errors(refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH), data, noise)
    for estimate in constants_of(fit, "rad").values():
        assert np.ptp(estimate.bounds95) == pytest.approx(2.0 * Z95 * estimate.sd, rel=0.01)
