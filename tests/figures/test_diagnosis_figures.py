"""The figures of a diagnosis show where the readings and the models differ."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.integrate import solve_ivp

from pendpipe import diagnose
from pendpipe.diagnosis.cycles import cycles
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.figures import OF_A_DIAGNOSIS, diagnosis
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.diagnosis import Shown, draw_diagnosis, shown
from pendpipe.figures.style import save
from pendpipe.recording import Recording

FREQUENCY_HZ, LINEAR, AMPLITUDE, NOISE_RAD = 0.9, 0.012, 0.25, 1e-4
OMEGA = 2.0 * math.pi * FREQUENCY_HZ
TIME_S = np.arange(1500) / 15.0


@pytest.fixture(scope="module")
def outcome() -> Any:
    """The diagnosis of a pendulum taken for a spring, integrated by scipy."""

    def rate(_: float, state: np.ndarray) -> list[float]:
        x, v = state
        return [v, -OMEGA * OMEGA * math.sin(x) - 2.0 * LINEAR * v]

    solved = solve_ivp(
        rate, (0.0, TIME_S[-1]), [AMPLITUDE, 0.0], "DOP853", t_eval=TIME_S, rtol=1e-10, atol=1e-12
    )
    noise = NOISE_RAD * np.random.default_rng(5).standard_normal(len(TIME_S))
    record = Recording(TIME_S, solved.y[0] + noise, "angle_rad")
    return diagnose_recording(record, restoring="linear")


@pytest.fixture(scope="module")
def content(outcome: Any) -> Shown:
    return shown(outcome)


def test_the_frequency_of_the_readings_is_that_of_a_real_pendulum(content: Shown) -> None:
    """The frequency is f0 (1 - A^2/16); at 0.25 rad the next term is 1e-5 of it."""
    spans = content.measured
    expected = FREQUENCY_HZ * (1.0 - spans.amplitude**2 / 16.0)
    pull = (spans.frequency_hz - expected) / spans.frequency_sd_hz
    assert len(pull) > 10
    assert np.sqrt(np.mean(pull**2)) < 2.0
    assert spans.frequency_hz[0] - FREQUENCY_HZ < -1e-3


def test_the_loss_of_the_readings_is_the_viscous_rate(content: Shown) -> None:
    spans = content.measured
    pull = (spans.loss - LINEAR) / spans.loss_sd
    assert np.sqrt(np.mean(pull**2)) < 2.0


def test_a_model_on_its_own_clock_has_its_own_amplitude_and_phase(content: Shown) -> None:
    at = content.baseline.at
    own = cycles(at.reading, content.data.weight, at, 0.0)
    assert np.diff(own.phase) == pytest.approx(2.0 * math.pi, abs=1e-6)
    expected = np.interp(own.time_s, at.sampled.time_s, at.sampled.amplitude)
    assert own.amplitude == pytest.approx(expected, rel=1e-4)


def test_a_model_goes_on_smoothly_where_its_own_cycles_begin_late() -> None:
    """Read beyond its first and last cycle, not held there: that takes from the end's loss."""
    example = Path(__file__).parents[2] / "examples/string-pendulum.csv"
    content = shown(diagnose(example))
    loss = content.of_model(content.baseline).loss
    assert np.max(np.abs(np.diff(loss, 2))) < 0.01 * np.mean(loss)


def test_the_figure_of_the_frequency_draws_readings_and_both_models(content: Shown) -> None:
    (axes,) = diagnosis.draw_frequency(content).axes
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["Eq. 8", "with cubic-stiffness", "readings"]
    flat, bent = (line.get_ydata() for line in axes.lines[1:3])
    points = axes.containers[0][0].get_ydata()
    assert np.ptp(flat) < 0.05 * np.ptp(bent)
    assert np.std(points - bent) < 0.1 * np.std(points - flat)
    assert "Hz" in axes.get_ylabel()


def test_the_figure_of_the_damping_shows_losses_less_the_baselines(content: Shown) -> None:
    upper, lower = diagnosis.draw_damping(content).axes
    assert "1/Q" in upper.get_ylabel()
    assert lower.lines[1].get_ydata() == pytest.approx(0.0, abs=1e-9)
    expected = 2e3 * LINEAR / OMEGA
    assert np.median(upper.containers[0][0].get_ydata()) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("largest", [4.0, 9.0, 50.0, 2e3, 4e4, 1e6])
def test_the_scale_of_the_map_has_few_marks_on_either_side_of_zero(largest: float) -> None:
    ticks = diagnosis._ticks(largest)
    above = [tick for tick in ticks if tick > 0.0]
    assert ticks == [*(-tick for tick in reversed(above)), 0.0, *above]
    assert 1 <= len(above) <= 4
    assert above[-1] <= largest


def test_the_map_is_loud_before_and_quiet_after(content: Shown) -> None:
    before = diagnosis.residual_map(content, content.baseline)
    assert content.extended is not None
    after = diagnosis.residual_map(content, content.extended)
    assert np.nanmax(np.abs(before)) > 50.0
    assert np.nanstd(after) == pytest.approx(1.0, abs=0.15)
    # A phase that runs away shows where the velocity is largest, not at the turning points.
    rows = np.nanmean(before**2, axis=1)
    quarter = diagnosis.PHASES // 4
    assert rows[quarter] > 10.0 * rows[0]


@pytest.mark.parametrize("quieter", [1.0, 10.0, 300.0, 1e4, 1e6])
def test_no_label_of_the_map_is_cut_off(content: Shown, quieter: float) -> None:
    """However loud the residual is beside the noise, and so however long the numbers are."""
    variance = content.noise.variance / quieter**2
    noise = replace(content.noise, variance=variance)
    figure = diagnosis.draw_residual_map(replace(content, noise=noise))
    whole = FigureCanvasAgg(figure).figure.bbox
    for axes in figure.axes:
        inside = axes.get_tightbbox()
        assert whole.x0 <= inside.x0 < inside.x1 <= whole.x1
        assert whole.y0 <= inside.y0 < inside.y1 <= whole.y1


def test_the_spectrum_of_noise_is_the_noise_level(content: Shown) -> None:
    """White noise of rms s, read every dt: s sqrt(2 dt)."""
    assert content.extended is not None
    frequency, density = diagnosis.spectrum(content, content.extended)
    expected = NOISE_RAD * math.sqrt(2.0 * content.data.interval_s)
    upper = frequency > 1.0
    assert np.sqrt(np.mean(density[upper] ** 2)) == pytest.approx(expected, rel=0.06)
    level = diagnosis.noise_level(content, frequency)
    # Below, chance may pass for red noise.
    assert level[upper] == pytest.approx(expected, rel=0.06)


def test_the_spectrum_of_a_tone_stands_at_its_frequency(content: Shown) -> None:
    at, time = content.baseline.at, content.data.time_s
    tone = np.sin(2.0 * math.pi * 3.3 * time)
    loud = replace(content, data=replace(content.data, values=at.reading + tone, lattice=None))
    frequency, density = diagnosis.spectrum(loud, content.baseline)
    assert frequency[np.argmax(density)] == pytest.approx(3.3, abs=0.05)


def test_what_has_nothing_to_show_is_not_drawn(outcome: Any, tmp_path: Path) -> None:
    content = shown(outcome)
    with pytest.raises(NothingToDrawError):
        diagnosis.draw_curve(content)
    drawn = draw_diagnosis(outcome, tmp_path)
    assert [path.stem for path in drawn] == [
        "decay",
        "residual_map",
        "residual_spectrum",
        "damping",
        "frequency",
    ]
    for path in drawn:
        assert "Eq. 8" in "".join(ET.parse(path).getroot().itertext())
        assert path.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_figure_of_the_decay_is_small_at_any_length(tmp_path: Path) -> None:
    """Each of 9,000 readings as a path of its own would take 1.3 MB."""
    time_s = np.arange(9000) / 15.0
    swing = 0.1 * np.exp(-time_s / 200.0) * np.cos(OMEGA * time_s)
    noise = NOISE_RAD * np.random.default_rng(6).standard_normal(len(time_s))
    long = shown(diagnose_recording(Recording(time_s, swing + noise, "angle_rad")))
    assert len(long.data) > 8000
    svg, _ = save(diagnosis.draw_decay(long), tmp_path / "decay")
    assert svg.stat().st_size < 400_000


def curve(**more: Any) -> dict[str, Any]:
    at = np.geomspace(0.02, 0.2, 20)
    return {
        "argument": "amplitude, rad",
        "ordinate": "extra loss rate, 1/s",
        "at": at,
        "value": 1e-3 * at,
        "sd": np.full(20, 1e-4),
        **more,
    }


def named(outcome: Any, found: dict[str, Any]) -> Shown:
    content = shown(outcome)
    effect = replace(content.diagnosis.effects[0], identifier="unnamed-damping", curve=found)
    return replace(content, diagnosis=replace(content.diagnosis, effects=(effect,)))


def test_an_unnamed_effect_is_drawn_with_its_95_percent_band(outcome: Any) -> None:
    (axes,) = diagnosis.draw_curve(named(outcome, curve())).axes
    band = axes.collections[0].get_paths()[0].vertices
    assert np.ptp(band[np.isclose(band[:, 0], 20.0), 1]) == pytest.approx(2 * 1.96e-4)
    assert axes.get_xlabel() == "Amplitude (mrad)"
    assert axes.get_ylabel() == "Extra loss rate (s⁻¹)"


def test_a_loss_has_its_local_exponent_below(outcome: Any) -> None:
    found = curve(local_exponent=np.full(20, 1.5), local_exponent_sd=np.full(20, 0.1))
    _, lower = diagnosis.draw_curve(named(outcome, found)).axes
    assert lower.lines[0].get_ydata() == pytest.approx(1.5)
    assert "exponent" in lower.get_ylabel()


def test_each_figure_has_a_name_that_the_workflow_knows() -> None:
    assert tuple(diagnosis.DRAWINGS) == OF_A_DIAGNOSIS
