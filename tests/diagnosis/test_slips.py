"""Lost counts and clock slips: found and undone where they are whole, and else not."""

from typing import NamedTuple

import numpy as np
import pytest

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.faults import _with
from pendpipe.diagnosis.forensics import slips
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.result import Finding
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from .records import hypothesis_of, swung

OMEGA, LOSS, START, COUNT, RATE_HZ = 5.0, 0.004, 0.6, 0.02, 60.0


class Swing(NamedTuple):
    """A pendulum under sin x, by scipy's integrator, every millisecond."""

    time_s: FloatArray
    angle: FloatArray


@pytest.fixture(scope="module")
def swing() -> Swing:
    time = np.arange(0.0, 62.0, 1e-3)
    return Swing(time, swung(time, START, OMEGA, LOSS)[0])


def counted(swing: Swing, level: FloatArray) -> Samples:
    """An encoder that writes a row at each edge that it passes; the level is what it counts."""
    edges = np.floor(swing.angle / COUNT).astype(np.int64)
    passed = np.flatnonzero(np.diff(edges)) + 1
    angle = COUNT * np.maximum(edges[passed], edges[passed - 1])
    # Where within the millisecond it passed.
    late = (angle - swing.angle[passed - 1]) / (swing.angle[passed] - swing.angle[passed - 1])
    time = swing.time_s[passed - 1] + 1e-3 * late
    keep = np.append(True, np.diff(time) > 0.0)
    return Samples(
        time[keep], (angle + level[passed])[keep], "rad", None, 0.05 * COUNT, counts=True
    )


def after_reversals(swing: Swing, random: np.random.Generator, sizes: FloatArray) -> FloatArray:
    """A level that steps after some turning points."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(swing.angle)))) + 30
    level = np.zeros(len(swing.time_s))
    level[random.choice(turns[4:-4], len(sizes), replace=False)] = sizes
    return np.asarray(np.cumsum(level))


def fit_of(data: Data) -> Fit:
    model = Model(data.time_s, data.interval_s, (circular_error,), order=20)
    start = np.array([0.0, LOSS, 0.0, 0.5, OMEGA, START, 0.0, 0.0, 1.0])
    return refine(model, data, white_noise(data, 2e-4), start)


def test_counts_lost_after_reversals_are_found_and_undone(swing: Swing) -> None:
    random = np.random.default_rng(3)
    sizes = COUNT * random.choice([-1.0, 1.0], 18)
    level = after_reversals(swing, random, sizes)
    corrected, finding = found("count-slips", counted(swing, level))
    assert finding.p_value < 1e-6
    assert finding.parameters["number"].value == 18
    step = finding.parameters["step"]
    assert abs(step.value - COUNT) < 3.0 * step.sd < 0.02 * COUNT
    truth = counted(swing, np.zeros_like(level)).values
    wrong = np.abs(corrected.values - truth - (corrected.values - truth)[0]) > 0.5 * COUNT
    # Only between the reversal and the next row or two.
    assert np.mean(wrong) < 0.01
    assert finding.confirmed.p_value < 1e-3


def test_a_level_that_steps_by_any_amount_is_no_lost_count(swing: Swing) -> None:
    random = np.random.default_rng(4)
    named = 0
    for _ in range(3):
        sizes = COUNT * random.uniform(0.6, 2.6, 18) * random.choice([-1.0, 1.0], 18)
        _, finding = found("count-slips", counted(swing, after_reversals(swing, random, sizes)))
        named += finding.p_value < 1e-3
        assert finding.confirmed is None or finding.confirmed.p_value > 0.01
    assert named == 0


def test_an_encoder_that_loses_nothing_has_no_slips(swing: Swing) -> None:
    _, finding = found("count-slips", counted(swing, np.zeros(len(swing.time_s))))
    assert finding.p_value == 1.0


def found(name: str, samples: Samples) -> tuple[Data, Finding]:
    time, values = samples.time_s, samples.values
    uniform = not samples.counts
    data = Data(
        time,
        values,
        float(np.median(np.diff(time))),
        uniform,
        np.ones(len(time)),
        time_noise=samples.counts,
        noise_rms=samples.noise_rms,
    )
    find = slips.find_clock if name == "clock-slips" else slips.find_counts
    noise, fit = white_noise(data, 2e-4), fit_of(data)
    finding = find(Evidence(data, fit, noise, samples)) or Finding(name, 1.0)
    return _with(finding, hypothesis_of(fit, data, noise, (), fit, samples)).data, finding


def clocked(swing: Swing, rows: IntArray, sizes: FloatArray, seed: int) -> Samples:
    """Readings by a clock that is ahead of its stamps by whole samples, or parts of them."""
    stamps = np.arange(0.0, 60.0, 1.0 / RATE_HZ)
    late = np.zeros(len(stamps))
    late[rows] = sizes / RATE_HZ
    angle = np.interp(stamps + np.cumsum(late) + 1.0, swing.time_s, swing.angle)
    noise = 1e-4 * np.random.default_rng(seed).standard_normal(len(stamps))
    return Samples(stamps + 1.0, angle + noise, "rad", None, 1e-4)


@pytest.mark.parametrize("whole", [True, False])
def test_a_clock_slips_by_whole_samples_or_it_is_no_slip(swing: Swing, whole: bool) -> None:
    random = np.random.default_rng(5)
    rows = np.sort(random.choice(np.arange(200, 3400), 14, replace=False))
    sizes = random.choice([-1.0, 1.0], 14) * (1.0 if whole else random.uniform(0.6, 2.4, 14))
    corrected, finding = found("clock-slips", clocked(swing, rows, sizes, 6))
    if not whole:
        assert finding.p_value > 1e-3
        return
    assert finding.p_value < 1e-5
    # Without the model: the slips are steps of the time in the readings as they are.
    assert finding.confirmed.summary.startswith("14 steps")
    assert finding.parameters["number"].value == 14
    moved = corrected.time_s - (np.arange(len(corrected)) / RATE_HZ + 1.0)
    truth = np.cumsum(np.bincount(rows, sizes, len(corrected))) / RATE_HZ
    assert np.mean(np.abs(moved - moved[0] - truth) > 1e-3) < 0.01


@pytest.mark.parametrize("number", [4, 9, 30])
def test_steps_of_any_size_are_seldom_whole(number: int) -> None:
    sizes = np.random.default_rng(number).uniform(0.5, 3.5, (4000, number))
    rows = np.arange(number)
    p_values = np.array([slips.Slips(rows, each).p_value for each in sizes])
    for level in (0.05, 0.01):
        assert 0.5 * level < np.mean(p_values < level) < 1.5 * level


def test_counts_are_lost_from_an_encoder_that_is_read_at_fixed_times(swing: Swing) -> None:
    # Undone in the readings as recorded too: a level one count higher is no end of the range.
    count, random = 2e-3, np.random.default_rng(5)
    rows = np.sort(random.choice(np.arange(200, 3500), 14, replace=False))
    level = np.zeros(len(swing.time_s[::16]))
    level[rows] = random.choice([-1.0, 1.0], len(rows))
    dither = 0.4 * random.standard_normal(len(level))
    angle = count * np.round(swing.angle[::16] / count + dither + np.cumsum(level))
    answer = diagnose_recording(Recording(swing.time_s[::16], angle, "angle_rad"))
    names = {each.identifier: each for each in answer.effects}
    assert {"circular-error", "count-slips"} <= set(names)
    assert set(names) <= {"circular-error", "count-slips", "coarse-quantisation"}
    lost = names["count-slips"].parameters
    assert lost["step"].value == pytest.approx(count, rel=0.02)
    assert abs(lost["number"].value - len(rows)) <= 3
