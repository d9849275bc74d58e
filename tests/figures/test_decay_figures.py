"""Figures 7 and 8 and each record's decay, and what they work out for themselves."""

import json
import shutil
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pendpipe import physics
from pendpipe.analysis.fit.by_points import fit_envelope
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.turning_points import (
    TurningPoints,
    read_turning_points,
    write_turning_points,
)
from pendpipe.dynamics import Eq8, Release, turning_points
from pendpipe.estimate import Estimate
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.decays import (
    Decay,
    draw_decay,
    draw_fig07,
    draw_fig08,
    draw_fit,
    local_quality,
    quality_with_band,
    read_decay,
)
from pendpipe.recording import Recording, read_plain

TYPICAL = "water-low-7"
FITTED = ("amplitude", "a", "b", "c")


def entry_of(example: Any, name: str) -> dict[str, Any]:
    return next(entry for entry in example.content["records"] if entry["record"] == name)


def a_fit(method: str, restoring: str, frequency: float, **values: float) -> FitResult:
    """A fit of these numbers, in which b alone is uncertain, by 1e-4."""
    given = {"frequency": frequency, "phase": 0.0, "offset": 0.0, **values}
    return FitResult(
        method=method,  # type: ignore[arg-type]
        baseline="eq8",
        parameters={name: Estimate(value, 0.0, "") for name, value in given.items()},
        quality_factor_limit=None,
        covariance_order=("a", "b", "c"),
        covariance=np.diag([0.0, 1e-8, 0.0]),
        noise_rms_rad=1e-5,
        residual_rms_rad=1e-5,
        chi2_per_dof=1.0,
        samples=1000,
        turning_points=200,
        restoring=restoring,  # type: ignore[arg-type]
    )


def quiet_decay(a: float, b: float, c: float, *, sd: float = 1e-9) -> Decay:
    """A decay without noise, at 0.5 Hz."""
    time = np.arange(0.0, 200.0, 1.0)
    y = physics.amplitude(time, 0.07, a, b, c)
    return decay_of(
        time, y, a_fit("turning-points", "linear", 0.5, a=a, b=b, c=c, amplitude=0.07), sd
    )


def decay_of(time: Any, y: Any, fit: FitResult, sd: float) -> Decay:
    number = np.arange(len(time))
    even = np.full(len(time), sd)
    table = TurningPoints(number, time, even, y * (-1.0) ** number, even, 0.0 * time)
    return Decay("quiet", table, fit)


LARGE = Eq8(2.0 * np.pi * 0.9, 0.02, 0.004, 0.004, 0.003, restoring="sine")


def large_decay(method: str) -> tuple[Decay, Any]:
    """The turning points of sin x from 1.5 rad, exact, and the fit with its own numbers."""
    turned = turning_points(LARGE, Release(0.0, 1.5), count=160)
    fit = a_fit(method, "sine", 0.9, a=0.02, b=0.008, c=0.003, amplitude=1.5)
    return decay_of(turned.time_s, np.abs(turned.angle_rad), fit, 1e-6), turned


@pytest.mark.parametrize("method", ["waveform", "turning-points"])
def test_a_fit_of_sin_x_is_drawn_by_the_law_that_was_fitted(method: str) -> None:
    """Eq. 14 with the same numbers is off by tens of milliradians at 1.5 rad."""
    found, turned = large_decay(method)
    far = physics.amplitude(turned.time_s, 1.5, 0.02, 0.008, 0.003) - found.amplitude_rad
    assert np.max(np.abs(far)) > 0.02
    upper = draw_decay(found).axes[0]
    assert "sin x" in upper.get_legend().get_texts()[0].get_text()
    time, drawn = upper.lines[1].get_data()
    unit = 1.0 if "(rad)" in upper.get_ylabel() else 1e-3
    expected = np.interp(time, turned.time_s, np.abs(turned.angle_rad))
    assert unit * drawn == pytest.approx(expected, rel=1e-9)
    assert found.residual_rad == pytest.approx(0.0, abs=1e-12)
    recording = Recording(np.linspace(0.0, 80.0, 9000), np.zeros(9000), "angle_rad")
    for figure in (draw_fig07(found, recording, None), draw_fit(found, recording)):
        above, below = (line.get_ydata() for line in figure.axes[0].lines[1:3])
        assert above[0] == -below[0] == pytest.approx(1.5)
        assert above[-1] == pytest.approx(found.amplitude_rad[-1])


def test_the_quality_factor_of_sin_x_is_that_of_its_turning_points() -> None:
    """From one turning point to the next on the same side y falls by exp(-pi/Q)."""
    found, turned = large_decay("waveform")
    y = np.abs(turned.angle_rad)
    quality, half_width = quality_with_band(found, turned.time_s[1:-1])
    assert quality == pytest.approx(np.pi / np.log(y[:-2] / y[2:]), rel=1e-9)
    # Eq. 15 takes the period of small swings, and their losses.
    small = physics.quality_factor(1.5, 0.9, 0.02, 0.008, 0.003)
    assert abs(quality[0] / small - 1.0) > 0.03
    time_s, value, _ = local_quality(found)
    assert len(value) > 5
    assert value == pytest.approx(np.interp(time_s, turned.time_s[1:-1], quality), rel=0.02)
    # The two laws with b a standard deviation off, on either side.
    up, down = (
        found.fit.law.__class__(**{**vars(LARGE), "hysteretic": b, "viscous": b})
        for b in (0.00405, 0.00395)
    )
    moved = [
        np.abs(turning_points(law, Release(0.0, 1.5), count=160).angle_rad) for law in (up, down)
    ]
    at = y[1:-1]
    q = [np.interp(-at, -e[1:-1], np.pi / np.log(e[:-2] / e[2:])) for e in moved]
    off = np.abs(half_width / (1.96 * 0.5 * np.abs(q[1] - q[0])) - 1.0)
    # Eq. 13's shares of the losses are those of small amplitudes.
    assert np.max(off[1:100]) < 0.06
    assert np.max(off[60:100]) < 0.005


def test_a_decay_is_drawn_from_the_first_to_the_last_turning_point_that_was_fitted(
    example: Any,
) -> None:
    entry = entry_of(example, TYPICAL)
    measured = read_turning_points(example.folder / TYPICAL / "turning_points.csv")
    ends = measured.time_s[[2, -3]].tolist()
    found = read_decay(example.folder, {**entry, "start_s": ends[0], "stop_s": ends[1]})
    assert found.points.time_s[[0, -1]].tolist() == ends


def test_figure_7_draws_all_samples_inside_the_envelope(example: Any) -> None:
    recording = read_plain(example.folder / TYPICAL / "recording.csv")
    found = read_decay(example.folder, entry_of(example, TYPICAL))
    upper, lower = draw_fig07(found, recording, 3.85).axes
    samples, above, below = (np.column_stack(line.get_data()) for line in upper.lines)
    assert len(samples) == 32768
    noise_mv = 1e3 * 3.85 * 8e-5
    for envelope, sign in ((above, 1.0), (below, -1.0)):
        edge = np.interp(samples[:, 0], envelope[:, 0], envelope[:, 1])
        assert np.all(sign * (samples[:, 1] - edge) < 6 * noise_mv)
    assert upper.get_ylabel() == "Sensor output (mV)"
    assert len(lower.containers[0][0].get_xdata()) == len(found.points)


def test_figure_8_limit_and_maximum_are_those_of_equation_15(example: Any) -> None:
    found = read_decay(example.folder, entry_of(example, TYPICAL))
    axes = draw_fig08(found).axes[0]
    quality = axes.lines[0].get_ydata()
    a, b, c = (found.fit.value(name) for name in "abc")
    frequency = found.fit.value("frequency")
    limit = axes.lines[-2].get_ydata()[0]
    assert limit == pytest.approx(np.pi * frequency / b)
    largest = np.pi * frequency / (b + 2 * np.sqrt(a * c))
    assert np.max(quality) == pytest.approx(largest, rel=1e-4)
    assert axes.lines[-1].get_ydata()[0] == pytest.approx(largest, rel=1e-4)
    assert quality[0] < 40 < 100 < largest < limit


def test_local_quality_of_an_exact_decay_is_equation_15() -> None:
    quiet = quiet_decay(0.45, 0.012, 1.4e-6)
    time_s, value, _ = local_quality(quiet)
    y = np.interp(time_s, quiet.points.time_s, quiet.amplitude_rad)
    expected = physics.quality_factor(y, 0.5, 0.45, 0.012, 1.4e-6)
    assert value == pytest.approx(expected, rel=0.01)


def test_band_is_the_error_of_b_where_only_b_is_uncertain() -> None:
    # With a = c = 0 the quality factor is pi f/b whatever the amplitude.
    quiet = quiet_decay(0.0, 0.012, 0.0)
    quality, half_width = quality_with_band(quiet, quiet.elapsed_s)
    assert quality == pytest.approx(np.pi * 0.5 / 0.012)
    assert half_width == pytest.approx(1.96 * quality * 1e-4 / 0.012, rel=1e-4)


def test_linear_damping_misfits_a_nonlinear_decay(example: Any) -> None:
    """The key tells both misfits; the dashed curve is the best exponential."""
    found = read_decay(example.folder, entry_of(example, TYPICAL))
    linear = fit_envelope(found.points, {"a": 0.0, "c": 0.0})
    assert np.std(linear.residual) > 30 * np.std(found.residual_rad)
    upper = draw_decay(found).axes[0]
    time, drawn = upper.lines[2].get_data()
    assert np.diff(np.log(drawn)) == pytest.approx(-linear.value[1] * np.diff(time))
    texts = [text.get_text() for text in upper.get_legend().get_texts()]
    assert any(text.startswith("linear damping (rms misfit") for text in texts)


def test_decay_residuals_are_data_minus_fit(example: Any) -> None:
    found = read_decay(example.folder, entry_of(example, "water-low-1"))
    upper, lower = draw_decay(found).axes
    fitted = physics.amplitude(found.elapsed_s, *(found.fit.value(n) for n in FITTED))
    residual = lower.containers[0][0].get_ydata()
    assert residual == pytest.approx(1e6 * (found.amplitude_rad - fitted))
    assert "Data − fit (µrad)" in lower.get_ylabel()
    assert upper.get_yscale() == "log"


def test_a_wrong_level_does_not_split_the_two_sides(example: Any, tmp_path: Any) -> None:
    entry = entry_of(example, TYPICAL)
    source = example.folder / TYPICAL
    points = read_turning_points(source / "turning_points.csv")
    shift = 1e-3
    moved_points = replace(
        points,
        level_rad=points.level_rad + shift,
        angle_rad=points.angle_rad - 4 / np.pi * shift,
        level_coupling=4 / np.pi,
    )
    target = tmp_path / TYPICAL
    target.mkdir()
    (target / "fit.json").write_text((source / "fit.json").read_text())
    write_turning_points(target / "turning_points.csv", moved_points)
    true, moved = (read_decay(folder, entry) for folder in (example.folder, tmp_path))
    assert moved.amplitude_rad == pytest.approx(true.amplitude_rad, abs=1e-12)
    assert moved.level_rad == pytest.approx(true.level_rad, abs=1e-12)


def test_a_refused_record_has_no_decay(tmp_path: Any) -> None:
    folder = tmp_path / "stub"
    folder.mkdir()
    (folder / "fit.json").write_text(json.dumps({"schema_version": 1, "refused": "no decay"}))
    (folder / "turning_points.csv").write_text("# refused: no decay\n")
    with pytest.raises(NothingToDrawError, match="refused"):
        read_decay(tmp_path, {"record": "stub"})


def test_a_cut_row_of_turning_points_is_not_drawn(example: Any, tmp_path: Any) -> None:
    entry = entry_of(example, TYPICAL)
    shutil.copytree(example.folder / TYPICAL, tmp_path / TYPICAL)
    table = tmp_path / TYPICAL / "turning_points.csv"
    table.write_text(table.read_text()[:-30])
    whole, cut = (read_decay(folder, entry) for folder in (example.folder, tmp_path))
    assert cut.points.time_s == pytest.approx(
        whole.points.time_s[: len(cut.points.time_s)], abs=0.0
    )
    assert 1 <= len(whole.points.time_s) - len(cut.points.time_s) <= 2


@pytest.mark.filterwarnings("error")
def test_a_law_that_comes_to_rest_within_the_recording_is_drawn() -> None:
    """Its last amplitudes are zero, which no logarithmic axis shows."""
    found = quiet_decay(0.0, 0.01, 0.001)
    assert found.along(found.elapsed_s)[0][-1] == 0.0
    recording = Recording(np.linspace(0.0, 199.0, 4000), np.zeros(4000), "angle_rad")
    draw_fit(found, recording)
