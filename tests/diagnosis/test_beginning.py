"""A diagnosis begins with the fit: sin x is presumed and fitted, and no finding."""

import numpy as np
import pytest

from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.free_decay import measure_recording
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.hypothesis import first_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.effects.baseline import OMEGA, START
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from .records import INTERVAL_S, TIME_S, TRUTH, beginning_of, recording, swung, white

LARGE = np.array(TRUTH)
LARGE[START] = 1.2 * np.sign(TRUTH[START])


def swinging(restoring: Restoring) -> FloatArray:
    a, b, c, share, omega, angle, start_s, offset = LARGE.tolist()
    law = Eq8(omega, a, share * b, (1.0 - share) * b, c, restoring)
    return sample(law, Release(start_s, angle, offset), TIME_S)


def test_a_diagnosis_begins_with_the_fit_that_is_printed() -> None:
    record = recording(swinging("sine"), 4)
    points, part = measure_recording(record, "the test")
    fit, begun = fit_recording(part, points=points), beginning_of(record)
    assert fit.restoring == begun.model.restoring == "sine"
    noise = first_noise(begun)
    there = refine(begun.model, begun.data, noise, begun.value, rounds=0).chi2
    best = refine(begun.model, begun.data, noise, begun.value, held=begun.held)
    # Other than the fit, the diagnosis has a prior on the share of b: it has yet to move a little.
    assert there - best.chi2 < 1.0
    assert begun.value[OMEGA] == pytest.approx(LARGE[OMEGA], rel=1e-5)
    answer = diagnose_recording(record).to_dict()
    assert answer["baseline"]["parameters"] == {
        name: each.as_json() for name, each in fit.parameters.items()
    }
    for name in ("noise_rms_rad", "residual_rms_rad", "chi2_per_dof", "fit_p_value"):
        assert answer["baseline"][name] == getattr(fit, name)
    assert answer["noise_rms_rad"] == fit.noise_rms_rad
    assert answer["restoring"] == "sine"
    (presumed,) = answer["effects"]
    assert presumed["id"] == "circular-error"
    assert presumed["presumed"]
    assert presumed["delta_chi2"] > 1e4
    assert answer["verdict"] == "consistent"


def test_a_linear_torque_is_not_taken_for_a_pendulum() -> None:
    answer = diagnose_recording(recording(swinging("linear"), 3)).to_dict()
    assert answer["restoring"] == "linear"
    assert answer["effects"] == []
    assert answer["verdict"] == "consistent"


def test_a_short_record_of_a_pendulum_is_a_pendulums_first() -> None:
    """The linear law keeps the phase; a cubic torque takes up what a second plane changes too."""
    time_s, values = TIME_S[:600], np.append(TRUTH, [1.0, 6e-3, 2e-3, 0.01])
    values[[0, 1, 2, 3, START]] = 0.0, 0.02, 0.0, 0.0, 0.26
    effects = by_identifier("circular-error"), by_identifier("plane-coupling")
    readings = Model(time_s, INTERVAL_S, effects).reading(values) + white(1, 600, 1.4e-3)
    found = diagnose_recording(Recording(time_s, readings, "angle_rad"))
    presumed = found.effects[0]
    assert (presumed.identifier, presumed.presumed) == ("circular-error", True)
    assert "cubic-stiffness" not in {each.identifier for each in found.missing}


def test_time_stamps_are_corrected_after_sin_x_was_fitted_to_them() -> None:
    """1511 readings at even times, stamped late at random: a regular clock keeps 1500 of them."""
    time_s, values = INTERVAL_S * np.arange(1511), np.append(TRUTH, 1.0)
    values[START] = 0.3
    readings = Model(time_s, INTERVAL_S, (by_identifier("circular-error"),)).reading(values)
    late_s = 0.1 * INTERVAL_S * np.random.default_rng(2).random(1511)
    found = diagnose_recording(Recording(time_s + late_s, readings + white(2, 1511), "angle_rad"))
    assert len(found.search.data) == 1500
    assert found.effects[0].identifier == "circular-error"
    assert any("the readings are not" in note for note in found.search.notes.values())


def test_two_coupled_pendulums_are_two_modes_at_their_frequencies() -> None:
    # x'' = -omega^2 x - kappa (x - z) and z'' = -omega^2 z - kappa (z - x), released at x alone.
    omega, kappa, loss = 4.5, 0.9, 0.015
    time_s = np.arange(0.0, 80.0, 0.05)
    low, high = omega, np.sqrt(omega**2 + 2.0 * kappa)
    envelope = 0.06 * np.exp(-loss * time_s)
    angle_rad = envelope * (np.cos(low * time_s) + np.cos(high * time_s))
    noise = 3e-4 * np.random.default_rng(4).standard_normal(len(time_s))
    found = diagnose_recording(Recording(time_s, angle_rad + noise, "angle_rad"))
    assert [each.identifier for each in found.effects] == ["second-mode"]
    assert found.effects[0].probability > 0.95
    own, other = (
        found.improved.parameters["frequency"],
        found.effects[0].parameters["f_2"],
    )
    modes = sorted((2.0 * np.pi * each.value, 2.0 * np.pi * each.sd) for each in (own, other))
    for (value, sd), truth in zip(modes, (low, high), strict=True):
        # Damping lowers a frequency by loss^2/(2 omega).
        assert value == pytest.approx(truth, abs=4.0 * sd + loss**2 / (2.0 * truth))
    assert found.improved.chi2_per_dof == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("omega", "amplitude", "duration_s"), [(3.0464, 0.4634, 72), (5.22, 1.0, 34)]
)
def test_a_gyroscope_shows_sin_x_and_no_lost_samples(
    omega: float, amplitude: float, duration_s: int
) -> None:
    # At large amplitude the phase bends so fast at first that samples seem to be lost there.
    time_s = np.arange(0.0, duration_s, 0.01)
    rate = swung(time_s, amplitude, omega, 0.0027, 0.0322)[1]
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(time_s))
    readings = Recording(time_s, rate + noise, "reading", metadata={"unit": "rad/s"})
    begun = beginning_of(readings)
    assert (begun.model.restoring, begun.model.seen) == ("sine", "rate")
    # It starts at a turning point half a cycle before the release, which was a little larger.
    assert 0.98 < abs(begun.value[START]) / amplitude < 1.06
    answer = diagnose_recording(readings)
    names = {each.identifier for each in answer.effects if each.presumed}
    assert names == {"circular-error", "drag-form"}
    assert "dropped-samples" not in {each.identifier for each in answer.missing}
    value = answer.improved.parameters["frequency"].value
    assert 2.0 * np.pi * value == pytest.approx(omega, rel=2e-4)


@pytest.mark.parametrize(("unit", "scale"), [("m", 9.81 / 4.1**2), ("pixels", 300.0)])
def test_a_pendulum_seen_from_the_side_shows_sin_x_and_no_bent_sensor(
    unit: str, scale: float
) -> None:
    time_s = np.arange(0.0, 40.0, 0.02)
    angle = swung(time_s, 0.4, 4.1, 0.004, 0.015)[0]
    noise = 1e-3 * np.random.default_rng(3).standard_normal(len(time_s))
    values = scale * (0.1 + np.sin(angle) + noise)
    quantity = "displacement_m" if unit == "m" else "reading"
    answer = diagnose_recording(Recording(time_s, values, quantity, metadata={"unit": unit}))
    names = [each.identifier for each in answer.effects]
    assert names[0] == "circular-error"
    assert not {"cubic-stiffness", "sensor-cubic"} & set(names)
    curvature = answer.effects[0].parameters["inverse_length_squared"]
    assert curvature.value**-0.5 == pytest.approx(scale, rel=0.02)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("torque", [np.sin, float])
def test_a_brake_leaves_few_cycles_that_show_sin_x(seed: int, torque: type) -> None:
    # Q = 10: the misfit is a line as wide as the loss, which is no noise of the readings.
    time_s = np.arange(0.0, 6.0, 0.01)
    angle = swung(time_s, 0.42, 4.6, 0.23, torque=torque)[0]
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(len(time_s))
    answer = diagnose_recording(Recording(time_s, angle + noise, "angle_rad"))
    assert [each.identifier for each in answer.effects] == ["circular-error"] * (torque is np.sin)
