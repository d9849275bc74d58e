"""Figures 7 and 8 and each record's decay, and what they work out for themselves."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe import physics
from pendpipe.analysis.turning_points import read_turning_points, write_turning_points
from pendpipe.estimate import Estimate
from pendpipe.figures.data import Decay, NothingToDrawError, read_decay
from pendpipe.figures.decays import (
    draw_decay,
    draw_fig07,
    draw_fig08,
    fit_exponential,
    local_quality,
    quality_with_band,
)
from pendpipe.recording import read_plain

TYPICAL = "water-low-7"


def entry_of(example: Any, name: str) -> dict[str, Any]:
    return next(entry for entry in example.content["records"] if entry["record"] == name)


def quiet_decay(a: float, b: float, c: float, *, sd: float = 1e-9) -> Decay:
    """A decay without noise, at 0.5 Hz."""
    time = np.arange(0.0, 200.0, 1.0)
    parameters = {
        name: Estimate(value, 0.0, "")
        for name, value in zip(
            ("a", "b", "c", "frequency", "amplitude"), (a, b, c, 0.5, 0.07), strict=True
        )
    }
    y = physics.amplitude(time, 0.07, a, b, c)
    return Decay(
        "quiet", time, y, np.full_like(time, sd), 0.0 * time, parameters, ("b",), np.array([[1e-8]])
    )


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
    assert len(lower.containers[0][0].get_xdata()) == len(found.time_s)


def test_figure_8_limit_and_maximum_are_those_of_equation_15(example: Any) -> None:
    found = read_decay(example.folder, entry_of(example, TYPICAL))
    axes = draw_fig08(found).axes[0]
    quality = axes.lines[0].get_ydata()
    a, b, c = found.rates
    frequency = found.value("frequency")
    limit = axes.lines[-2].get_ydata()[0]
    assert limit == pytest.approx(np.pi * frequency / b)
    largest = np.pi * frequency / (b + 2 * np.sqrt(a * c))
    assert np.max(quality) == pytest.approx(largest, rel=1e-4)
    assert axes.lines[-1].get_ydata()[0] == pytest.approx(largest)
    assert quality[0] < 40 < 100 < largest < limit


def test_local_quality_of_an_exact_decay_is_equation_15() -> None:
    quiet = quiet_decay(0.45, 0.012, 1.4e-6)
    local = local_quality(quiet)
    y = np.interp(local.time_s, quiet.time_s, quiet.amplitude_rad)
    assert local.value == pytest.approx(physics.quality_factor(y, 0.5, *quiet.rates), rel=0.01)


def test_band_is_the_error_of_b_where_only_b_is_uncertain() -> None:
    # With a = c = 0 the quality factor is pi f/b whatever the amplitude.
    quiet = quiet_decay(0.0, 0.012, 0.0)
    quality, half_width = quality_with_band(quiet, quiet.time_s)
    assert quality == pytest.approx(np.pi * 0.5 / 0.012)
    assert half_width == pytest.approx(1.96 * quality * 1e-4 / 0.012, rel=1e-4)


@given(st.floats(1e-3, 2.0), st.floats(1e-4, 0.5))
def test_an_exponential_is_found_exactly(start: float, rate: float) -> None:
    time = np.linspace(0.0, 3.0 / rate, 60)
    y = start * np.exp(-rate * time)
    assert fit_exponential(time, y, 0.01 * y) == pytest.approx((start, rate), rel=1e-8)


def test_linear_damping_misfits_a_nonlinear_decay(example: Any) -> None:
    found = read_decay(example.folder, entry_of(example, TYPICAL))
    start, rate = fit_exponential(found.elapsed_s, found.amplitude_rad, found.amplitude_sd_rad)
    linear = found.amplitude_rad - start * np.exp(-rate * found.elapsed_s)
    own = found.amplitude_rad - physics.amplitude(
        found.elapsed_s, found.value("amplitude"), *found.rates
    )
    assert np.std(linear) > 30 * np.std(own)


def test_decay_residuals_are_data_minus_fit(example: Any) -> None:
    found = read_decay(example.folder, entry_of(example, "water-low-1"))
    upper, lower = draw_decay(found).axes
    fitted = physics.amplitude(found.elapsed_s, found.value("amplitude"), *found.rates)
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
    assert cut.time_s == pytest.approx(whole.time_s[: len(cut.time_s)], abs=0.0)
    assert 1 <= len(whole.time_s) - len(cut.time_s) <= 2
