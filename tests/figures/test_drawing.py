"""Figures of decays and of diagnoses show what they say."""

import json
import math
import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pendpipe import diagnose, physics
from pendpipe.analysis.fit.by_points import fit_envelope
from pendpipe.analysis.fit.fitted import Agreement, Form
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.turning_points import (
    TurningPoints,
    read_turning_points,
    write_turning_points,
)
from pendpipe.diagnosis.cycles import cycles
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.dynamics import Eq8, Release, turning_points
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.estimate import Estimate
from pendpipe.figures import OF_A_DIAGNOSIS, diagnosis
from pendpipe.figures.data import Decay, NothingToDrawError, local_quality, read_decay
from pendpipe.figures.decays import draw_decay, draw_fig07, draw_fig08, draw_fit, quality_with_band
from pendpipe.figures.diagnosis import Shown, draw_diagnosis, shown
from pendpipe.figures.style import save
from pendpipe.recording import Recording, read_plain

from ..effects.integration import swung
from ..recordings import white

# Figures 7 and 8 and each record's decay, and what they work out for themselves.

TYPICAL = "water-low-7"
FITTED = ("amplitude", "a", "b", "c")


def entry_of(example: Any, name: str) -> dict[str, Any]:
    return next(entry for entry in example.content["records"] if entry["record"] == name)


def a_fit(method: str, restoring: str, frequency: float, **values: float) -> FitResult:
    """A fit of these numbers, in which b alone is uncertain, by 1e-4."""
    given = {"frequency": frequency, "phase": 0.0, "offset": 0.0, **values}
    return FitResult(
        method=method,  # type: ignore[arg-type]
        parameters={name: Estimate(value, 0.0, "") for name, value in given.items()},
        covariance=np.diag([0.0, 1e-8, 0.0]),
        form=Form(restoring=restoring),  # type: ignore[arg-type]
        agreement=Agreement(1e-5, 1e-5, 1.0, None, 1000, 200),
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


# The figures of a diagnosis show where the readings and the models differ.

FREQUENCY_HZ, LINEAR, AMPLITUDE, NOISE_RAD = 0.9, 0.012, 0.25, 1e-4
OMEGA = 2.0 * math.pi * FREQUENCY_HZ
TIME_S = np.arange(1500) / 15.0


@pytest.fixture(scope="module")
def outcome() -> Any:
    """The diagnosis of a pendulum taken for a spring, integrated by scipy."""
    angle = swung(TIME_S, AMPLITUDE, OMEGA, LINEAR)[0]
    record = Recording(TIME_S, angle + white(5, len(TIME_S), NOISE_RAD), "angle_rad")
    return diagnose_recording(record, restoring="linear")


@pytest.fixture(scope="module")
def content(outcome: Any) -> Shown:
    return shown(outcome)


@pytest.mark.slow
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
    own = cycles(at.reading, content.data, at, 0.0)
    assert np.diff(own.phase) == pytest.approx(2.0 * math.pi, abs=1e-6)
    expected = np.interp(own.time_s, at.sampled.time_s, at.sampled.amplitude)
    assert own.amplitude == pytest.approx(expected, rel=1e-4)


def test_a_model_goes_on_smoothly_where_its_own_cycles_begin_late() -> None:
    """Read beyond its first and last cycle, not held there: that takes from the end's loss."""
    example = Path(__file__).parents[2] / "examples/string-pendulum.csv"
    content = shown(diagnose(example))
    loss = content.of_model(content.baseline).loss
    assert np.max(np.abs(np.diff(loss, 2))) < 0.01 * np.mean(loss)


@pytest.mark.slow
def test_the_envelope_follows_a_zero_that_drifts() -> None:
    time_s = np.arange(1500) / 25.0
    creep = 0.25 * (1.0 - np.exp(-time_s / 20.0))
    swing = 0.3 * np.exp(-0.0334 * time_s)
    recording = Recording(
        time_s, swing * np.cos(3.7 * time_s) + creep + white(1, len(time_s), 1e-3), "angle_rad"
    )
    upper = diagnosis.draw_decay(shown(diagnose(recording, restoring="linear"))).axes[0]
    inside = (time_s > 5.0) & (time_s < 55.0)
    for line, expected in zip(upper.lines[-2:], (creep + swing, creep - swing), strict=True):
        drawn = np.interp(time_s, *line.get_data())
        assert drawn[inside] == pytest.approx(1e3 * expected[inside], abs=5.0)  # in mrad


def test_the_figure_of_the_frequency_draws_readings_and_both_models(content: Shown) -> None:
    (axes,) = diagnosis.draw_frequency(content).axes
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["Eq. 8", "with cubic restoring torque", "readings"]
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


def test_the_key_of_the_decay_stays_within_the_figure(content: Shown) -> None:
    """However long the name is of what is missing."""
    found = SimpleNamespace(
        missing=[SimpleNamespace(name=max((each.name for each in CATALOGUE), key=len))],
        baseline=content.diagnosis.baseline,
    )
    figure = diagnosis.draw_decay(replace(content, diagnosis=found))
    FigureCanvasAgg(figure).draw()
    key = figure.axes[0].get_legend().get_window_extent()
    assert 0.0 < key.x0 < key.x1 < figure.bbox.x1


def test_the_curves_and_their_keys_stay_within_the_figure(content: Shown) -> None:
    """Two lines of a title and two rows of a key; what does not stand out is not drawn."""
    at, name = np.linspace(0.0, 80.0, 61), max((each.name for each in CATALOGUE), key=len)
    told = dict.fromkeys(("value", "sd", "quadrature", "quadrature_sd", "named"), 0.01 * at)
    told |= {"at": at, "argument": "time, s", "ordinate": "torque over omega^2 y, 1"}
    told |= {"name": "", "summary": "the torque is stiffer " * 4, "named_as": name}
    told |= {"stands_out": True, "named_quadrature": 0.03 * at}
    missing = [SimpleNamespace(curve=each) for each in (told, told, told | {"stands_out": False})]
    figure = diagnosis.draw_curve(replace(content, diagnosis=SimpleNamespace(missing=missing)))
    FigureCanvasAgg(figure).draw()
    first_lines = figure.axes[0].lines
    first, second = (each.get_legend().get_window_extent() for each in figure.axes)
    assert figure.bbox.y1 > first.y1 > first.y0 > figure.axes[0].title.get_window_extent().y1
    assert figure.axes[0].xaxis.label.get_window_extent().y0 > second.y1
    assert figure.axes[1].get_ylabel() == "Torque over ω² y"
    # A part that the named effect has not is left out.
    told |= {"named_quadrature": 0.0 * at}
    missing = [SimpleNamespace(curve=told)]
    figure = diagnosis.draw_curve(replace(content, diagnosis=SimpleNamespace(missing=missing)))
    assert [len(figure.axes[0].collections), len(first_lines)] == [1, 5]


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


@pytest.mark.slow
def test_what_has_nothing_to_show_is_not_drawn(outcome: Any, tmp_path: Path) -> None:
    sudden = replace(outcome, effects=tuple(replace(each, curve=None) for each in outcome.effects))
    with pytest.raises(NothingToDrawError):
        diagnosis.draw_curve(shown(sudden))
    drawn = draw_diagnosis(sudden, tmp_path)
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


@pytest.mark.slow
def test_the_figure_of_the_decay_is_small_at_any_length(tmp_path: Path) -> None:
    """Each of 9,000 readings as a path of its own would take 1.3 MB."""
    time_s = np.arange(9000) / 15.0
    swing = 0.1 * np.exp(-time_s / 200.0) * np.cos(OMEGA * time_s)
    long = shown(
        diagnose_recording(Recording(time_s, swing + white(6, len(time_s), NOISE_RAD), "angle_rad"))
    )
    assert len(long.data) > 8000
    svg, _ = save(diagnosis.draw_decay(long), tmp_path / "decay")
    assert svg.stat().st_size < 400_000


def curve(**more: Any) -> dict[str, Any]:
    at = np.geomspace(0.02, 0.2, 20)
    return {
        "name": "a loss that depends on the amplitude in an unknown way",
        "summary": "the loss is larger by 0.0002 s⁻¹ from 5.7° to 11.5° (amplitude)",
        "argument": "amplitude, rad",
        "ordinate": "extra loss rate, 1/s",
        "at": at,
        "value": 1e-3 * at,
        "sd": np.full(20, 1e-4),
        "stands_out": True,
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
    assert axes.get_title(loc="left").startswith("The loss is larger by 0.0002 s⁻¹")


def test_a_loss_has_its_local_exponent_below(outcome: Any) -> None:
    found = curve(local_exponent=np.full(20, 1.5), local_exponent_sd=np.full(20, 0.1))
    _, lower = diagnosis.draw_curve(named(outcome, found)).axes
    assert lower.lines[0].get_ydata() == pytest.approx(1.5)
    assert "exponent" in lower.get_ylabel()


def test_each_figure_has_a_name_that_the_workflow_knows() -> None:
    assert tuple(diagnosis.DRAWINGS) == OF_A_DIAGNOSIS
