"""Noise alone is not taken for a fault, whatever its kind."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.colour import note_level
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.lost_samples import find_lost_samples
from pendpipe.diagnosis.forensics.tails import Tail, fit_tail, tail_of_squares
from pendpipe.diagnosis.hypothesis import settled

from .decays import Fitted, Pendulum, fitted, rounded
from .examine import TESTS
from .faults import AIR, NOISES, STEP_16, Noisy, null, smoothed

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


@pytest.mark.parametrize("kind", list(NOISES))
def test_noise_is_no_fault(kind: str) -> None:
    for name, values in p_values(kind).items():
        assert values.shape == (_RECORDS,)
        assert np.all((values >= 0.0) & (values <= 1.0)), name
        # Six records and nine tests: one in twenty suites would see p < 1e-3 once.
        assert values.min() > 2e-4, name


def test_smoothed_noise_has_no_glitches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its whitening filter lacks neighbours at the ends of the record."""
    monkeypatch.setitem(NOISES, "running mean of 5", Noisy(smoothed))
    records = [null(seed, "running mean of 5", CLEAN) for seed in range(40)]
    found = [TESTS["glitches"](r.data, r.fit, r.noise, r.samples).p_value for r in records]
    # One in a hundred suites would see less once in forty.
    assert min(found) > 2.5e-4


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
    noise = 0.1 * STEP_16 * np.random.default_rng(seed).standard_normal(AIR.count)
    clean = CLEAN.setdefault(AIR, AIR.model().reading(AIR.values()))
    record = fitted(AIR, rounded(clean + noise, STEP_16) + extra)
    fit, data, judged = settled(record.fit, record.data, record.noise, ())
    assert data.lattice is not None
    record = replace(record, fit=fit, data=data, noise=judged)
    finding = TESTS["coarse-quantisation"](data, fit, judged, record.samples)
    return record, finding.parameters["noise_over_step"].value


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
