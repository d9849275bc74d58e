"""The noise of the readings: its variance and colour, whatever the motion's misfit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import idct
from scipy.signal import lfilter
from scipy.stats import binom

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.colour import fit_colour
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise, estimate_noise, white_noise

COUNT, INTERVAL_S, MOTION_HZ = 1500, 1.0 / 15.0, 0.9
FREQUENCY_HZ = np.arange(COUNT) / (2.0 * COUNT * INTERVAL_S)


def data_of(readings: FloatArray) -> Data:
    times = np.arange(len(readings)) * INTERVAL_S
    return Data(times, readings, INTERVAL_S, True, np.ones(len(readings)))


def estimated(readings: FloatArray) -> Noise:
    return estimate_noise(data_of(readings), readings, MOTION_HZ, 0.0)


def white(generator: np.random.Generator) -> FloatArray:
    return 2.5e-4 * generator.standard_normal(COUNT)


def red(generator: np.random.Generator) -> FloatArray:
    """Spectrum 1 + 8 (0.05 Hz/f)^1.5 over the white part."""
    spectrum = 1.0 + 8.0 * (0.05 / np.maximum(FREQUENCY_HZ, FREQUENCY_HZ[1])) ** 1.5
    cosines = np.sqrt(spectrum) * generator.standard_normal(COUNT)
    return np.asarray(2.5e-4 * idct(cosines, norm="ortho"))


def low_pass(generator: np.random.Generator) -> FloatArray:
    """First-order memory of 0.4."""
    made = lfilter([1.0], [1.0, -0.4], generator.standard_normal(COUNT + 50))
    return np.asarray(2.5e-4 * made[50:])


@given(st.integers(0, 2**32 - 1), st.booleans(), st.integers(2, 60))
def test_weights_of_readings_are_the_transpose_of_whitening(
    seed: int, uniform: bool, count: int
) -> None:
    """<W x, y> = <x, W^T y>, masks included."""
    generator = np.random.default_rng(seed)
    weight = (generator.random(count) > 0.2).astype(float)
    noise = Noise(generator.uniform(0.1, 9.0, count), uniform, 1.0, weight)
    x, y = generator.standard_normal((2, count, 3))
    left, right = noise.whiten(x).T @ y, x.T @ noise.adjoint(y)
    np.testing.assert_allclose(left, right, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(noise.whiten(x[:, 0]), noise.whiten(x)[:, 0], atol=1e-12)
    np.testing.assert_allclose(noise.adjoint(y[:, 0]), noise.adjoint(y)[:, 0], atol=1e-12)


@pytest.mark.parametrize("made", [white, red, low_pass])
def test_noise_of_any_colour_is_made_white(
    made: Callable[[np.random.Generator], FloatArray],
) -> None:
    """Its whitened cosines have unit variance in every octave from 0.1 Hz up."""
    records = [made(np.random.default_rng(seed)) for seed in range(10)]
    squares = np.array([estimated(readings).whiten(readings) ** 2 for readings in records])
    for low in (0.1, 0.2, 0.4, 0.8, 1.6, 3.2):
        octave = (low <= FREQUENCY_HZ) & (2.0 * low > FREQUENCY_HZ)
        inside = squares[:, octave]
        assert inside.mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / inside.size))


def test_white_noise_is_taken_for_red_no_more_often_than_by_chance() -> None:
    """Two parameters more gain 4 in -2 ln L with a probability of exp(-2) at most."""
    count = 30
    found = [estimated(white(np.random.default_rng(seed))) for seed in range(count)]
    assert sum(noise.red > 0.0 for noise in found) <= binom.ppf(0.999, count, np.exp(-2.0))
    assert sum(noise.memory != 0.0 for noise in found) <= binom.ppf(0.999, count, 6e-4)


def test_red_noise_is_recognised() -> None:
    found = [estimated(red(np.random.default_rng(seed))) for seed in range(8)]
    assert all(noise.red > 0.0 for noise in found)
    assert np.mean([noise.slope for noise in found]) == pytest.approx(1.5, abs=0.25)


def test_red_noise_below_a_corner_is_not_taken_for_flat() -> None:
    """A few slow cosines that are small by chance make the slowest no effect: red noise rises."""
    power = np.random.default_rng(8).chisquare(1.0, 3500)[1:]
    frequency = np.arange(1, 3500) / (2.0 * 3500 * 0.178)
    slow = frequency <= 0.05
    power[slow] *= 2.7
    power[0], power[1:8] = 170.0, 0.3
    colour = fit_colour(power, frequency, 0.178)
    spectrum = colour.spectrum(frequency, 0.178)
    assert colour.red > 0.0
    assert spectrum[0] > 1.5 * spectrum[slow][-1]


def test_a_low_pass_is_recognised_by_its_memory() -> None:
    """Its sampling error is that of a correlation, ((1 - m^2)/n)^(1/2), bands left out apart."""
    found = [estimated(low_pass(np.random.default_rng(seed))).memory for seed in range(8)]
    error = np.sqrt((1.0 - 0.4**2) / (0.8 * COUNT))
    assert np.abs(np.array(found) - 0.4).max() < 4.0 * error


def test_a_red_part_may_be_forbidden() -> None:
    readings = red(np.random.default_rng(1))
    noise = estimate_noise(data_of(readings), readings, MOTION_HZ, 0.0, red=False)
    assert noise.red == 0.0


def test_a_misfit_about_the_harmonics_is_not_noise() -> None:
    """A misfit three times the noise, that comes and goes, changes the estimate by 1 % at most."""
    readings = white(np.random.default_rng(5))
    times = np.arange(COUNT) * INTERVAL_S
    swell = np.sin(np.pi * times / times[-1]) ** 2
    misfit = 7.5e-4 * swell * np.cos(2.0 * np.pi * MOTION_HZ * times)
    misfit += 4e-4 * swell * np.cos(4.0 * np.pi * MOTION_HZ * times)
    assert estimated(readings + misfit).rms == pytest.approx(estimated(readings).rms, rel=0.01)


@pytest.mark.parametrize("scale", [1e-9, 0.3, 1e3])
def test_the_noise_follows_the_unit(scale: float) -> None:
    readings = white(np.random.default_rng(7))
    assert estimated(scale * readings).rms == pytest.approx(
        scale * estimated(readings).rms, rel=1e-3
    )


def test_the_noise_is_never_below_the_floor() -> None:
    readings = white(np.random.default_rng(8))
    noise = estimate_noise(data_of(readings), readings, MOTION_HZ, 1e-2)
    assert noise.rms == pytest.approx(1e-2)


def test_outliers_of_uneven_readings_do_not_make_the_noise() -> None:
    readings = white(np.random.default_rng(9))
    readings[::50] += 0.1
    data = Data(np.arange(COUNT) * INTERVAL_S, readings, INTERVAL_S, False, np.ones(COUNT))
    noise = estimate_noise(data, readings, MOTION_HZ, 0.0)
    assert noise.rms == pytest.approx(2.5e-4, rel=0.12)


def test_a_counter_errs_in_time_so_its_angles_err_where_it_is_fast() -> None:
    times = np.arange(COUNT) * INTERVAL_S
    speed = np.cos(2.0 * np.pi * MOTION_HZ * times)
    variance = white_noise(data_of(speed), 1e-3, speed).variance
    assert variance[np.abs(speed).argmax()] > 4.0 * variance[np.abs(speed).argmin()]
    assert np.all(variance > 0.0)
