"""Turning points and the noise about them, of short records and of long ones."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pendpipe.analysis.noise import noise_rms, quantisation_rms, white_rms
from pendpipe.analysis.turning_points import (
    TurningPoints,
    find_turning_points,
    read_turning_points,
    write_turning_points,
)
from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Quantity, Recording

from ..recordings import white
from ..refusals import refused

# Turning points measured from all readings, against those of the engine.

OMEGA = 2.0 * math.pi * 0.516
FIG_8 = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
START = Release(-0.3, 0.068, 0.003)


def record(
    model: Eq8,
    release: Release,
    time_s: FloatArray,
    noise: float = 0.0,
    seed: int = 1,
    step: float | None = None,
) -> Recording:
    values = sample(model, release, time_s)
    values = values + noise * np.random.default_rng(seed).standard_normal(len(time_s))
    if step is not None:
        values = np.round(values / step) * step
    return Recording(time_s, values, "angle_rad", resolution=step)


def errors(
    points: TurningPoints, model: Eq8, release: Release
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Errors of angle (on its own side) and time, and the true amplitudes."""
    truth = turning_points(model, release, until_s=float(points.time_s[-1]) + 10.0)
    nearest = np.abs(truth.time_s[:, None] - points.time_s).argmin(axis=0)
    assert np.all(np.diff(nearest) == np.diff(points.half_cycle))
    angle = points.angle_rad + points.level_rad - truth.angle_rad[nearest]
    true_amplitude = np.abs(truth.angle_rad[nearest] - release.offset_rad)
    return angle * points.side, points.time_s - truth.time_s[nearest], true_amplitude


def test_errors_are_as_large_as_stated_and_unbiased() -> None:
    """20 x 309 turning points at 0.1 mrad noise: pulls have mean 0 and variance 1."""
    time = np.arange(32768) * (300.0 / 32768)
    pulls = []
    for seed in range(20):
        points = find_turning_points(record(FIG_8, START, time, 1e-4, seed))
        assert len(points) == 309
        angle, late, _ = errors(points, FIG_8, START)
        pulls.append([angle / points.angle_sd_rad, late / points.time_sd_s])
    number = 20 * 309
    pull = np.array(pulls)
    assert abs(pull[:, 0].mean()) < 3.5 / math.sqrt(number)
    assert np.all(np.abs(pull.std(axis=(0, 2)) - 1.0) < 4.0 / math.sqrt(2.0 * number))


def test_precision_is_that_of_every_reading_used() -> None:
    """A cosine's amplitude from n readings of its half cycle has variance 2 noise^2/n."""
    time = np.arange(32768) * (300.0 / 32768)
    points = find_turning_points(record(FIG_8, START, time, 1e-4))
    per_half_cycle = 32768 / 300.0 / (2 * 0.516)
    bound = points.noise_rms_rad * math.sqrt(2.0 / per_half_cycle)
    assert np.median(points.angle_sd_rad) == pytest.approx(bound, rel=0.02)


@settings(max_examples=25, deadline=None)
@given(
    quality=st.floats(30.0, 1000.0),
    quadratic=st.floats(0.0, 1.0),
    coulomb=st.floats(0.0, 0.03),
    share=st.floats(0.0, 1.0),
    frequency=st.floats(0.05, 1.1),
    phase=st.floats(0.0, 0.9),
    offset=st.floats(-0.1, 0.1),
)
def test_without_noise_only_the_shape_is_left_open(
    quality: float,
    quadratic: float,
    coulomb: float,
    share: float,
    frequency: float,
    phase: float,
    offset: float,
) -> None:
    """Errors of (losses/omega)^2 of the amplitude at most, whatever the mixture."""
    omega = 2.0 * math.pi * frequency
    b = 0.5 * omega / quality
    model = Eq8(omega, quadratic * b / 0.1, share * b, (1.0 - share) * b, coulomb * b * 0.1)
    release = Release(-phase / frequency, 0.1, offset)
    time = np.arange(4000) * (20.0 / frequency / 4000)
    points = find_turning_points(record(model, release, time))
    angle, late, truth = errors(points, model, release)
    losses = (model.quadratic * truth + b + model.coulomb / truth) / omega
    # The error of the level is common to all, and of the first amplitudes' size.
    allowed = truth * losses**2 + 0.1 * (1e-5 + 0.3 * losses[0] ** 2)
    assert np.all(np.abs(angle[1:-1]) < allowed[1:-1])
    assert np.all(np.abs(angle) < 3.0 * allowed)
    assert np.all(np.abs(late) * omega < 1e-4 + losses)


def test_heavy_damping() -> None:
    """Q = 5: the amplitude falls by 27 % from one turning point to the next."""
    model = Eq8(OMEGA, viscous=OMEGA / 10.0)
    release = Release(-0.1, 0.5)
    time = np.arange(4000) * 0.003
    points = find_turning_points(record(model, release, time, 1e-5))
    angle, _, truth = errors(points, model, release)
    assert len(points) >= 10
    assert truth[0] / truth[1] == pytest.approx(math.exp(math.pi / 10.0), rel=0.01)
    assert np.all(np.abs(angle) < 4.0 * points.angle_sd_rad)


def test_uneven_sampling() -> None:
    time = np.sort(np.random.default_rng(4).uniform(0.0, 100.0, 9000))
    points = find_turning_points(record(FIG_8, START, time, 1e-4))
    angle, late, _ = errors(points, FIG_8, START)
    assert len(points) >= 102
    assert np.std(angle / points.angle_sd_rad) == pytest.approx(1.0, abs=0.25)
    assert np.std(late / points.time_sd_s) == pytest.approx(1.0, abs=0.25)


def test_a_gap_is_counted_over() -> None:
    """Half cycles in a gap keep their numbers, and the sign alternates with the number."""
    time = np.arange(10000) * 0.01
    whole = record(FIG_8, START, time, 1e-4)
    quality = np.zeros(10000, dtype=np.uint8)
    quality[(time > 30.0) & (time < 47.0)] = 2
    gapped = Recording(time, np.where(quality == 2, np.nan, whole.values), "angle_rad", quality)
    points = find_turning_points(gapped)
    angle, _, _ = errors(points, FIG_8, START)
    assert points.half_cycle[-1] == 102
    assert 15 <= points.half_cycle[-1] + 1 - len(points) <= 19
    assert np.all(np.abs(angle) < 5.0 * points.angle_sd_rad)
    assert np.all(points.amplitude_rad > 0.0)


def test_release_at_the_first_reading_is_a_turning_point() -> None:
    release = Release(0.0, 0.068)
    points = find_turning_points(record(FIG_8, release, np.arange(6000) * 0.01, 1e-4))
    angle, late, _ = errors(points, FIG_8, release)
    assert abs(points.time_s[0]) < 0.01
    assert abs(angle[0]) < 4.0 * points.angle_sd_rad[0]
    assert points.angle_sd_rad[0] > 1.2 * points.angle_sd_rad[1]
    assert abs(late[0]) < 4.0 * points.time_sd_s[0] + 0.01 / OMEGA


def test_a_wandering_level_is_followed() -> None:
    time = np.arange(30000) * 0.01
    still = record(FIG_8, START, time, 1e-4)
    wander = 4e-3 * np.sin(2.0 * math.pi * time / 170.0)
    points = find_turning_points(Recording(time, still.values + wander, "angle_rad"))
    expected = START.offset_rad + 4e-3 * np.sin(2.0 * math.pi * points.time_s / 170.0)
    inner = slice(10, -10)
    assert points.wanders
    assert np.sqrt(np.mean((points.level_rad - expected)[inner] ** 2)) < 5e-5
    truth = turning_points(FIG_8, START, until_s=300.0)
    nearest = np.abs(truth.time_s[:, None] - points.time_s).argmin(axis=0)
    amplitude = np.abs(truth.angle_rad[nearest] - START.offset_rad)
    assert np.all(np.abs(points.amplitude_rad - amplitude)[inner] < 1.5e-4)


@pytest.mark.parametrize("unit", [1e-4, 1e4])
def test_whether_the_level_wanders_does_not_hang_on_the_unit(unit: float) -> None:
    """Angles in radians, degrees or counts: the level and its error are larger by as much."""
    recording = record(FIG_8, START, np.arange(30000) * 0.01, 1e-4)
    for wander in (0.0, 4e-5, 4e-3):
        moved = recording.values + wander * np.sin(2.0 * math.pi * recording.time_s / 170.0)
        one, other = (
            find_turning_points(Recording(recording.time_s, scale * moved, "displacement_m"))
            for scale in (1.0, unit)
        )
        assert other.wanders == one.wanders
        assert other.level_sd_rad == pytest.approx(unit * one.level_sd_rad, rel=1e-6)
        assert other.level_rad == pytest.approx(unit * one.level_rad, rel=1e-6)


def test_a_still_level_is_one_number() -> None:
    points = find_turning_points(record(FIG_8, START, np.arange(30000) * 0.01, 1e-4))
    assert not points.wanders
    assert abs(points.level_rad[0] - START.offset_rad) < 4.0 * points.level_sd_rad


def test_level_error_is_shared_with_alternating_effect() -> None:
    """A level too high by e lowers every signed angle by 4/pi e: the covariance says so."""
    points = find_turning_points(record(FIG_8, START, np.arange(6000) * 0.01, 1e-4))
    covariance = points.covariance()
    shared = covariance[0, 5]
    assert points.level_coupling == pytest.approx(4.0 / math.pi, rel=0.01)
    assert shared == pytest.approx((4.0 / math.pi * points.level_sd_rad) ** 2, rel=0.03)
    assert covariance[5, 5] == pytest.approx(points.angle_sd_rad[5] ** 2 + shared)


def test_noise_is_never_below_the_rounding() -> None:
    step = 1.27e-3
    points = find_turning_points(record(FIG_8, START, np.arange(8000) * 0.02, 0.0, step=step))
    assert points.step_rad == step
    assert points.noise_rms_rad >= step / math.sqrt(12.0)
    angle, _, _ = errors(points, FIG_8, START)
    assert np.all(np.abs(angle) < step)


@pytest.mark.parametrize("in_a_cycle", [10.003, 12.01, 14.02])
def test_noise_is_told_by_few_readings_of_a_cycle(in_a_cycle: float) -> None:
    """Nearly all half cycles hold the same few; 3000 readings tell 0.4 mrad to some 2 %."""
    model = Eq8(OMEGA, viscous=2e-4)
    time = np.arange(3000) * 2.0 * math.pi / (OMEGA * in_a_cycle)
    points = find_turning_points(record(model, Release(0.0, -0.13), time, 4e-4))
    assert points.noise_rms_rad == pytest.approx(4e-4, rel=0.06)


def test_the_tail_is_followed_below_the_noise() -> None:
    """Half cycles of twice their own error are found by the phase of those before."""
    model = Eq8(OMEGA, viscous=0.02)
    release = Release(-0.2, 0.05)
    points = find_turning_points(record(model, release, np.arange(18000) * 0.02, 2e-3))
    _, _, truth = errors(points, model, release)
    assert truth[-1] < 2e-3
    assert abs(np.mean(points.amplitude_rad[-20:] - truth[-20:])) < (
        4.0 * points.angle_sd_rad[-1] / math.sqrt(20.0)
    )


def test_ends_with_the_motion() -> None:
    """Coulomb friction stops the pendulum after 31 half cycles; rest has no turning points."""
    model = Eq8(OMEGA, coulomb=1e-3)
    release = Release(-0.2, 0.06)
    points = find_turning_points(record(model, release, np.arange(6000) * 0.02, 1e-4))
    truth = turning_points(model, release)
    assert len(truth.time_s) - 4 <= points.half_cycle[-1] + 1 <= len(truth.time_s)


@pytest.mark.parametrize(("amplitude", "allowed"), [(0.3, 1e-4), (1.0, 2e-4), (2.5, 3e-3)])
def test_circular_error(amplitude: float, allowed: float) -> None:
    """A real pendulum's half cycle is no cosine (7 % of third harmonic at 2.6 rad)."""
    scipy_integrate = pytest.importorskip("scipy.integrate")
    b = 0.02
    run = scipy_integrate.solve_ivp(
        lambda _, z: [z[1], -2.0 * b * z[1] - OMEGA**2 * np.sin(z[0])],
        (0.0, 40.0),
        [amplitude, 0.0],
        rtol=1e-11,
        atol=1e-12,
        dense_output=True,
        events=lambda _, z: z[1],
        method="DOP853",
    )
    time = np.arange(8000) * 0.005
    points = find_turning_points(
        Recording(time, run.sol(time)[0] + white(2, 8000, 1e-4), "angle_rad")
    )
    nearest = np.abs(run.t_events[0][:, None] - points.time_s).argmin(axis=0)
    truth = np.abs(run.y_events[0][nearest, 0])
    assert len(points) >= 30
    error = np.abs(points.amplitude_rad - truth)
    assert np.all(error[1:] < (allowed * truth + 4e-4)[1:])
    # Of the first, only the second half is there, and its place is extrapolated.
    assert error[0] < (0.01 if amplitude > 2.0 else allowed) * truth[0] + 4e-4


def test_one_row_a_count() -> None:
    """An encoder that writes when its count changes: the times are the data."""
    step = 2.618e-3
    model = Eq8(OMEGA, quadratic=0.05, viscous=0.005, coulomb=1e-4)
    release = Release(-0.2, 0.39)
    fine = np.arange(1_500_000) * 5e-5
    counts = np.round(sample(model, release, fine) / step)
    change = np.flatnonzero(np.diff(counts)) + 1
    recording = Recording(fine[change], counts[change] * step, "angle_rad")
    points = find_turning_points(recording)
    angle, _, _ = errors(points, model, release)
    assert np.max(np.abs(angle[1:-1])) < 0.1 * step
    assert any("one row per count" in note for note in points.notes)


def test_the_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    points = find_turning_points(record(FIG_8, START, np.arange(6000) * 0.01, 1e-4))
    path = tmp_path / "turning_points.csv"
    write_turning_points(path, points)
    again = read_turning_points(path)
    for name in ("half_cycle", "time_s", "time_sd_s", "angle_rad", "angle_sd_rad", "level_rad"):
        assert np.array_equal(getattr(again, name), getattr(points, name))
    assert again.noise_rms_rad == points.noise_rms_rad
    assert again.level_sd_rad == points.level_sd_rad
    assert (again.start_s, again.stop_s) == (points.start_s, points.stop_s)
    assert again.samples == 6000


TIME = np.arange(3000) * 0.01
BAD = {
    "dead": np.full(3000, 0.2),
    "saturated": np.clip(0.3 * np.cos(3.0 * TIME), -0.1, 0.1),
    "noise": 1e-4 * np.random.default_rng(3).standard_normal(3000),
    "half cycles": 0.3 * np.cos(0.1 * TIME),
}


@pytest.mark.parametrize("fault", BAD)
def test_unfit_readings_are_refused_in_one_line(fault: str) -> None:
    with refused(fault, "a.csv: "):
        find_turning_points(Recording(TIME, BAD[fault], "angle_rad"), "a.csv")


@pytest.mark.parametrize("quantity", ["angle_rad", "displacement_m", "reading"])
def test_a_torsion_pendulum_and_what_is_no_angle_swing_beyond_pi(quantity: Quantity) -> None:
    values = 40.0 * np.exp(-0.02 * TIME) * np.cos(3.0 * TIME)
    points = find_turning_points(Recording(TIME, values, quantity))
    assert points.unit == {"angle_rad": "rad", "displacement_m": "m", "reading": "1"}[quantity]
    assert points.amplitude_rad[0] == pytest.approx(40.0 * math.exp(-0.02 * points.time_s[0]), 1e-3)


@pytest.mark.parametrize("in_a_cycle", [2.2, 3.0])
def test_too_few_readings_in_a_cycle_are_refused_in_a_line(in_a_cycle: float) -> None:
    time = np.arange(400) / in_a_cycle
    angle = 0.2 * np.exp(-np.pi / 200.0 * time) * np.cos(2.0 * np.pi * time + 0.3)
    with pytest.raises(NotAnalysableError, match=r"too few readings|three half cycles|no motion"):
        find_turning_points(Recording(time, angle + white(5, len(time), 1e-4), "angle_rad"))


SWING = Eq8(2.0 * math.pi / 1.352, hysteretic=0.01, viscous=0.01, coulomb=1e-9)
ROWS_S = np.arange(8000) * 0.005


@settings(max_examples=20, deadline=None)
@given(
    rows=st.integers(2, 12),
    amplitude=st.floats(0.02, 0.5),
    step=st.sampled_from([None, 2e-5]),
)
def test_a_reading_that_is_held_counts_once(
    rows: int, amplitude: float, step: float | None
) -> None:
    """A sensor that measures every few rows gives what it gives without the rows between."""
    measured = record(SWING, Release(0.0, amplitude, 0.0), ROWS_S[::rows], 1e-4, 3, step)
    values = np.repeat(measured.values, rows)[: len(ROWS_S)]
    held = Recording(ROWS_S[: len(values)], values, "angle_rad", resolution=step)
    samples = prepare(held, "record")
    assert samples.held == len(held) - len(samples)
    np.testing.assert_allclose(samples.time_s, measured.time_s[: len(samples)], atol=1e-9)
    assert np.array_equal(samples.values, measured.values[: len(samples)])


@pytest.mark.filterwarnings("error")
def test_bursts_of_a_few_readings_are_refused_in_a_line() -> None:
    """Ten readings a second apart, then 51 s without."""
    row = np.arange(460)
    values = 0.35 * np.exp(-row / 600) * np.cos(2 * np.pi * row / 19)
    bursts = Recording(time_s=60.0 * (row // 10) + row % 10, values=values, quantity="angle_rad")
    with pytest.raises(NotAnalysableError, match="most half cycles have a gap"):
        find_turning_points(bursts)


@pytest.mark.parametrize("seed", range(4))
def test_turning_points_of_readings_held_for_some_rows_have_the_errors_stated(seed: int) -> None:
    """Two to seven rows, at random: each reading is as old as its first row tells."""
    starts = np.append(0, np.cumsum(np.random.default_rng(seed).integers(2, 8, 4000)))
    starts = starts[starts < len(ROWS_S)]
    measured = record(SWING, Release(0.0, 0.2, 0.0), ROWS_S[starts], 1e-4, seed)
    values = np.repeat(measured.values, np.diff(np.append(starts, len(ROWS_S))))
    points = find_turning_points(Recording(ROWS_S, values, "angle_rad"))
    assert any("readings are held" in note for note in points.notes)
    assert points.noise_rms_rad == pytest.approx(1e-4, rel=0.1)
    angle, late, _ = errors(points, SWING, Release(0.0, 0.2, 0.0))
    for pull in (angle / points.angle_sd_rad, late / points.time_sd_s):
        assert np.sqrt(np.mean(pull**2)) == pytest.approx(1.0, abs=3.5 / math.sqrt(2 * len(pull)))


@pytest.mark.parametrize("step", [1e-3, 6e-3, 2e-2])
def test_an_encoder_that_repeats_its_count_is_not_held(step: float) -> None:
    """It stays on a count as long as the motion does."""
    swing = record(SWING, Release(0.0, 0.5, 0.0), ROWS_S, step=step)
    assert np.mean(np.diff(swing.values) == 0.0) > 0.02
    assert prepare(swing, "record").held == 0


@given(share=st.floats(0.0, 0.1), seed=st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_some_pictures_that_repeat_are_no_held_readings(share: float, seed: int) -> None:
    swing = record(SWING, Release(0.0, 0.5, 0.0), ROWS_S, 1e-4)
    again = np.flatnonzero(np.random.default_rng(seed).random(len(ROWS_S)) < share)[1:]
    swing.values[again] = swing.values[again - 1]
    assert prepare(swing, "record").held == 0


# Long records: followed in one pass where they are plain, with the answer of the whole.

HALF_PERIOD = 1.0
NOISE = 1e-4


def long_record(quality: float, seconds: float = 3000.0) -> tuple[Samples, float]:
    """A decay of Eq. 3, at 106 readings a half cycle, and its rate."""
    rate = math.pi / (2.0 * quality)
    time = np.arange(int(seconds * 106)) / 106.0
    motion = 0.068 * np.exp(-rate * time) * np.cos(math.pi * time + 0.3)
    return Samples(time, motion + white(1, len(time), NOISE) + 2e-3, "rad", None, NOISE), rate


def exact_errors(points: TurningPoints, rate: float) -> tuple[FloatArray, FloatArray]:
    lag = math.atan(rate / math.pi)
    turning = np.round(points.time_s + (0.3 + lag) / math.pi) - (0.3 + lag) / math.pi
    angle = np.cos(lag) * 0.068 * np.exp(-rate * turning) * points.side
    return points.angle_rad - angle, points.time_s - turning


def test_fast_swings_before_a_decay_do_not_end_it() -> None:
    """As bursts of noise are: most half cycles hang together behind them."""
    time_s = np.arange(3000) / 50.0
    slow = 0.5 * np.exp(-time_s / 60.0) * np.cos(2.0 * np.pi * (time_s - 1.0) / 0.8)
    angle = np.where(time_s < 1.0, 0.5 * np.cos(2.0 * np.pi * time_s / 0.125), slow)
    points = find_turning_points(Recording(time_s=time_s, angle_rad=angle))
    assert len(points) > 140
    assert np.median(np.diff(points.time_s)) == pytest.approx(0.4, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quality", "half_cycles"),
    [(5000.0, 3000), (1000.0, 2600)],
    ids=["one pass", "half cycle by half cycle"],
)
def test_long_records_have_the_errors_of_short_ones(quality: float, half_cycles: int) -> None:
    samples, rate = long_record(quality, float(half_cycles))
    points = turning_points_of(samples, long=1 << 18)
    assert ("a long record" in str(points.notes)) == (quality > 1700.0)
    # One pass leaves out what stands at the ends.
    assert half_cycles - 2 <= len(points) <= half_cycles
    assert np.array_equal(points.half_cycle, np.arange(len(points)))
    angle, late = exact_errors(points, rate)
    pull = angle / points.angle_sd_rad
    assert abs(pull.mean()) < 4.0 / math.sqrt(half_cycles)
    assert pull.std() == pytest.approx(1.0, abs=0.06)
    assert (late / points.time_sd_s).std() == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(angle * points.side)) < 0.015 * NOISE


def test_one_pass_and_whole_agree() -> None:
    samples, _ = long_record(5000.0)
    whole = turning_points_of(samples)
    passed = turning_points_of(samples, long=1 << 18)
    assert "a long record" in str(passed.notes)
    difference = (passed.angle_rad - whole.angle_rad[1:-1]) / whole.angle_sd_rad[1:-1]
    assert np.sqrt(np.mean(difference**2)) < 0.3
    assert passed.noise_rms_rad == pytest.approx(whole.noise_rms_rad, rel=0.01)


def test_a_pause_in_a_long_record_is_counted_over() -> None:
    samples, rate = long_record(5000.0)
    keep = (samples.time_s < 1400.0) | (samples.time_s > 1417.5)
    cut = Samples(samples.time_s[keep], samples.values[keep], "rad", None, NOISE)
    points = turning_points_of(cut, long=1 << 18)
    turning = points.half_cycle + 1.0 - (0.3 + math.atan(rate / math.pi)) / math.pi
    assert np.max(np.abs(points.time_s - turning)) < 0.01


def test_few_half_cycles_of_very_many_readings_are_measured_one_by_one() -> None:
    """In the beginning, from which a long record is followed, there is none."""
    samples, _ = long_record(1000.0, 60.0)
    assert len(turning_points_of(samples, long=1 << 12)) >= 58


@pytest.mark.parametrize("noise", [3e-5, 1e-4])
def test_the_noise_of_a_long_record_is_found_wherever_its_readings_lie(noise: float) -> None:
    """The half cycles hold no whole number of readings: none turns on a reading."""
    time = np.arange(300_000) / 100.0
    motion = 0.1 * np.exp(-1e-5 * time) * np.cos(6.0 * time + 0.3)
    readings = motion + noise * np.random.default_rng(2).standard_normal(len(time))
    samples = Samples(time, readings, "rad", None, noise)
    points = turning_points_of(samples, long=1 << 18)
    assert points.noise_rms_rad == pytest.approx(noise, rel=0.02)
    assert np.isfinite(points.angle_sd_rad).all()


def test_a_sensor_that_bends_is_not_followed_with_bare_cosines() -> None:
    """Its third harmonic takes 2 % off the fundamental that a cosine has at the turning point."""
    samples, rate = long_record(5000.0)
    bent = samples.values - 20.0 * (samples.values - 2e-3) ** 3
    points = turning_points_of(replace(samples, values=bent), long=1 << 18)
    y = 0.068 * np.exp(-rate * points.time_s)
    off = (points.amplitude_rad - (y - 20.0 * y**3)) / points.angle_sd_rad
    assert abs(float(np.mean(off))) < 1.0


# Noise and step of a recording, from what no slow motion can touch.

SMOOTH = np.cos(np.arange(20000) * 0.06)


def test_white_noise_is_measured_through_a_motion() -> None:
    noise = white(1, 20000, 3e-4)
    assert white_rms(SMOOTH + noise) == pytest.approx(3e-4, rel=0.03)
    assert noise_rms(SMOOTH + noise) == pytest.approx(3e-4, rel=0.05)
    # Alone it leaves next to nothing: 52 readings in a half cycle leak by (pi/52)^4/sqrt(70).
    assert white_rms(SMOOTH) < (math.pi / 52) ** 4 / math.sqrt(70.0)


@pytest.mark.parametrize(("size", "speed", "at_s"), [(0.02, 4.0, 4.0), (0.03, 4.0, 3.1)])
def test_turning_points_ascend_where_a_blow_makes_a_swing_of_its_own(
    size: float, speed: float, at_s: float
) -> None:
    """As the beam that is bowed again: a fit of what does not ascend ended in an error of ours."""
    time_s = np.arange(3000) / 50.0
    late = time_s - at_s
    blow = size * np.exp(-4.0 * late**2) * np.sin(speed * math.pi * late)
    values = 0.05 * np.exp(-0.02 * time_s) * np.cos(math.pi * time_s) + blow
    values += 1e-4 * np.random.default_rng(1).standard_normal(3000)
    points = find_turning_points(Recording(time_s, values, "angle_rad"))
    assert np.all(np.diff(points.time_s) > 0.0)
    assert len(points) > 55


def test_a_recording_has_no_less_noise_than_its_rounding() -> None:
    assert noise_rms(np.zeros(1000), 0.1) == quantisation_rms(0.1) == 0.1 / math.sqrt(12.0)
    assert quantisation_rms(None) == 0.0


GLITCHES = np.where(np.arange(20000) % 997, 0.0, 5.0)
DRUM = np.where(np.arange(20000) < 15000, 99.0, 0.0) * white(1, 20000, 3e-4)
WILD = np.zeros(130)
WILD[:12] = np.linspace(-1.0, 1.0, 12) ** 3
WILD[3:5] = 1.0


@pytest.mark.parametrize(
    ("more", "rms", "quieter", "within"),
    [
        (GLITCHES, 3e-4, None, 0.1),
        # The quietest tenth hears no drum that beats for most of the time.
        (DRUM, 3e-4, 0.1, 0.2),
        # The wild first rows of a short recording.
        (WILD, 1e-3, 0.1, 0.4),
    ],
)
def test_what_is_wild_is_no_noise(
    more: FloatArray, rms: float, quieter: float | None, within: float
) -> None:
    asked = {} if quieter is None else {"quieter": quieter}
    found = noise_rms(white(1, len(more), rms) + more, **asked)
    assert found == pytest.approx(rms, rel=within)


def test_a_drum_is_heard_where_the_quietest_tenth_is_not_asked_for() -> None:
    assert noise_rms(white(1, 20000, 3e-4) + DRUM) > 1e-2
