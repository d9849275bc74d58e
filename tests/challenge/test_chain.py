"""The measurement chain: each fault does what its name says, and nothing else."""

import numpy as np
import pytest

from pendpipe_challenge.chain import Chain, high_pass, play, with_turns
from pendpipe_challenge.motion import Motion, Track

TIME = 0.02 * np.arange(3000)
OMEGA = 5.0


def swing(amplitude: float = 0.3) -> Track:
    return Motion({"omega": OMEGA, "gamma": 0.02}, amplitude).run(TIME)


def volts(chain: Chain) -> np.ndarray:
    return chain.volts(swing(), len(TIME))


def test_a_plain_chain_is_a_line() -> None:
    chain = Chain(volts_per_radian=3.9, offset_volts=0.1)
    assert np.allclose(volts(chain), 0.1 + 3.9 * swing().angle_rad, atol=1e-15)


def test_codes_are_within_half_a_step_and_never_outside_the_range() -> None:
    chain = Chain(bits=12, range_volts=1.0)
    code = chain.codes(volts(chain))
    inside = np.abs(volts(chain)) < 0.999
    assert np.abs(code * chain.step_volts - volts(chain))[inside].max() <= 0.5 * chain.step_volts
    assert code.max() == 2047
    assert code.min() == -2048


def test_lost_samples_move_all_later_ones() -> None:
    chain = Chain(dropped=((1000, 2),))
    grid = chain.grid(len(TIME), TIME[1])
    track = Motion({"omega": OMEGA, "gamma": 0.02}, 0.3).run(grid)
    found = chain.volts(track, len(TIME))
    assert np.array_equal(found[:1000], volts(Chain())[:1000])
    assert np.allclose(found[1000:-2], volts(Chain())[1002:], atol=1e-12)


def test_repeated_samples_hold_all_later_ones_back() -> None:
    found = volts(Chain(dropped=((1000, -1),)))
    assert np.allclose(found[1001:], volts(Chain())[1000:-1], atol=1e-15)


def test_plates_have_the_cubic_of_their_gap() -> None:
    small = Track(TIME, 0.05 * np.cos(TIME), -0.05 * np.sin(TIME), 0 * TIME)
    found = Chain(plates=0.5).volts(small, len(TIME)) / 3.85
    cubic = small.angle_rad + 0.25 * small.angle_rad**3
    assert np.abs(found - cubic).max() < 1e-7


def test_leaning_plates_have_a_square() -> None:
    small = Track(TIME, 0.02 * np.cos(TIME), -0.02 * np.sin(TIME), 0 * TIME)
    found = Chain(plates=0.1, lean=0.4).volts(small, len(TIME)) / 3.85
    square = np.polyfit(small.angle_rad, found, 2)
    assert square[1] == pytest.approx(1.0, abs=1e-4)
    assert square[0] == pytest.approx(0.1 * 0.4 * (3 + 0.16) / (1 - 0.16) / (1 + 0.16), rel=0.01)


def test_play_holds_the_reading_back_by_half_its_width() -> None:
    angle = 0.3 * np.sin(OMEGA * TIME)
    found = play(angle, 0.01)
    moving = np.abs(np.cos(OMEGA * TIME)) > 0.5
    moving[:100] = False
    lag = (angle - found)[moving] * np.sign(np.cos(OMEGA * TIME))[moving]
    assert np.allclose(lag, 0.005, atol=1e-12)


def test_a_coupling_turns_where_the_pendulum_does_and_not_where_it_is_sampled() -> None:
    """Ten samples a cycle: after the turn between two of them the reading lags the other way."""
    time = np.arange(0.0, 60.0, 0.1 * 2.0 * np.pi / OMEGA) + 0.03
    track = Track(time, 0.3 * np.sin(OMEGA * time), 0.3 * OMEGA * np.cos(OMEGA * time), 0 * time)
    found = Chain(play_rad=1e-4, volts_per_radian=1.0).volts(track, len(time))
    away = np.abs(track.angle_rad) < 0.3 - 1e-4
    away[:10] = False
    lag = (track.angle_rad - found) * np.sign(track.rate_rad_s)
    assert np.allclose(lag[away], 5e-5, atol=1e-12)


def test_turns_between_samples_are_found() -> None:
    time = np.arange(0.0, 30.0, 0.2)
    angle, sampled = with_turns(time, np.sin(time + 0.1), np.cos(time + 0.1))
    assert np.array_equal(angle[sampled], np.sin(time + 0.1))
    assert np.allclose(np.abs(angle[~sampled]), 1.0, atol=1e-5)
    assert np.count_nonzero(~sampled) == 10


def test_ac_coupling_is_a_first_order_high_pass() -> None:
    tau = 2.0
    found = high_pass(TIME, np.cos(OMEGA * TIME) + 0.5, tau)
    gain = 1j * OMEGA * tau / (1 + 1j * OMEGA * tau)
    settled = TIME > 40
    expected = (gain * np.exp(1j * OMEGA * TIME)).real
    assert np.abs(found - expected)[settled].max() < 2e-6


def test_dead_bits_leave_multiples_only() -> None:
    code = Chain(dead_bits=3).codes(volts(Chain()))
    assert np.all(code % 8 == 0)
    assert len(np.unique(code)) > 100


def test_missing_codes_go_to_their_neighbour() -> None:
    plain = Chain().codes(volts(Chain()))
    busiest = int(np.bincount(plain - plain.min()).argmax() + plain.min())
    found = Chain(missing_codes=(busiest,)).codes(volts(Chain()))
    assert not np.any(found == busiest)
    assert np.array_equal(found != plain, plain == busiest)
    assert np.all(found[plain == busiest] == busiest + 1)


def test_clipping_cuts_at_its_level() -> None:
    found = volts(Chain(clip_high_volts=0.8, clip_low_volts=-0.9))
    assert found.max() == 0.8
    assert found.min() == -0.9


def test_a_soft_limit_never_reaches_it_and_spares_small_readings() -> None:
    found = volts(Chain(clip_high_volts=1.0, soft_clip=0.02))
    assert found.max() < 1.0
    low = volts(Chain()) < 0.7
    assert np.abs(found - volts(Chain()))[low].max() < 1e-6


def test_jitter_grows_with_the_speed() -> None:
    random = np.random.default_rng(1)
    found = Chain(jitter_s=1e-3).volts(swing(), len(TIME), random) / 3.85 - swing().angle_rad
    fast = np.abs(swing().rate_rad_s) > 0.8
    slow = np.abs(swing().rate_rad_s) < 0.05
    ratio = found[fast] / swing().rate_rad_s[fast]
    assert ratio.std() == pytest.approx(1e-3, rel=0.1)
    assert found[slow].std() < 1e-4


def test_clock_drift_bends_the_times() -> None:
    grid = Chain(clock_drift=1e-5).grid(len(TIME), TIME[1])
    assert np.allclose(grid, TIME + 0.5e-5 * TIME**2, atol=1e-15)
    slow = Chain(clock_drift=1e-5, clock_drift_s=1e6).grid(len(TIME), TIME[1])
    assert np.abs(slow - grid).max() < 1e-6
