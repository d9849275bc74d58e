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
    middle = np.concatenate(([0.0], np.cumsum(np.broadcast_to(half, len(swing) - 1))))
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


def kicked(factor: float, at: int = 15) -> np.ndarray:
    """A decay whose half cycles are larger by a factor from one of them on."""
    return decay() * np.where(np.arange(30) < at, 1.0, factor)


def halves(pause: float, after: float = 1.0) -> np.ndarray:
    """Half periods, the fifteenth of them longer by a factor, and those after it by another."""
    return HALF * np.concatenate((np.ones(14), [pause], np.full(14, after)))


def first(factor: float) -> np.ndarray:
    """A decay whose first half cycle is so much of the second."""
    return np.concatenate(([factor * 0.98], decay()[1:]))


STEP = 0.2 * decay()[14]
ONE, TWO = [(0, 29)], [(0, 14), (15, 29)]
WITHOUT_FIRST = [(1, 29)]
UP_AND_DOWN = np.where(np.arange(30) // 2 % 2 == 0, 1.0, -1.0)
PULL = np.concatenate(([0.2, 0.4, 0.6, 0.8], decay()))
RUNS = {
    # A kick by more than a third begins anew, unless a step of the converter makes the difference.
    "small kick": (kicked(1.25), HALF, 0.0, ONE),
    "kick": (kicked(1.45), HALF, 0.0, TWO),
    "kick of a step": (kicked(1.4), HALF, STEP, ONE),
    "kick of more than a step": (kicked(1.6), HALF, STEP, TWO),
    # A stop to less than three tenths ends a run.
    "loss of two thirds": (kicked(0.33), HALF, 0.0, ONE),
    "stop": (kicked(0.27), HALF, 0.0, TWO),
    # A half period may differ from those beside it by three tenths.
    # Two parts would be joined again, were they of one amplitude.
    "longer": (kicked(0.45), halves(1.32), 0.0, ONE),
    "too long": (kicked(0.45), halves(1.40), 0.0, TWO),
    "shorter": (kicked(0.45), halves(0.76), 0.0, ONE),
    "too short": (kicked(0.45), halves(0.71), 0.0, TWO),
    # A decay goes on behind a disturbance of four half periods, from half its amplitude on.
    "disturbance": (kicked(0.55), halves(4.2), 0.0, ONE),
    "disturbance, then larger": (kicked(1.1), halves(4.2), 0.0, ONE),
    "disturbance, then far smaller": (kicked(0.45), halves(4.2), 0.0, TWO),
    "long disturbance": (kicked(0.55), halves(4.8), 0.0, TWO),
    "long disturbance, then larger": (kicked(1.1), halves(4.8), 0.0, TWO),
    # What swings much slower behind a pause is another motion.
    "pause, then slower": (decay(), halves(3.0, 1.25), 0.0, ONE),
    "pause, then much slower": (decay(), halves(3.0, 1.35), 0.0, TWO),
    # What hardly stands out of the step continues nothing.
    "pause, then above the step": (decay(), halves(3.0), decay()[15] / 3.3, ONE),
    "pause, then in the step": (decay(), halves(3.0), decay()[15] / 2.7, TWO),
    # A first swing smaller than the next is a pull, unless half a step makes the difference.
    "nearly as large": (first(0.95), HALF, 0.0, ONE),
    "pull": (first(0.90), HALF, 0.0, WITHOUT_FIRST),
    "pull of less than half a step": (first(0.90), HALF, 0.098, ONE),
    "pull of more than half a step": (first(0.86), HALF, 0.098, WITHOUT_FIRST),
    # All of a pull is cut, at the head of each run, wherever that begins.
    "long pull": (PULL, HALF, 0.0, [(4, 33)]),
    # Half periods, or amplitudes, that waver by an eighth are no pendulum's.
    "wavering periods": (decay(), HALF * (1.0 + 0.05 * UP_AND_DOWN[:29]), 0.0, ONE),
    "periods too uneven": (decay(), HALF * (1.0 + 0.07 * UP_AND_DOWN[:29]), 0.0, []),
    "wavering amplitudes": (decay() * np.exp(0.05 * UP_AND_DOWN), HALF, 0.0, ONE),
    "amplitudes too uneven": (decay() * np.exp(0.07 * UP_AND_DOWN), HALF, 0.0, []),
    "uneven by the step": (decay() * np.exp(0.07 * UP_AND_DOWN), HALF, 0.5 * decay()[15], ONE),
    # Sides that differ, or a drifting zero, make them alternate, and that is one.
    "periods by sides": (decay(), HALF * (1.0 + 0.07 * side(29)), 0.0, ONE),
    "amplitudes by sides": (decay() * np.exp(0.1 * side(30)), HALF, 0.0, ONE),
    # The last half cycles of Coulomb friction belong to the decay; a single one continues nothing.
    "Coulomb friction": (
        np.append(np.arange(30, 1, -1) / 30.0 - 0.025, 0.2 * (2 / 30.0 - 0.025)), HALF, 0.0, ONE
    ),
    "wild half cycle": (np.append(decay(18), [3.0, decay()[19]]), HALF, 0.0, [(0, 17)]),
}  # fmt: skip


@pytest.mark.parametrize("case", RUNS)
def test_half_cycles_follow_one_another_within_limits(case: str) -> None:
    swing, half, step, expected = RUNS[case]
    assert ends(half_cycles(swing, half, step)) == expected


def test_a_pull_is_cut_at_the_head_of_a_later_run_too() -> None:
    later = np.concatenate((0.1 * decay(10), PULL[2:]))
    assert ends(half_cycles(later))[-1] == (12, 41)


FALLING = np.arange(41.0)


def front(of_free: float) -> np.ndarray:
    """Twenty half cycles that lose a part of what those behind them lose."""
    bent = 1.0 - of_free * 0.2 - 0.01 * (FALLING - 20)
    return np.where(FALLING <= 20, 1.0 - of_free * 0.01 * FALLING, bent)


def held_up(count: int, after: int = 40) -> np.ndarray:
    return np.concatenate((np.ones(count), decay(after)))


@pytest.mark.parametrize(
    ("swing", "step", "begins"),
    [
        # A median of seven begins to fall when its middle does.
        (held_up(20, 60), 0.0, 20),
        (held_up(3, 60), 0.0, None),
        # It loses less than a tenth of what a free one would.
        (front(0.08), 0.0, 20),
        (front(0.13), 0.0, None),
        # Its end is lost in the step.
        (held_up(20), 0.002, 20),
        (held_up(20), 0.2, None),
    ],
)
def test_a_front_held_up_is_cut_where_the_fall_begins(
    swing: np.ndarray, step: float, begins: int | None
) -> None:
    (run,) = best_runs(half_cycles(swing, step=step), EVERYTHING)
    assert run.driven == (begins is not None)
    assert run.first == pytest.approx(begins or 0, abs=3 if begins else 0)


LAST = decay()[-1]


@pytest.mark.parametrize(
    ("step", "ending", "fades"),
    [
        (0.0, 1.25 * LAST, True),
        (0.0, 1.35 * LAST, False),
        # A pull at the end stands out of the step.
        (0.3 * LAST, 1.57 * LAST, True),
        (0.3 * LAST, 1.63 * LAST, False),
    ],
)
def test_a_decay_fades_unless_the_record_ends_in_a_pull(
    step: float, ending: float, fades: bool
) -> None:
    (run,) = best_runs(half_cycles(decay(), step=step, ending=ending), EVERYTHING)
    assert run.fades == fades


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


@given(scale=st.floats(1e-3, 1e3), pace=st.floats(1e-2, 1e2), kick=st.floats(0.2, 2.0))
def test_units_do_not_matter(scale: float, pace: float, kick: float) -> None:
    swing = decay()
    swing[12:] *= kick
    cycles = half_cycles(swing, step=0.01)
    assert ends(half_cycles(scale * swing, HALF * pace, 0.01 * scale)) == ends(cycles)


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


def test_wild_half_cycles_are_bridged_and_counted() -> None:
    swing = decay(40)
    swing[[10, 11, 12]] = [0.05, 1.5, 0.05]
    swing[[25, 26]] = [1.5, 0.05]
    (run,) = best_runs(half_cycles(swing), EVERYTHING)
    assert (run.first, run.last, run.bridged) == (0, 39, 5)


@pytest.mark.parametrize(("pause", "fades"), [(1.6, True), (1.4, False)])
def test_a_run_before_a_rest_fades_and_before_a_knock_does_not(pause: float, fades: bool) -> None:
    swing, half = np.concatenate((decay(20), 3.0 * decay(20))), np.full(39, HALF)
    half[19] *= pause
    found = {run.first: run.fades for run in best_runs(half_cycles(swing, half), EVERYTHING)}
    assert found[0] == fades
