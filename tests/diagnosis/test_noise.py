"""The noise of the readings: its variance and colour, whatever the motion's misfit."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import idct
from scipy.signal import lfilter
from scipy.stats import chi2

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise, white_noise
from pendpipe.diagnosis.noise_estimate import _about_lines, estimate_noise, stands_out

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


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans(), st.integers(2, 60))
def test_weights_of_readings_are_the_transpose_of_whitening(
    seed: int, white: bool, changing: bool, count: int
) -> None:
    """<W x, y> = <x, W^T y>, masks and levels included."""
    generator = np.random.default_rng(seed)
    weight = (generator.random(count) > 0.2).astype(float)
    variance = np.ones(count) if white else generator.uniform(0.1, 9.0, count)
    level = generator.uniform(0.3, 3.0, count) if changing else None
    noise = Noise(variance, weight, level)
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


def test_white_noise_has_one_variance_known_as_well_as_it_can_be() -> None:
    """Of n squares ln S has the variance 2/n; the harmonics' bands and the doubt cost some."""
    found = [estimated(white(np.random.default_rng(seed))) for seed in range(30)]
    assert np.mean([noise.coloured for noise in found]) < 0.2
    assert np.mean([noise.level is not None for noise in found]) < 0.2
    flat = [noise for noise in found if not noise.coloured and noise.level is None]
    column = np.random.default_rng(99).standard_normal((1, COUNT))
    column /= np.linalg.norm(column)
    stated = np.mean([noise.log_scale_variance(column)[0] for noise in flat])
    assert 2.0 / COUNT < stated < 3.0 * 2.0 / COUNT
    assert np.var([np.log(noise.variance[0]) for noise in flat]) < 2.0 * stated


def test_a_column_at_low_frequency_meets_less_certain_noise() -> None:
    """The slowest cosines are few: there ln S of red noise is known to half a unit at best."""
    noise = estimated(red(np.random.default_rng(3)))
    unit = np.eye(COUNT)
    slow, fast = noise.log_scale_variance(unit[[1]])[0], noise.log_scale_variance(unit[[900]])[0]
    assert fast < 0.05 < 0.25 < slow


def test_what_the_uncertainty_of_red_noise_says_comes_true() -> None:
    """(ln S - ln S true)/sd is a standard normal number, in the middle of each octave."""
    true = np.log(
        (2.5e-4) ** 2 * (1.0 + 8.0 * (0.05 / np.maximum(FREQUENCY_HZ, FREQUENCY_HZ[1])) ** 1.5)
    )
    pulls = []
    for seed in range(30):
        noise = estimated(red(np.random.default_rng(seed)))
        for cosine in (2, 5, 12, 30, 700, 1200):
            sd = np.sqrt(noise.log_variance_at(np.array([float(cosine)]))[0])
            pulls.append((np.log(noise.variance[cosine]) - true[cosine]) / sd)
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("end", [1.0 / 3.0, 3.0])
def test_a_level_that_changes_along_the_record_is_followed(end: float) -> None:
    """Whitened readings have one variance in every fifth of the record; the colour is none."""
    level = np.linspace(1.0, end, COUNT)
    squares = []
    for seed in range(8):
        readings = level * white(np.random.default_rng(seed))
        noise = estimated(readings)
        assert noise.level is not None
        squares.append((readings * noise.scale) ** 2)
    fifths = np.mean(squares, axis=0).reshape(5, -1).mean(axis=1)
    assert fifths / fifths.mean() == pytest.approx(
        np.ones(5), abs=4.0 * np.sqrt(2.0 * 5.0 / 8.0 / COUNT)
    )


def test_heavy_tails_are_hardly_a_change_of_the_level() -> None:
    for seed in range(20):
        noise = estimated(2.5e-4 * np.random.default_rng(seed).standard_t(3.0, COUNT))
        assert noise.level is None or np.ptp(np.log(noise.level)) < 0.4


def test_a_red_part_may_be_forbidden() -> None:
    readings = red(np.random.default_rng(1))
    noise = estimate_noise(data_of(readings), readings, MOTION_HZ, 0.0, red=False)
    assert noise.variance[1] < 0.5 * estimated(readings).variance[1]


def test_a_misfit_about_the_harmonics_is_not_noise() -> None:
    """A misfit three times the noise, that comes and goes, changes the estimate by 1 % at most."""
    readings = white(np.random.default_rng(5))
    times = np.arange(COUNT) * INTERVAL_S
    swell = np.sin(np.pi * times / times[-1]) ** 2
    misfit = 7.5e-4 * swell * np.cos(2.0 * np.pi * MOTION_HZ * times)
    misfit += 4e-4 * swell * np.cos(4.0 * np.pi * MOTION_HZ * times)
    assert estimated(readings + misfit).rms == pytest.approx(estimated(readings).rms, rel=0.01)


@pytest.mark.parametrize("count", [300, 600, COUNT])
@pytest.mark.parametrize("decay_s", [20.0, np.inf])
def test_a_line_leaves_the_noise_about_it_as_it_is(count: int, decay_s: float) -> None:
    """Four times the noise, between the second harmonic and the third; it leaks, or dies away.

    The variance about it is told within a factor of two.
    """
    noise = 2.5e-4 * np.random.default_rng(count).standard_normal(count)
    time_s = INTERVAL_S * np.arange(count)
    line = 1e-3 * np.exp(-time_s / decay_s) * np.cos(2.0 * np.pi * 2.21 * time_s + 1.0)
    found, alone = estimated(noise + line).variance, estimated(noise).variance
    np.testing.assert_allclose(np.log(found / alone), 0.0, atol=np.log(2.0))


@given(st.floats(0.05, 7.0), st.floats(2.0, 60.0), st.integers(40, COUNT))
def test_the_noise_is_told_whatever_the_harmonics_leave_of_it(
    frequency_hz: float, cycles: float, count: int
) -> None:
    """Beside a single cosine between two harmonics there may be no other."""
    readings = 2.5e-4 * np.random.default_rng(count).standard_normal(count)
    readings += 1e-3 * np.cos(2.0 * np.pi * 2.21 * INTERVAL_S * np.arange(count))
    noise = estimate_noise(data_of(readings), readings, frequency_hz, 0.0, cycles=cycles)
    assert np.all(noise.variance > 0.0)
    assert np.all(np.isfinite(noise.variance))


@pytest.mark.parametrize("width", [8.0, 12.0, 20.0])
@pytest.mark.parametrize("beside", [True, False])
def test_a_resonance_is_seldom_a_line_and_never_beside_a_harmonic(
    width: float, beside: bool
) -> None:
    """Of 300, from eight cosines wide on; a harmonic's band hides one side of it."""
    cosine, noise_only = np.arange(COUNT), np.ones(COUNT, dtype=bool)
    noise_only[0] = False
    noise_only[207:240] = not beside
    spectrum = 1e-3 + 1.0 / (1.0 + ((cosine - 203.0) / (0.5 * width)) ** 2)
    lines = [
        np.any(_about_lines(spectrum * rng.standard_normal(COUNT) ** 2, noise_only)[190:217])
        for rng in map(np.random.default_rng, range(300))
    ]
    assert np.mean(lines) <= (0.0 if beside else 0.1)


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


def test_a_counter_errs_in_time_so_its_angles_err_where_it_is_fast() -> None:
    times = np.arange(COUNT) * INTERVAL_S
    speed = np.cos(2.0 * np.pi * MOTION_HZ * times)
    variance = white_noise(data_of(speed), 1e-3, speed).sd ** 2
    assert variance[np.abs(speed).argmax()] > 4.0 * variance[np.abs(speed).argmin()]
    assert np.all(variance > 0.0)


def test_a_counters_errors_are_white_once_divided_by_their_level() -> None:
    """A row a count: fewer rows in a cycle as the swings become smaller, and errors in time."""
    fine = np.linspace(0.0, 100.0, 400_000)
    angle = np.exp(-0.01 * fine) * np.cos(2.0 * np.pi * MOTION_HZ * fine)
    times = fine[1:][np.diff(np.floor(angle / 0.02)) != 0.0]
    speed = np.interp(times, fine, np.gradient(angle, fine))
    error = 1e-3 * speed * np.random.default_rng(2).standard_normal(len(times))
    data = Data(times, error, float(np.median(np.diff(times))), False, np.ones(len(times)))
    noise = estimate_noise(data, error, MOTION_HZ, 0.0, slope=speed)
    assert not noise.coloured
    fast = np.abs(speed) > np.median(np.abs(speed))
    squares = noise.whiten(error) ** 2
    assert np.mean(squares[fast]) == pytest.approx(1.0, abs=0.35)


def test_uneven_readings_are_whitened_as_they_follow_each_other() -> None:
    generator = np.random.default_rng(6)
    readings = low_pass(generator)
    times = np.arange(COUNT) * INTERVAL_S + 0.3 * INTERVAL_S * generator.uniform(-1.0, 1.0, COUNT)
    data = Data(times, readings, INTERVAL_S, False, np.ones(COUNT))
    white = estimate_noise(data, readings, MOTION_HZ, 0.0).whiten(readings)
    for part in np.split(white**2, 5):
        assert np.mean(part) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 * 5.0 / COUNT))


@pytest.mark.parametrize("made", [white, red, low_pass])
def test_a_misfit_stands_out_of_noise_of_any_colour(
    made: Callable[[np.random.Generator], FloatArray],
) -> None:
    """Its mean square about the harmonics is that of noise, with a small part of the motion not."""
    readings = made(np.random.default_rng(4))
    noise = estimated(readings)
    assert noise.misfit(noise.whiten(readings)) == pytest.approx(1.0, abs=0.5)
    times = np.arange(COUNT) * INTERVAL_S
    wrong = readings + 5e-4 * np.sin(2.0 * np.pi * MOTION_HZ * times)
    assert noise.misfit(noise.whiten(wrong)) > 3.0


def test_a_square_stands_out_where_a_line_is_likelier_than_noise() -> None:
    """chi^2 of one degree of freedom, against lines: a thousandth, over 20 of ln P."""
    ratio = np.linspace(0.01, 60.0, 6000)
    noise = ratio * chi2(1).pdf(ratio)
    assert np.array_equal(stands_out(ratio), (noise < 1e-3 / 20.0) & (ratio > 1.0))
