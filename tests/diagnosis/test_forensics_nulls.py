"""Noise that must not pass for a fault, and faults that are found again in what is left."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.detect import Detection
from pendpipe.diagnosis.faults import correct
from pendpipe.diagnosis.forensics import Finder
from pendpipe.diagnosis.forensics.colour import note_level
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.slips import find_lost_samples
from pendpipe.diagnosis.forensics.tails import Tail, fit_tail, tail_of_squares
from pendpipe.diagnosis.found import Finding
from pendpipe.diagnosis.hypothesis import Hypothesis, Task, settled
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import is_gross, refine
from pendpipe.diagnosis.rivals import NO_SCAN
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.dynamics.eq8 import OMEGA
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from .faults import (
    AIR,
    NOISES,
    STEP_16,
    TESTS,
    Fitted,
    Noisy,
    Pendulum,
    fitted,
    null,
    rounded,
    smoothed,
)
from .records import (
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    hypothesis_of,
    other_engine,
    prepared,
    task_of,
    white,
)

# Noise alone is not taken for a fault, whatever its kind.

_RECORDS = 6
CLEAN: dict[Pendulum, FloatArray] = {}


def p_values(kind: str) -> dict[str, FloatArray]:
    found: dict[str, list[float]] = {name: [] for name in TESTS}
    for seed in range(_RECORDS):
        record = null(seed, kind, CLEAN)
        assert find_lost_samples(record.data, record.fit) == []
        for name, find in TESTS.items():
            finding = find(record.data, record.fit, record.noise, record.samples)
            found[name].append(finding.p_value if finding.kind == "fault" else 1.0)
    return {name: np.array(values) for name, values in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(NOISES))
def test_noise_is_no_fault(kind: str) -> None:
    for name, values in p_values(kind).items():
        assert values.shape == (_RECORDS,)
        assert np.all((values >= 0.0) & (values <= 1.0)), name
        # Six records and nine tests: one in twenty suites would see p < 1e-3 once.
        assert values.min() > 2e-4, name


@pytest.mark.slow
def test_smoothed_noise_has_no_glitches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its whitening filter lacks neighbours at the ends of the record."""
    monkeypatch.setitem(NOISES, "running mean of 5", Noisy(smoothed))
    records = [null(seed, "running mean of 5", CLEAN) for seed in range(40)]
    found = [TESTS["glitches"](r.data, r.fit, r.noise, r.samples).p_value for r in records]
    # One in a hundred suites would see less once in forty.
    assert min(found) > 2.5e-4


@pytest.mark.slow
def test_the_p_values_of_the_jitter_test_are_uniform() -> None:
    values = np.concatenate([p_values(kind)["jitter"] for kind in ("white", "Student, nu = 5")])
    # Kolmogorov and Smirnov's distance from the diagonal, at 1 %.
    ordered, steps = np.sort(values), np.arange(1, len(values) + 1) / len(values)
    distance = np.max(np.maximum(steps - ordered, ordered - (steps - 1.0 / len(values))))
    assert distance < 1.63 / math.sqrt(len(values))


@pytest.mark.parametrize("freedom", [1e9, 8.0])
def test_the_largest_of_many_errors_is_tested_against_their_tail(freedom: float) -> None:
    generator = np.random.default_rng(4)
    chances = []
    for _ in range(300):
        size = np.sort(np.abs(generator.standard_t(freedom, 3000)))
        chances.append(-math.expm1(3000.0 * math.log1p(-float(fit_tail(size, 1).beyond(size[-1])))))
    for level in (0.3, 0.1):
        expected = level * len(chances)
        assert np.sum(np.array(chances) < level) < expected + 3.3 * math.sqrt(expected)


def test_rounding_does_not_imply_thin_tails() -> None:
    # A step of 2.3 standard deviations fills the bulk of the errors and leaves their tails.
    generator, step, chances, unaware = np.random.default_rng(5), 2.3, [], []
    for _ in range(200):
        noise = generator.standard_t(8.0, 3000) * math.sqrt(0.75)
        size = np.sort(np.abs(noise + step * generator.uniform(-0.5, 0.5, 3000)))
        for found, known in ((chances, step), (unaware, 0.0)):
            beyond = float(fit_tail(size, 1, step=known).beyond(size[-1]))
            found.append(-math.expm1(3000.0 * math.log1p(-beyond)))
    for level in (0.3, 0.1, 0.03):
        expected = level * len(chances)
        assert np.sum(np.array(chances) < level) < expected + 3.3 * math.sqrt(expected)
    assert np.mean(np.array(unaware) < 0.03) > 0.1


def ruled_by_rounding(seed: int, extra: FloatArray | float = 0.0) -> tuple[Fitted, float]:
    """A tenth of a step of noise, estimated as in a search; and the finding, in steps."""
    clean = CLEAN.setdefault(AIR, AIR.model().reading(AIR.values()))
    record = fitted(AIR, rounded(clean + white(seed, AIR.count, 0.1 * STEP_16), STEP_16) + extra)
    fit, data, judged = settled(record.fit, record.data, record.noise, ())
    assert data.lattice is not None
    record = replace(record, fit=fit, data=data, noise=judged)
    finding = TESTS["coarse-quantisation"](data, fit, judged, record.samples)
    return record, finding.parameters["noise_over_step"].value


@pytest.mark.slow
def test_a_reading_beyond_the_edge_of_a_code_is_not_a_glitch() -> None:
    # It is a whole step off the code that was due, and yet hardly half a step off the angle.
    for seed in range(20):
        record, before_rounding = ruled_by_rounding(seed)
        finding = TESTS["glitches"](record.data, record.fit, record.noise, record.samples)
        assert finding.p_value > 1e-3
        assert before_rounding == pytest.approx(0.1, abs=0.035)


def test_a_reading_two_steps_off_is_one() -> None:
    record, _ = ruled_by_rounding(3, 2.0 * STEP_16 * (np.arange(AIR.count) == 1234))
    finding = TESTS["glitches"](record.data, record.fit, record.noise, record.samples)
    assert finding.p_value < 1e-6
    assert finding.mask is not None
    assert np.flatnonzero(finding.mask).tolist() == [1234]
    assert finding.parameters["largest"].value == pytest.approx(2.0 * STEP_16, rel=0.35)


def test_a_rounded_error_is_beyond_as_often_as_drawn() -> None:
    generator, step = np.random.default_rng(6), 1.5
    rounding = step * generator.uniform(-0.5, 0.5, 400_000)
    drawn = np.abs(generator.standard_t(6.0, 400_000) + rounding)
    tail = Tail(np.array([6.0]), np.ones(1), np.ones(1), step)
    for size in (1.0, 2.0, 4.0):
        assert tail.beyond(np.array(size)) == pytest.approx(np.mean(drawn > size), rel=0.03)


@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (5.0, 1.0, 0.2, 0.1), (2.0, -1.0, 0.5)])
def test_weighted_squares_are_as_large_as_often_as_drawn_ones(weights: tuple[float, ...]) -> None:
    weight = np.array(weights)
    drawn = np.random.default_rng(0).standard_normal((400_000, len(weight))) ** 2 @ weight
    for share in (0.9, 0.5, 0.1, 0.01, 0.001):
        total = float(np.quantile(drawn, 1.0 - share))
        assert tail_of_squares(total, weight) == pytest.approx(share, rel=0.12)


def test_one_square_of_many_is_chi_squared() -> None:
    from scipy.stats import chi2

    for total in (20.0, 60.0, 120.0, 300.0):
        wanted = float(chi2.sf(total, 60))
        assert tail_of_squares(total, np.ones(60)) == pytest.approx(wanted, rel=0.02)


def test_an_encoders_counts_have_no_codes_and_no_jitter() -> None:
    record = null(0, "12 bit, 0.8 steps", CLEAN)
    samples: Samples = replace(record.samples, counts=True, step=None)
    data = replace(record.data, time_noise=True)
    for name in ("missing-codes", "coarse-quantisation", "jitter", "clipping", "coloured-noise"):
        assert TESTS[name](data, record.fit, record.noise, samples).p_value == 1.0


def test_noise_that_falls_is_said_to_change_in_time_and_is_no_fault() -> None:
    pendulum = AIR
    clean = pendulum.model().reading(pendulum.values())
    falling = np.linspace(3.0, 1.0, pendulum.count)
    white = 1e-4 * np.random.default_rng(1).standard_normal(pendulum.count)
    said = []
    for noise in (falling * white, white):
        record = fitted(pendulum, clean + noise)
        note = note_level(Evidence(record.data, record.fit, record.noise, record.samples))
        said.append(note and note.summary)
    assert "larger in the first half" in str(said[0])
    assert said[1] is None


# What looked like a fault before the physics was known is tested again with it.

LEVEL, ODD = 0.01, 812
NOTHING = Detection((), 1.0, NO_SCAN)


def blamed(error: float, odd: int = ODD) -> tuple[Task, Hypothesis]:
    """A search with the right model, and one reading that was masked as a glitch."""
    readings = other_engine(TRUTH) + white(21)
    # Its own noise taken off: it is wrong by just so much.
    readings[odd] = other_engine(TRUTH)[odd] + error * NOISE_RAD
    data, _ = prepared(readings)
    mask = np.arange(len(readings)) == odd
    data = data.masked(mask)
    noise = white_noise(data, NOISE_RAD)
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    faults = (Finding("glitches", 1e-7, mask=mask),)
    samples = prepare(Recording(TIME_S, readings, "angle_rad"), "the test")
    state = hypothesis_of(fit, data, noise, (), fit, samples, faults=faults, first=NOTHING)
    return task_of(samples), state


@pytest.mark.parametrize("error", [0.5, 3.0, -3.5])
def test_a_reading_that_noise_explains_in_the_end_returns(error: float) -> None:
    task, before = blamed(error)
    state = correct(before, task)
    assert state.faults == ()
    assert state.data.used == len(TIME_S)
    assert np.array_equal(state.noise.weight, state.data.weight)
    # It counts again; and the record is no more suspicious than its tests say now.
    assert state.fit.chi2 > before.fit.chi2 or abs(error) < 1.0
    assert state.p_value > LEVEL


@pytest.mark.parametrize("error", [12.0, -30.0])
def test_a_reading_that_nothing_explains_stays_out_and_is_measured_anew(error: float) -> None:
    task, state = blamed(error)
    state = correct(state, task)
    (fault,) = state.faults
    assert state.data.weight[ODD] == 0.0
    assert state.data.used == len(TIME_S) - 1
    assert fault.p_value < LEVEL
    assert state.p_value == fault.p_value
    largest = fault.parameters["largest"].value
    assert largest == pytest.approx(error * NOISE_RAD, abs=2.0 * NOISE_RAD)


@pytest.mark.parametrize("gains", [(30.0, 300.0), (300.0, 30.0)])
def test_the_finding_that_pays_most_is_applied_first_and_one_that_does_not_pay_never(
    gains: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The order in which the tests are declared does not matter."""
    task, begun = blamed(0.0)
    said: list[str] = []
    masks = [np.arange(len(TIME_S)) == row for row in (100, 200)]
    names = ("clipping", "glitches")
    found = [
        Finding(name, 1e-9, gain, mask=mask)
        for name, gain, mask in zip(names, gains, masks, strict=True)
    ]
    found.append(Finding("clock-slips", 1e-9, time_s=TIME_S + 1e-5 * TIME_S, price=1e3))
    finders = tuple(
        Finder(each.identifier, lambda *_, each=each: each, repeats=True) for each in found
    )
    monkeypatch.setattr("pendpipe.diagnosis.faults.FINDERS", finders)
    state = correct(replace(begun, faults=()), replace(task, progress=said.append))
    order = sorted(names, key=lambda name: -gains[names.index(name)])
    assert [fault.identifier for fault in state.faults] == order
    assert [line.split(":")[0] for line in said] == order
    assert np.flatnonzero(state.data.weight == 0.0).tolist() == [100, 200, ODD]


def test_a_test_that_reports_nothing_counts_by_its_chance() -> None:
    """The farther off one reading, the less likely the record, before it is called a glitch."""
    chances = []
    for error in (4.8, 5.0, 5.2):  # fifteen tests share the level
        task, state = blamed(error)
        data = replace(state.data, weight=np.ones(len(TIME_S)))
        noise = white_noise(data, NOISE_RAD)
        state = correct(replace(state, faults=(), data=data, noise=noise), task)
        assert state.faults == ()
        chances.append(state.p_value)
    assert LEVEL < chances[2] < chances[1] < chances[0] < 1.0
    # As the tail of a normal distribution falls: by seven.
    assert chances[2] < 0.25 * chances[0]


def test_glitches_are_masked_before_a_model_that_is_far_off_is_mended() -> None:
    """No other test can judge by such a model; readings apart from their neighbours can."""
    task, right = blamed(0.0)
    readings = right.data.values.copy()
    wild = [300, 801, 1200]
    readings[wild] += 40.0 * NOISE_RAD
    data, _ = prepared(readings)
    noise, off = white_noise(data, NOISE_RAD), TRUTH.copy()
    off[OMEGA] *= 1.01
    fit = refine(right.fit.model, data, noise, off, held=(OMEGA,))
    assert is_gross(fit, data)
    state = correct(hypothesis_of(fit, data, noise, (OMEGA,), fit, right.samples), task)
    (fault,) = state.faults
    assert fault.identifier == "glitches"
    assert np.flatnonzero(state.data.weight == 0.0).tolist() == wild


@functools.cache
def clipped_at(level_rad: float) -> FloatArray:
    return np.minimum(other_engine(TRUTH) + white(5), level_rad)


def test_clipping_is_reported_once() -> None:
    """A nonlinear sensor is tried first; with the clipped readings masked it is not needed."""
    level = 0.9 * float(other_engine(TRUTH).max())
    found = diagnose_recording(Recording(TIME_S, clipped_at(level), "angle_rad"))
    (effect,) = found.effects
    assert effect.identifier == "clipping"
    assert effect.parameters["upper_level"].value == pytest.approx(level, rel=1e-6)
    assert effect.parameters["number"].value == np.count_nonzero(clipped_at(level) == level)
    assert effect.delta_chi2 > 1e3
    assert found.p_value < 1e-6


@pytest.mark.parametrize("off", [-1.2, -0.6, 0.0, 0.7, 1.2])
def test_lost_samples_are_placed_between_the_right_readings(off: float) -> None:
    """A quarter of a cycle lost; the fit is begun `off` intervals from the instant."""
    lost, instant = 0.27, TIME_S[700] + 0.5 * INTERVAL_S
    model = Model(TIME_S, INTERVAL_S, (by_identifier("dropped-samples"),))
    truth = np.concatenate([TRUTH, [lost, instant]])
    data, noise = prepared(model.reading(truth) + white(8))
    start = truth + np.array([*np.zeros(len(TRUTH)), 0.0, off * INTERVAL_S])
    found = with_better_instants(refine(model, data, noise, start), data, noise, ())
    assert found.chi2 / data.used == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / data.used))
    assert found.value[-2] == pytest.approx(lost, abs=5e-4)
    # A reading within the jump is the same on both sides of a turning point.
    assert abs(found.value[-1] - instant) < INTERVAL_S
