"""A mark that is tracked with errors shows them in the distance from the pivot, too."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from pendpipe.analysis.turning_points.measure import prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.tracking import rows_of, wander, wander_confirmed
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.formats import read
from pendpipe.recording import Recording, read_plain, write_plain

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


def red(random: np.random.Generator) -> FloatArray:
    drawn = np.convolve(random.standard_normal(len(TIME) + 99), np.exp(-np.arange(30) / 20))
    return np.asarray(drawn[99 : 99 + len(TIME)])


@pytest.mark.parametrize("kappa", [0.8, -0.5])
def test_a_wander_along_one_line_is_named_and_taken_off(tmp_path: Path, kappa: float) -> None:
    random = np.random.default_rng(3)
    along = 3e-4 * red(random)
    noise = 3e-4 * random.standard_normal((2, len(TIME)))
    outcome = diagnose_recording(seen(tmp_path, along + noise[0], kappa * along + noise[1]))
    found = {effect.identifier: effect for effect in outcome.effects}
    assert "tracking-noise" in found
    value = found["tracking-noise"].parameters["kappa"]
    assert abs(value.value - kappa) < max(4.0 * value.sd, 0.15 * abs(kappa)), "w has noise too"
    assert found["tracking-noise"].confirmed is not None
    assert not {"offset-drift", "unnamed-measurement", "tone-pickup"} & set(found)


def test_errors_of_their_own_in_both_coordinates_are_no_wander(tmp_path: Path) -> None:
    """Then the test's p-value is uniform, whatever the colour of the noise."""
    random = np.random.default_rng(5)
    values = []
    for _ in range(30):
        # Trackers interpolate: neighbouring rows share what they err by.
        white = random.standard_normal((2, len(TIME) + 4))
        own = 2e-4 * np.array([np.convolve(each, np.ones(5), "valid") for each in white])
        slow = 2e-4 * np.array([red(random), red(random)])
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
