"""What may follow a half cycle freely, to within a few percent of each limit."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.analysis.free_decay import Run, best_runs, stretches
from pendpipe.analysis.half_cycles import HalfCycles

HALF = 0.7
EVERYTHING = slice(0, 1000)


def half_cycles(
    swing: np.ndarray, half: np.ndarray | float = HALF, step: float = 0.0, ending: float = 0.0
) -> HalfCycles:
    """Half cycles of given swings and half periods, about a centre that stays."""
    halves = np.broadcast_to(half, len(swing) - 1)
    middle = np.concatenate(([0.0], np.cumsum(halves)))
    turn = np.concatenate(([swing[0] / 2], swing[0] / 2 - np.cumsum(swing * side(len(swing)))))
    time = np.append(middle, middle[-1] + HALF) - HALF / 2
    return HalfCycles(time, turn, swing, middle, step, ending)


def side(count: int) -> np.ndarray:
    return np.where(np.arange(count) % 2 == 0, 1.0, -1.0)


def decay(count: int = 30, share: float = 0.02) -> np.ndarray:
    return (1.0 - share) ** np.arange(count)


def ends(cycles: HalfCycles) -> list[tuple[int, int]]:
    """First and last half cycle of each run, in the order of time."""
    return sorted((run.first, run.last) for run in best_runs(cycles, EVERYTHING))


def test_of_two_runs_that_of_the_longer_path_comes_first() -> None:
    swing = np.concatenate((decay(12, 0.1), 2.0 * decay(12, 0.1)))
    assert [run.first for run in best_runs(half_cycles(swing), EVERYTHING)] == [12, 0]


@given(share=st.floats(0.0, 0.2), count=st.integers(3, 60))
def test_a_decay_is_one_run(share: float, count: int) -> None:
    (run,) = best_runs(half_cycles(decay(count, share)), EVERYTHING)
    assert (run.first, run.last, run.legs, run.bridged) == (0, count - 1, count, 0)
    assert run.path == pytest.approx(decay(count, share).sum())
    assert run.half_period_s == pytest.approx(HALF)
    # Two half cycles tell no decay, and the more there are the nearer is the worth to the path.
    assert run.worth == pytest.approx(run.path * (count - 2) / count)


@pytest.mark.parametrize(("kick", "parts"), [(1.25, 1), (1.45, 2)])
def test_a_kick_by_more_than_a_third_begins_anew(kick: float, parts: int) -> None:
    swing = decay()
    swing[15:] *= kick
    found = ends(half_cycles(swing))
    assert found == ([(0, 29)] if parts == 1 else [(0, 14), (15, 29)])


@pytest.mark.parametrize(("kick", "parts"), [(1.4, 1), (1.6, 2)])
def test_a_kick_by_a_step_of_the_converter_is_none(kick: float, parts: int) -> None:
    swing = decay()
    swing[15:] *= kick
    assert len(ends(half_cycles(swing, step=0.2 * swing[14]))) == parts


@pytest.mark.parametrize(("left", "parts"), [(0.33, 1), (0.27, 2)])
def test_a_stop_to_less_than_three_tenths_ends_a_run(left: float, parts: int) -> None:
    swing = decay()
    swing[15:] *= left
    assert len(ends(half_cycles(swing))) == parts


def test_the_last_half_cycles_of_coulomb_friction_belong_to_the_decay() -> None:
    swing = np.arange(30, 0, -1) / 30.0 - 0.025
    swing[-1] = 0.2 * swing[-2]
    assert ends(half_cycles(swing)) == [(0, 29)]


@pytest.mark.parametrize(("factor", "parts"), [(1.32, 1), (1.40, 2), (0.76, 1), (0.71, 2)])
def test_a_half_period_may_differ_from_those_beside_it_by_three_tenths(
    factor: float, parts: int
) -> None:
    half, swing = np.full(29, HALF), decay()
    half[14] *= factor
    # Two parts would be joined again, were they of one amplitude.
    swing[15:] *= 0.45
    assert len(ends(half_cycles(swing, half))) == parts


@pytest.mark.parametrize(("front", "first"), [(0.95, 0), (0.90, 1)])
def test_a_first_swing_smaller_than_the_next_is_a_pull(front: float, first: int) -> None:
    swing = decay()
    swing[0] = front * swing[1]
    assert ends(half_cycles(swing))[0][0] == first
    # Where half a step of the converter makes the difference, it is none.
    assert ends(half_cycles(swing, step=0.08 * swing[1]))[0][0] == 0


@pytest.mark.parametrize(("pause", "runs"), [(4.2, 1), (4.8, 2)])
@pytest.mark.parametrize(("ratio", "goes_on"), [(0.55, True), (0.45, False), (1.1, True)])
def test_a_decay_goes_on_behind_a_disturbance_of_four_half_periods(
    pause: float, runs: int, ratio: float, goes_on: bool
) -> None:
    swing, half = decay(), np.full(29, HALF)
    half[14] *= pause
    swing[15:] *= ratio
    assert len(ends(half_cycles(swing, half))) == (1 if runs == 1 and goes_on else 2)


@pytest.mark.parametrize(("waver", "regular"), [(0.05, True), (0.07, False)])
def test_half_periods_that_waver_by_an_eighth_are_no_pendulum_s(
    waver: float, regular: bool
) -> None:
    # Two apart differ by twice the waver.
    half = HALF * (1.0 + waver * np.where(np.arange(29) // 2 % 2 == 0, 1.0, -1.0))
    assert bool(ends(half_cycles(decay(), half))) == regular
    # Sides that differ make them alternate, and that is one.
    assert ends(half_cycles(decay(), HALF * (1.0 + waver * side(29)))) == [(0, 29)]


@pytest.mark.parametrize(("kink", "regular"), [(0.05, True), (0.07, False)])
def test_amplitudes_that_waver_by_an_eighth_are_no_pendulum_s(kink: float, regular: bool) -> None:
    # Two up and two down by `kink` bend the logarithm by twice as much.
    swing = decay() * np.exp(kink * np.where(np.arange(30) // 2 % 2 == 0, 1.0, -1.0))
    assert bool(ends(half_cycles(swing))) == regular
    assert ends(half_cycles(swing, step=0.5 * swing[15]))


def test_swings_that_alternate_are_those_of_a_drifting_zero() -> None:
    assert ends(half_cycles(decay() * np.exp(0.1 * side(30)))) == [(0, 29)]


@pytest.mark.parametrize(("ending", "fades"), [(1.25, True), (1.35, False)])
def test_a_decay_fades_unless_the_record_ends_in_a_pull(ending: float, fades: bool) -> None:
    swing = decay()
    (run,) = best_runs(half_cycles(swing, ending=ending * swing[-1]), EVERYTHING)
    assert run.fades == fades


@pytest.mark.parametrize(("held", "driven"), [(20, True), (3, False)])
def test_a_front_held_up_is_cut_where_the_fall_begins(held: int, driven: bool) -> None:
    swing = np.concatenate((np.ones(held), decay(60, 0.02)))
    (run,) = best_runs(half_cycles(swing), EVERYTHING)
    assert run.driven == driven
    # A median of seven begins to fall when its middle does.
    assert run.first == (pytest.approx(held, abs=2) if driven else 0)


@given(scale=st.floats(1e-3, 1e3), pace=st.floats(1e-2, 1e2), kick=st.floats(0.2, 2.0))
def test_units_do_not_matter(scale: float, pace: float, kick: float) -> None:
    swing = decay()
    swing[12:] *= kick
    cycles = half_cycles(swing, step=0.01)
    scaled = half_cycles(scale * swing, HALF * pace, 0.01 * scale)
    assert ends(scaled) == ends(cycles)


def test_half_cycles_that_are_left_count_as_legs() -> None:
    run = Run(EVERYTHING, half_cycles(decay()), 3, 7)
    assert run.legs == len(run.swing) == len(run.middle_s) == 5
    assert run.path == pytest.approx(decay()[3:8].sum())


@pytest.mark.parametrize(("rest_s", "rests"), [(9.0, 1), (7.0, 0)])
def test_a_rest_between_two_motions_counts_from_eight_half_periods(
    rest_s: float, rests: int
) -> None:
    time = np.arange(0.0, 40.0, 0.01)
    moves = np.sin(2.0 * np.pi * time)
    begin = 10.0
    still = (time > begin) & (time < begin + rest_s)
    moves[still] = 0.0
    cuts = stretches(time, moves, 30.0, 40.0, quiet=0.1, window_s=1.0, before="by hand")
    assert [cut.reason for cut in cuts].count("rest before release") == rests
    assert (cuts[0].start_s, cuts[-1].stop_s) == (0.0, 30.0)
    assert all(one.stop_s == other.start_s for one, other in pairwise(cuts))


def test_all_of_a_pull_is_cut_but_two_half_cycles_are_left() -> None:
    swing = np.concatenate(([0.2, 0.4, 0.6, 0.8], decay()))
    assert ends(half_cycles(swing))[-1] == (4, 33)
    # A pull is cut at the head of each run, wherever that begins.
    later = np.concatenate((0.1 * decay(10), swing[2:]))
    assert ends(half_cycles(later))[-1] == (12, 41)


@pytest.mark.parametrize(("front", "first"), [(0.90, 0), (0.86, 1)])
def test_half_a_step_is_no_pull(front: float, first: int) -> None:
    swing = decay()
    swing[0] = front * swing[1]
    assert ends(half_cycles(swing, step=0.1 * swing[1]))[0][0] == first


def test_wild_half_cycles_are_bridged_and_counted() -> None:
    swing = decay(40)
    swing[[10, 11, 12]] = [0.05, 1.5, 0.05]
    swing[[25, 26]] = [1.5, 0.05]
    (run,) = best_runs(half_cycles(swing), EVERYTHING)
    assert (run.first, run.last, run.bridged) == (0, 39, 5)


def test_a_single_half_cycle_continues_nothing() -> None:
    swing = decay(20)
    swing[18] = 3.0
    assert ends(half_cycles(swing)) == [(0, 17)]


@pytest.mark.parametrize(("slower", "runs"), [(1.25, 1), (1.35, 2)])
def test_what_swings_much_slower_behind_a_pause_is_another_motion(slower: float, runs: int) -> None:
    half = np.full(29, HALF)
    half[14] = 3.0 * HALF
    half[15:] *= slower
    assert len(ends(half_cycles(decay(), half))) == runs


@pytest.mark.parametrize(("size", "runs"), [(3.3, 1), (2.7, 2)])
def test_what_hardly_stands_out_of_the_step_continues_nothing(size: float, runs: int) -> None:
    half = np.full(29, HALF)
    half[14] = 3.0 * HALF
    swing = decay()
    assert len(ends(half_cycles(swing, half, step=swing[15] / size))) == runs


@pytest.mark.parametrize(("pause", "fades"), [(1.6, True), (1.4, False)])
def test_a_run_before_a_rest_fades_and_before_a_knock_does_not(pause: float, fades: bool) -> None:
    swing, half = np.concatenate((decay(20), 3.0 * decay(20))), np.full(39, HALF)
    half[19] *= pause
    found = {run.first: run.fades for run in best_runs(half_cycles(swing, half), EVERYTHING)}
    assert found[0] == fades


@pytest.mark.parametrize(("steps", "fades"), [(0.9, True), (1.1, False)])
def test_a_pull_at_the_end_stands_out_of_the_step(steps: float, fades: bool) -> None:
    swing = decay()
    step = 0.3 * swing[-1]
    ending = 1.3 * swing[-1] + steps * step
    (run,) = best_runs(half_cycles(swing, step=step, ending=ending), EVERYTHING)
    assert run.fades == fades


@pytest.mark.parametrize(("of_free", "driven"), [(0.08, True), (0.13, False)])
def test_a_front_that_loses_a_tenth_of_what_a_free_one_would_is_driven(
    of_free: float, driven: bool
) -> None:
    k = np.arange(41.0)
    swing = np.where(k <= 20, 1.0 - of_free * 0.01 * k, 1.0 - of_free * 0.2 - 0.01 * (k - 20))
    (run,) = best_runs(half_cycles(swing), EVERYTHING)
    assert run.driven == driven


@pytest.mark.parametrize(("steps", "driven"), [(0.002, True), (0.2, False)])
def test_a_front_whose_end_is_lost_in_the_step_is_not_driven(steps: float, driven: bool) -> None:
    swing = np.concatenate((np.ones(20), decay(40)))
    (run,) = best_runs(half_cycles(swing, step=steps), EVERYTHING)
    assert run.driven == driven
