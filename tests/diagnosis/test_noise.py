"""Noise: its colour, its level, lines and wander."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.fft import idct
from scipy.signal import lfilter
from scipy.stats import binom, chi2, kstest

from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import Band, ToneScan, tone_scan
from pendpipe.diagnosis.forensics.colour import note_wander
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.tracking import rows_of, wander, wander_confirmed
from pendpipe.diagnosis.noise import (
    Noise,
    _about_lines,
    estimate_noise,
    noise_of_counts,
    stands_out,
)
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.formats import read
from pendpipe.recording import Recording, read_plain, write_plain

from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    null_fit,
    other_engine,
    recording,
    white,
)

# The noise of the readings: its variance and colour, whatever the motion's misfit.

COUNT = 1500
LINES_HZ = np.arange(COUNT) / (2.0 * COUNT * INTERVAL_S)


def data_of(readings: FloatArray) -> Data:
    times = np.arange(len(readings)) * INTERVAL_S
    return Data(times, readings, INTERVAL_S, True, np.ones(len(readings)))


def estimated(readings: FloatArray) -> Noise:
    return estimate_noise(data_of(readings), readings, FREQUENCY_HZ, 0.0)


def drawn(generator: np.random.Generator) -> FloatArray:
    return 2.5e-4 * generator.standard_normal(COUNT)


def red(generator: np.random.Generator) -> FloatArray:
    """Spectrum 1 + 8 (0.05 Hz/f)^1.5 over the white part."""
    spectrum = 1.0 + 8.0 * (0.05 / np.maximum(LINES_HZ, LINES_HZ[1])) ** 1.5
    cosines = np.sqrt(spectrum) * generator.standard_normal(COUNT)
    return np.asarray(2.5e-4 * idct(cosines, norm="ortho"))


def low_pass(generator: np.random.Generator) -> FloatArray:
    """First-order memory of 0.4."""
    made = lfilter([1.0], [1.0, -0.4], generator.standard_normal(COUNT + 50))
    return np.asarray(2.5e-4 * made[50:])


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans(), st.integers(2, 60))
def test_weights_of_readings_are_the_transpose_of_whitening(
    seed: int, drawn: bool, changing: bool, count: int
) -> None:
    """<W x, y> = <x, W^T y>, masks and levels included."""
    generator = np.random.default_rng(seed)
    weight = (generator.random(count) > 0.2).astype(float)
    variance = np.ones(count) if drawn else generator.uniform(0.1, 9.0, count)
    level = generator.uniform(0.3, 3.0, count) if changing else None
    noise = Noise(variance, weight, level)
    x, y = generator.standard_normal((2, count, 3))
    left, right = noise.whiten(x).T @ y, x.T @ noise.adjoint(y)
    np.testing.assert_allclose(left, right, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(noise.whiten(x[:, 0]), noise.whiten(x)[:, 0], atol=1e-12)
    np.testing.assert_allclose(noise.adjoint(y[:, 0]), noise.adjoint(y)[:, 0], atol=1e-12)


@pytest.mark.parametrize("made", [drawn, red, low_pass])
def test_noise_of_any_colour_is_made_white(
    made: Callable[[np.random.Generator], FloatArray],
) -> None:
    """Its whitened cosines have unit variance in every octave from 0.1 Hz up."""
    records = [made(np.random.default_rng(seed)) for seed in range(10)]
    squares = np.array([estimated(readings).whiten(readings) ** 2 for readings in records])
    for low in (0.1, 0.2, 0.4, 0.8, 1.6, 3.2):
        octave = (low <= LINES_HZ) & (2.0 * low > LINES_HZ)
        inside = squares[:, octave]
        assert inside.mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / inside.size))


def test_white_noise_has_one_variance_known_as_well_as_it_can_be() -> None:
    """Of n squares ln S has the variance 2/n; the harmonics' bands and the doubt cost some."""
    found = [estimated(drawn(np.random.default_rng(seed))) for seed in range(30)]
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
    true = np.log((2.5e-4) ** 2 * (1.0 + 8.0 * (0.05 / np.maximum(LINES_HZ, LINES_HZ[1])) ** 1.5))
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
        readings = level * drawn(np.random.default_rng(seed))
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
    noise = estimate_noise(data_of(readings), readings, FREQUENCY_HZ, 0.0, red=False)
    assert noise.variance[1] < 0.5 * estimated(readings).variance[1]


def test_a_misfit_about_the_harmonics_is_not_noise() -> None:
    """A misfit three times the noise, that comes and goes, changes the estimate by 1 % at most."""
    readings = drawn(np.random.default_rng(5))
    times = np.arange(COUNT) * INTERVAL_S
    swell = np.sin(np.pi * times / times[-1]) ** 2
    misfit = 7.5e-4 * swell * np.cos(2.0 * np.pi * FREQUENCY_HZ * times)
    misfit += 4e-4 * swell * np.cos(4.0 * np.pi * FREQUENCY_HZ * times)
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


@pytest.mark.slow
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
    readings = drawn(np.random.default_rng(7))
    assert estimated(scale * readings).rms == pytest.approx(
        scale * estimated(readings).rms, rel=1e-3
    )


def test_the_noise_is_never_below_the_floor() -> None:
    readings = drawn(np.random.default_rng(8))
    noise = estimate_noise(data_of(readings), readings, FREQUENCY_HZ, 1e-2)
    assert noise.rms == pytest.approx(1e-2)


@pytest.mark.parametrize(("edge", "late_s"), [(1e-4, 0.0), (0.0, 1e-4), (1e-4, 5e-5), (1e-4, 4e-4)])
def test_a_counters_noise_is_that_of_its_edges_and_of_its_clock(edge: float, late_s: float) -> None:
    """Whatever swing is left: s^2 + (tau v)^2, within a tenth of its root."""
    turn = 2.0 * np.pi * np.arange(COUNT) / 60.0
    speed, rng = 2.0 * np.cos(turn), np.random.default_rng(3)
    sd = np.hypot(edge, late_s * speed)
    swing = 1e-3 * np.sin(turn)
    found = noise_of_counts(swing + sd * rng.standard_normal(COUNT), speed)
    fast = np.abs(speed) > 1.0
    assert np.mean(found[fast] ** 2) == pytest.approx(np.mean(sd[fast] ** 2), rel=0.1)
    assert np.max(np.abs(found - sd)) < 0.15 * np.max(sd)


def test_a_counters_errors_are_white_once_divided_by_their_level() -> None:
    """A row a count: fewer rows in a cycle as the swings become smaller, and errors in time."""
    fine = np.linspace(0.0, 100.0, 400_000)
    angle = np.exp(-0.01 * fine) * np.cos(2.0 * np.pi * FREQUENCY_HZ * fine)
    times = fine[1:][np.diff(np.floor(angle / 0.02)) != 0.0]
    speed = np.interp(times, fine, np.gradient(angle, fine))
    error = 1e-3 * speed * np.random.default_rng(2).standard_normal(len(times))
    data = Data(times, error, float(np.median(np.diff(times))), False, np.ones(len(times)))
    noise = estimate_noise(data, error, FREQUENCY_HZ, 0.0, level=noise_of_counts(error, speed))
    assert not noise.coloured
    fast = np.abs(speed) > np.median(np.abs(speed))
    squares = noise.whiten(error) ** 2
    assert np.mean(squares[fast]) == pytest.approx(1.0, abs=0.35)


def test_uneven_readings_are_whitened_as_they_follow_each_other() -> None:
    generator = np.random.default_rng(6)
    readings = low_pass(generator)
    times = np.arange(COUNT) * INTERVAL_S + 0.3 * INTERVAL_S * generator.uniform(-1.0, 1.0, COUNT)
    data = Data(times, readings, INTERVAL_S, False, np.ones(COUNT))
    drawn = estimate_noise(data, readings, FREQUENCY_HZ, 0.0).whiten(readings)
    for part in np.split(drawn**2, 5):
        assert np.mean(part) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 * 5.0 / COUNT))


@pytest.mark.parametrize("made", [drawn, red, low_pass])
def test_a_misfit_stands_out_of_noise_of_any_colour(
    made: Callable[[np.random.Generator], FloatArray],
) -> None:
    """Its mean square about the harmonics is that of noise, with a small part of the motion not."""
    readings = made(np.random.default_rng(4))
    noise = estimated(readings)
    assert noise.misfit(noise.whiten(readings)) == pytest.approx(1.0, abs=0.5)
    times = np.arange(COUNT) * INTERVAL_S
    wrong = readings + 5e-4 * np.sin(2.0 * np.pi * FREQUENCY_HZ * times)
    assert noise.misfit(noise.whiten(wrong)) > 3.0


def test_a_square_stands_out_where_a_line_is_likelier_than_noise() -> None:
    """chi^2 of one degree of freedom, against lines: a thousandth, over 20 of ln P."""
    ratio = np.linspace(0.01, 60.0, 6000)
    noise = ratio * chi2(1).pdf(ratio)
    assert np.array_equal(stands_out(ratio), (noise < 1e-3 / 20.0) & (ratio > 1.0))


# Tones of any frequency: a line stands out of what lies beside it, a resonance does not.

LINE_HZ = 3.3


def scanned(readings: FloatArray, decay_s: float = np.inf) -> tuple[ToneScan, FloatArray]:
    """A scan of readings for tones, steady or fading, and the chi^2 of each frequency."""
    fit, data, noise = null_fit()
    basis = np.linalg.qr(fit.jacobian[:, list(fit.free)])[0]
    scan = tone_scan(data, noise, basis, decay_s, Band(0.1, FREQUENCY_HZ))
    whitened = np.append(noise.whiten(readings), 0.0)
    whitened -= basis @ (basis.T @ whitened)
    return scan, scan.scores(noise.adjoint(whitened[:-1]))


def test_a_line_in_white_noise_is_as_improbable_as_the_noise_says() -> None:
    """exp(-chi^2/2): its neighbours are no louder than they should be."""
    line = 3e-5 * np.cos(2.0 * np.pi * LINE_HZ * TIME_S)
    scan, scores = scanned(white(7) + line)
    best = int(np.argmax(scores))
    assert scan.frequency_hz[best] == pytest.approx(LINE_HZ, abs=1.0 / np.ptp(TIME_S))
    assert scores[best] > 40.0
    assert np.log(scan.p_values(scores)[best]) == pytest.approx(-0.5 * scores[best], rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_the_highest_peak_of_a_resonance_is_no_line(seed: int) -> None:
    """Noise that is twenty times as strong at its centre: some of it looks like a line."""
    wave = np.fft.rfft(white(seed))
    frequency_hz = np.fft.rfftfreq(len(TIME_S), INTERVAL_S)
    wave *= np.sqrt(1.0 + 19.0 / (1.0 + ((frequency_hz - LINE_HZ) / 0.6) ** 2))
    scan, scores = scanned(np.fft.irfft(wave, len(TIME_S)))
    best = int(np.argmax(scores))
    # Against the noise that was assumed it would be one in a million or less.
    assert np.exp(-0.5 * scores[best]) < 1e-6
    # 1500 cosines are tried: one in fifty is as improbable as that.
    assert scan.p_values(scores).min() > 0.02 / len(TIME_S)


@pytest.mark.parametrize("decay_s", [25.0, 50.0])
def test_a_tone_that_fades_is_not_hidden_by_its_own_width(decay_s: float) -> None:
    """What lies a few 1/duration beside it is its own."""
    tone = 1e-3 * np.exp(-TIME_S / decay_s) * np.cos(2.0 * np.pi * LINE_HZ * TIME_S)
    scan, scores = scanned(white(7) + tone, decay_s)
    best = int(np.argmax(scores))
    assert scores[best] > 1000.0
    assert np.log(scan.p_values(scores)[best]) < -50.0


def test_beside_a_strong_line_its_neighbours_tell_the_noise() -> None:
    """The spectrum may be unknown there by a factor of four: no line would be improbable."""
    line = 3e-4 * np.cos(2.0 * np.pi * LINE_HZ * TIME_S)
    scan, scores = scanned(white(7) + line)
    unsure = replace(scan, log_scale_variance=np.full_like(scan.log_scale_variance, 2.0))
    best = int(np.argmax(scores))
    assert np.log(unsure.p_values(scores)[best]) < -50.0
    assert unsure.p_values(scanned(white(8))[1]).min() > 0.02 / len(TIME_S)


# Red noise or a slow effect: apparent red noise may be a drift.

CLEAN = other_engine(TRUTH)
SLOW = {"offset-drift", "equilibrium-creep", "ac-coupling", "equilibrium-step"}


def named(readings: FloatArray, seed: int) -> set[str]:
    found = diagnose_recording(recording(readings, seed)).effects
    return {
        name
        for effect in found
        for name in (effect.identifier, *(mate for mate, _ in effect.indistinguishable))
    }


@pytest.mark.slow
def test_weak_drifts_of_the_offset_in_white_noise_are_distinguished_from_red_noise() -> None:
    """Delta chi^2 = (slope/sigma)^2 sum (t - mean t)^2 = 196; found in most of six."""
    centred = TIME_S - TIME_S.mean()
    slope = 14.0 * NOISE_RAD / np.sqrt(centred @ centred)
    found = [bool(named(CLEAN + slope * centred, seed) & SLOW) for seed in range(6)]
    assert np.mean(found) > 0.5


@pytest.mark.slow
def test_red_noise_is_not_reported_as_a_drift() -> None:
    """Twice the white density at 0.05 Hz, as 1/f below; two of five are one in 1,000."""
    frequency = np.arange(len(TIME_S)) / (2.0 * len(TIME_S) * INTERVAL_S)
    spectrum = 1.0 + np.where(frequency < 0.05, 0.05 / np.maximum(frequency, frequency[1]), 0.0)
    reported = 0
    for seed in range(5):
        noise = NOISE_RAD * idct(white(seed, len(TIME_S), np.sqrt(spectrum)), norm="ortho")
        found = diagnose_recording(Recording(TIME_S, CLEAN + noise, "angle_rad"))
        reported += any(effect.identifier in SLOW for effect in found.effects)
    assert binom.sf(reported - 1, 5, 0.01) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "motion"),
    [("offset-drift", lambda t: 4e-5 * (t - 16.0)), ("offset-step", lambda t: 5e-4 * (t > 15.0))],
)
def test_in_few_readings_a_large_slow_error_of_the_zero_is_no_noise(
    name: str, motion: Callable[[FloatArray], FloatArray]
) -> None:
    """Five and more times the noise in 700 readings: a filter of some readings could make it."""
    start = TIME_S[:700]
    readings = CLEAN[:700] + motion(start - start[0])
    assert name in named(readings, 3)


@pytest.mark.slow
@pytest.mark.parametrize("uneven", [0.0, 0.03])
def test_what_wanders_more_slowly_than_the_motion_is_told_beside_what_is_faster(
    uneven: float,
) -> None:
    """A zero that comes and goes has no name; the sentence does not call all of it noise."""
    time_s = TIME_S + np.where(np.arange(len(TIME_S)) % 2, 0.0, uneven * INTERVAL_S)
    wander = 5e-3 * np.exp(-(((time_s - 30.0) / 8.0) ** 2))
    angle_rad = other_engine(TRUTH, time_s) + wander + white(3)
    found = diagnose_recording(Recording(time_s, angle_rad, "angle_rad"))
    assert not found.effects
    assert found.details.startswith("Eq. 8 describes the motion of this recording, whose zero")
    assert any("the zero wanders by 1.4" in each for each in found.warnings)


def test_noise_about_the_motion_is_no_wander_of_the_zero() -> None:
    fit, data, _ = null_fit()
    turns = 2.0 * np.pi * FREQUENCY_HZ * TIME_S
    slow = np.random.default_rng(1).standard_normal((2, len(TIME_S))).cumsum(axis=1)
    line = 3e-5 * (slow[0] * np.cos(turns) + slow[1] * np.sin(turns))
    near = replace(data, values=data.values + line)
    noise = estimate_noise(near, near.residual(fit.at.reading), FREQUENCY_HZ, 0.0)
    coloured = replace(noise, variance=np.linspace(2.0, 1.0, len(near)))
    samples = Samples(TIME_S, near.values, "rad", None, NOISE_RAD)
    assert note_wander(Evidence(near, fit, coloured, samples)) is None


# A mark that is tracked with errors shows them in the distance from the pivot, too.

LENGTH_M = 0.9
TIME = np.arange(1500) / 30.0
SWING = 0.2 * np.exp(-0.008 * TIME) * np.cos(3.3 * TIME + 0.3)


def seen(folder: Path, along: FloatArray, across: FloatArray) -> Recording:
    """A video's table of x and y, with errors along the string and across it, rad."""
    radius, angle = LENGTH_M * (1.0 + along), SWING + across
    rows = zip(TIME, radius * np.sin(angle), -radius * np.cos(angle), strict=True)
    path = folder / "video.csv"
    path.write_text("t,x,y\n" + "".join(f"{t:.4f},{x:.7f},{y:.7f}\n" for t, x, y in rows))
    return read(path)


def remembered(random: np.random.Generator) -> FloatArray:
    drawn = np.convolve(random.standard_normal(len(TIME) + 99), np.exp(-np.arange(30) / 20))
    return np.asarray(drawn[99 : 99 + len(TIME)])


@pytest.mark.slow
@pytest.mark.parametrize("kappa", [0.8, -0.5])
def test_a_wander_along_one_line_is_named_and_taken_off(tmp_path: Path, kappa: float) -> None:
    random = np.random.default_rng(3)
    along = 3e-4 * remembered(random)
    noise = 3e-4 * random.standard_normal((2, len(TIME)))
    outcome = diagnose_recording(seen(tmp_path, along + noise[0], kappa * along + noise[1]))
    found = {effect.identifier: effect for effect in outcome.effects}
    assert "tracking-noise" in found
    value = found["tracking-noise"].parameters["kappa"]
    assert abs(value.value - kappa) < max(4.0 * value.sd, 0.15 * abs(kappa)), "w has noise too"
    assert found["tracking-noise"].confirmed is not None
    assert not {"offset-drift", "unnamed-measurement", "tone-pickup"} & set(found)


@pytest.mark.slow
def test_errors_of_their_own_in_both_coordinates_are_no_wander(tmp_path: Path) -> None:
    """Then the test's p-value is uniform, whatever the colour of the noise."""
    random = np.random.default_rng(5)
    values = []
    for _ in range(30):
        # Trackers interpolate: neighbouring rows share what they err by.
        white = random.standard_normal((2, len(TIME) + 4))
        own = 2e-4 * np.array([np.convolve(each, np.ones(5), "valid") for each in white])
        slow = 2e-4 * np.array([remembered(random), remembered(random)])
        samples = prepare(seen(tmp_path, *(own + slow)), "video")
        along = wander(samples)
        assert along is not None
        values.append(wander_confirmed(samples, along, rows_of(samples, 1.9)).p_value)
    assert kstest(values, "uniform").pvalue > 0.01


def test_the_distance_goes_with_the_readings(tmp_path: Path) -> None:
    along = np.where(TIME > 30.0, 0.01, 0.0)
    recording = seen(tmp_path, along, 0.0 * along)
    assert recording.radius_excess == pytest.approx(along, abs=1e-6)
    assert recording.between(29.0, 31.0).radius_excess == pytest.approx(
        along[(TIME >= 29.0) & (TIME <= 31.0)], abs=1e-6
    )
    write_plain(tmp_path / "plain.csv", recording)
    again = read_plain(tmp_path / "plain.csv")
    assert np.array_equal(again.radius_excess, recording.radius_excess)  # type: ignore[arg-type]
