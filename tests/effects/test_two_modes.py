"""Two damped modes are told apart by their readings."""

import numpy as np
import pytest

from pendpipe.analysis.free_decay import measure_recording
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.effects.two_modes import two_modes
from pendpipe.recording import Recording

TIME = np.arange(0.0, 80.0, 0.01)
TRUTH = ((0.80, 0.02, 0.5), (0.86, 0.03, 0.3))


def motion(time: np.ndarray) -> np.ndarray:
    return sum(
        size * np.exp(-loss * time) * np.cos(2.0 * np.pi * hertz * time)
        for hertz, loss, size in TRUTH
    )


def test_frequencies_losses_and_amplitudes_are_within_their_errors() -> None:
    pulls = []
    keep = (TIME < 30.0) | (TIME > 33.0)
    for seed in range(20):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(len(TIME))
        modes = two_modes(TIME[keep], (0.1 + motion(TIME) + noise)[keep], 0.61)
        assert modes is not None
        for mode, truth in zip(modes, TRUTH, strict=True):
            found = (mode.frequency, mode.loss, mode.amplitude)
            pulls += [
                (each.value - true) / each.sd for each, true in zip(found, truth, strict=True)
            ]
            assert not mode.driven
    assert np.std(pulls) == pytest.approx(1.0, abs=0.25)


def test_one_pendulum_is_not_two_modes() -> None:
    # sin x slows it at first; Coulomb friction bends its envelope: no two modes explain that.
    values = sample(Eq8(5.0, 0.05, 0.0, 0.0, 0.02, "sine"), Release(-0.1, 2.5), TIME)
    assert two_modes(TIME, values, 0.65) is None
    noise = np.random.default_rng(1).standard_normal(len(TIME))
    assert two_modes(TIME, noise, 0.6) is None


def test_a_mode_without_loss_is_driven() -> None:
    free = 0.3 * np.exp(-0.05 * TIME) * np.cos(5.0 * TIME)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(TIME))
    modes = two_modes(TIME, free + 0.2 * np.cos(5.3 * TIME) + noise, 0.62)
    assert modes is not None
    assert [mode.driven for mode in modes] == [False, True]


def test_a_knock_is_not_two_modes_where_one_decay_may_do() -> None:
    # Half of the amplitude is regained at once: one mode explains most of it, and so do two.
    one = 0.3 * np.exp(-0.05 * TIME) * np.cos(5.0 * TIME)
    later = np.maximum(TIME - 30.0, 0.0)
    knocked = one + 0.05 * (TIME > 30.0) * np.exp(-0.05 * later) * np.sin(5.0 * later)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(TIME))
    assert two_modes(TIME, knocked + noise, 0.62, may_be_one=True) is None
    beat = motion(TIME) + noise
    assert two_modes(TIME, beat, 0.61, may_be_one=True) is not None


@pytest.mark.parametrize("phase", [0.0, 2.8, np.pi])
def test_a_beat_may_begin_at_its_node_or_at_its_top(phase: float) -> None:
    time = np.arange(700) * 0.0507
    first = 0.1 * np.exp(-0.018 * time) * np.cos(2.0 * np.pi * 0.7075 * time)
    second = 0.09 * np.exp(-0.018 * time) * np.cos(2.0 * np.pi * 0.7345 * time + phase)
    noise = 8e-4 * np.random.default_rng(3).standard_normal(len(time))
    points, _ = measure_recording(Recording(time, first + second + noise, "angle_rad"), "the test")
    assert any(note.startswith("two modes beat: 0.707") for note in points.notes)
