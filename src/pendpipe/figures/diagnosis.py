"""The figures of a diagnosis: where model and recording differ, before and after."""

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from operator import methodcaller
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.colors import AsinhNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter
from scipy.interpolate import make_interp_spline
from scipy.ndimage import uniform_filter1d

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import Cycles, Spans, between, cycles, span_ends
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.dynamics.eq8 import OMEGA
from pendpipe.effects.model import Evaluated
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    THIN,
    VERMILION,
    Mark,
    Panel,
    band,
    curve,
    figure_of,
    level,
    logarithmic,
    measured,
    quantity_of,
    save,
    styled,
    words,
)
from pendpipe.quantities import axis_unit, compact, prefixed, pretty_unit

NAMES = {"eq8": "Eq. 8", "viscous": "Eq. 3"}


@dataclass(frozen=True)
class Shown:
    """A diagnosis with the readings and the models that it compared.

    Parameters
    ----------
    diagnosis, data, noise
        The answer, the readings and their noise.
    baseline, extended
        The two models; `extended` is None where nothing was found.
    """

    diagnosis: Diagnosis
    data: Data
    noise: Noise
    baseline: Fit
    extended: Fit | None

    @property
    def clock(self) -> Evaluated:
        """The model whose phase tells the cycles apart: the one that stays in step."""
        fits = (fit for _, fit in reversed(self.models))
        return min(fits, key=lambda fit: fit.max_phase_error_rad).at

    @property
    def baseline_name(self) -> str:
        """For legends."""
        return NAMES.get(self.diagnosis.baseline.name, self.diagnosis.baseline.name)

    @property
    def models(self) -> list[tuple[str, Fit]]:
        """The baseline and, where something was found, the extended model, named for legends."""
        named = [(self.baseline_name, self.baseline)]
        if self.extended is not None:
            found = [effect.name for effect in self.diagnosis.missing]
            more = f" and {len(found) - 1} more" if len(found) > 1 else ""
            name = f"with {found[0]}{more}"
            named.append((name if len(name) <= _LEGEND else "with what is missing", self.extended))
        return named

    def residual(self, fit: Fit) -> FloatArray:
        """Readings minus model, NaN where a reading is masked; shape (n,)."""
        left = self.data.residual(fit.at.reading)
        return np.where(self.data.weight > 0.0, left, math.nan)

    def rms(self, fit: Fit) -> str:
        """The residual's root mean square, with its unit."""
        return compact(math.sqrt(float(np.nanmean(self.residual(fit) ** 2))), self.data.unit)

    @cached_property
    def _measured(self) -> tuple[Cycles, list[int]]:
        """The cycles of the readings, and those between which they are compared."""
        found = cycles(self.data.values, self.data, self.clock, self.noise.white_rms)
        ends = span_ends(found) if len(found.time_s) else []
        # Two points are no curve.
        if len(ends) < 4:
            raise NothingToDrawError("too few cycles are above the noise")
        return found, ends

    @cached_property
    def measured(self) -> Spans:
        """Loss and frequency of the readings."""
        return between(*self._measured)

    def of_model(self, fit: Fit) -> Spans:
        """The same of a model's readings, between the same times."""
        found, ends = self._measured
        own = cycles(fit.at.reading, self.data, fit.at, 0.0)
        # Its first cycle may begin after the readings', and its last one end before theirs.
        table = np.stack([np.log(own.amplitude), own.phase, own.sd], axis=1)
        logs, phase, sd = make_interp_spline(own.time_s, table, k=1)(found.time_s).T
        return between(Cycles(found.time_s, np.exp(logs), phase, sd), ends)


def shown(outcome: Diagnosis) -> Shown:
    """Take from an outcome what is drawn."""
    found = outcome.search
    assert found is not None
    extended = found.fit if outcome.missing else None
    return Shown(outcome, found.data, found.noise, found.baseline, extended)


COLOURS: Final = (VERMILION, BLUE)
"""Of the baseline and of the extended model."""
_MANY: Final = 1000
"""Readings from which on they are drawn as pixels, and the amplitude at every k-th of them."""
_LEGEND: Final = 34
"""Letters of a name beside two others in the width of a figure."""
_CYCLES: Final = 4.0
"""Cycles at the end of the decay that are drawn with each reading."""


@styled
def draw_decay(content: Shown) -> Figure:
    """Draw the amplitude's decay, the last cycles, and the residuals against time."""
    data, time = content.data, content.data.time_s
    values = np.where(data.weight > 0.0, data.values, np.nan)
    factor, unit = axis_unit(values, data.unit)
    # The last cycles are where a wrong model is most out of phase.
    last = time > time[-1] - _CYCLES * content.baseline.at.span.period_s
    residuals = [content.residual(fit) for _, fit in content.models]
    small, small_unit = axis_unit(np.stack(residuals), data.unit)
    dots: dict[str, Any] = {"marker": "o", "markersize": 2.0}
    pixels: dict[str, Any] = {"rasterized": len(data) > _MANY}
    some = slice(None, None, math.ceil(len(data) / _MANY))
    cycle = max(round(content.baseline.at.span.period_s / data.interval_s), 1)
    decay = [curve(time, factor * values, GREY, width=0.4, label="readings", **pixels)]
    end = [curve(time[last], factor * values[last], GREY, "", **dots)]
    rest = [level(0.0, width=0.8)]
    for (name, fit), colour, residual in zip(content.models, COLOURS, residuals, strict=False):
        # What the reading has besides the swing, in the mean of a cycle: the zero, as it drifts.
        beside = fit.at.reading - fit.at.sampled.angle
        middle = uniform_filter1d(beside, min(cycle, len(beside)), mode="nearest")[some]
        amplitude = fit.at.sampled.amplitude[some]
        decay += [
            curve(time[some], factor * (middle + amplitude), colour, width=1.2, label=name),
            curve(time[some], factor * (middle - amplitude), colour, width=1.2),
        ]
        end.append(curve(time[last], factor * fit.at.reading[last], colour, width=1.0))
        dot: dict[str, Any] = {"marker": ".", "markersize": 1.5, **pixels}
        rest.append(curve(time, small * residual, colour, "", **dot))
    label = f"{quantity_of(data.unit)} ({unit})"
    return figure_of(
        5.4,
        Panel(decay, {"ylabel": label}, key=3),
        Panel(end, {"title": "The last cycles", "xlabel": "Time (s)", "ylabel": label}),
        Panel(rest, {"xlabel": "Time (s)", "ylabel": f"Readings − model ({small_unit})"}),
        sharex=False,
    )


PHASES: Final = 24
"""Rows of the map: 15 degrees of the cycle each."""
_COLUMNS: Final = 90
"""Columns of the map at most: each is a millimetre wide in print."""
_IN_A_CELL: Final = 4
"""Readings, usually: fewer would leave holes."""
_CHARACTER: Final = 0.0165
"""Width of a figure in a tick label, over the drawing's."""
_COLOURS: Final = LinearSegmentedColormap.from_list("residual", [BLUE, "white", VERMILION])


@styled
def draw_residual_map(content: Shown) -> Figure:
    """Draw mean residuals over their standard errors, the baseline's and the extended model's."""
    maps = [residual_map(content, fit) for _, fit in content.models]
    largest = max([4.0] + [float(np.nanmax(np.abs(each))) for each in maps])
    height = 2.0 * len(maps) + 0.95
    ticks = _ticks(largest)
    labels = [f"{tick:+.0f}".replace("-", "−") if tick else "0" for tick in ticks]
    right = 0.845 - _CHARACTER * max(max(map(len, labels)) - 3, 0)
    margins = {"bottom": 0.46 / height, "top": 1.0 - 0.28 / height, "hspace": 0.28}
    time = content.data.time_s
    look = {
        "norm": AsinhNorm(linear_width=2.0, vmin=-largest, vmax=largest),
        "cmap": _COLOURS.with_extremes(bad=mpl.rcParams["grid.color"]),
        "aspect": "auto",
        "origin": "lower",
        "interpolation": "nearest",
        "extent": (float(time[0]), float(time[-1]), 0.0, 2.0 * math.pi),
    }
    rows = [
        Panel(
            [methodcaller("imshow", values, **look), methodcaller("grid", visible=False)],
            {
                "yticks": np.linspace(0.0, 2.0 * math.pi, 5),
                "yticklabels": ["0", "π/2", "π", "3π/2", "2π"],
                "title": f"{name}: residual {content.rms(fit)} rms",
            },
        )
        for (name, fit), values in zip(content.models, maps, strict=True)
    ]
    figure = figure_of(height, *rows, margins=margins | {"left": 0.105, "right": right})
    for axes in figure.axes:
        axes.set_ylabel("Phase of the cycle", labelpad=1)
    figure.axes[-1].set_xlabel("Time (s)")
    low, high = figure.axes[-1].get_position().y0, figure.axes[0].get_position().y1
    bar = figure.colorbar(
        figure.axes[0].images[0],
        cax=figure.add_axes((right + 0.02, low, 0.02, high - low)),
        ticks=ticks,
        format=FixedFormatter(labels),
    )
    bar.ax.minorticks_off()
    bar.set_label("Data − model (standard errors)", labelpad=1)
    return figure


def _ticks(largest: float) -> list[float]:
    """Round numbers, both signs."""
    steps = [2.0, 4.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6]
    inside = [step for step in steps if step <= largest]
    kept = inside[:: math.ceil(len(inside) / 4)]
    return sorted([-step for step in kept] + [0.0] + kept)


def residual_map(content: Shown, fit: Fit) -> FloatArray:
    """Mean residual over its standard error in cells of phase and time.

    Phase 0 is the turning point on the positive side, pi that on the negative. Every cell
    is a cycle or more wide.

    Returns
    -------
    FloatArray
        Shape (PHASES, columns); NaN where there is no reading.
    """
    residual, sampled = content.residual(fit), content.clock.sampled
    known = np.isfinite(residual)
    turned = math.pi if sampled.motion.upwards < 0.0 else 0.0
    phase = np.mod(sampled.phase + turned, 2.0 * math.pi) / (2.0 * math.pi)
    time = content.data.time_s
    turns = float(sampled.phase[-1] - sampled.phase[0]) / (2.0 * math.pi)
    columns = max(1, int(min(turns, _COLUMNS, len(time) / (_IN_A_CELL * PHASES))))
    share = (time - time[0]) / (time[-1] - time[0])
    cells: dict[str, Any] = {"bins": (PHASES, columns), "range": ((0.0, 1.0), (0.0, 1.0))}
    count, *_ = np.histogram2d(phase[known], share[known], **cells)
    total, *_ = np.histogram2d(phase[known], share[known], weights=residual[known], **cells)
    with np.errstate(invalid="ignore"):  # NaN where there is none
        return np.asarray(total / (np.sqrt(count) * content.noise.rms))


_BANDS: Final = 500
"""Of the spectrum, even in ln f: as many as a figure has dots across."""
_HARMONICS: Final = 8
"""Of the motion that are marked."""


@styled
def draw_residual_spectrum(content: Shown) -> Figure:
    """Draw the amplitude spectral density of what each model leaves."""
    spectra = [spectrum(content, fit) for _, fit in content.models]
    frequency, floor = spectra[0][0], noise_level(content, spectra[0][0])
    highest = float(max(np.max(density) for _, density in spectra))
    factor, unit = prefixed(highest, content.data.unit)
    looks = zip(content.models, spectra, COLOURS, (1.3, 0.8), strict=False)
    marks = [
        curve(frequency, factor * density, colour, width=width, label=name)
        for (name, _), (_, density), colour, width in looks
    ]
    ends = float(frequency[0]), float(frequency[-1])
    marks += [
        curve(frequency, factor * floor, INK, "--", 1.1, label="noise"),
        *_harmonics(content, *ends),
        logarithmic("x"),
        logarithmic("y"),
    ]
    return figure_of(
        3.3,
        Panel(
            marks,
            {
                "xlabel": "Frequency (Hz)",
                "ylabel": f"Residual, density ({unit or 1}/√Hz)",
                "xlim": ends,
                "ylim": (0.1 * factor * float(np.min(floor)), 2.0 * factor * highest),
            },
            key=2,
            lift=1.06,
        ),
        margins={"bottom": 0.14, "top": 0.8},
    )


def _harmonics(content: Shown, low: float, high: float) -> Iterator[Mark]:
    """A thin line at each multiple of the motion's frequency."""
    motion = float((content.extended or content.baseline).value[OMEGA]) / (2.0 * math.pi)
    place = {"xycoords": ("data", "axes fraction"), "ha": "center", "color": GREY}
    for harmonic in range(1, _HARMONICS + 1):
        line = harmonic * motion
        if low < line < high:
            yield methodcaller("axvline", line, color=GREY, linewidth=0.6, linestyle=":", zorder=0)
        if low < line < high and harmonic in (1, 2, 3, 5, 8):
            yield words(f"{harmonic}", (line, 1.0), (0.0, 2.0), fontsize=7.5, **place)


def spectrum(content: Shown, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Amplitude spectral density of a residual, in bands of equal ratio.

    Returns
    -------
    frequency_hz, density
        Shape (k,): in rad/sqrt(Hz) (one-sided, Hann's window), rms over each band.
    """
    residual, time = content.residual(fit), content.data.time_s
    known, count = np.isfinite(residual), len(residual)
    if count < 32:
        raise NothingToDrawError("there are too few readings for a spectrum")
    if not (content.data.uniform and known.all()):
        # Uneven readings are interpolated, masked ones bridged.
        even = np.linspace(time[0], time[-1], count)
        residual = np.interp(even, time[known], residual[known])
    interval = float(time[-1] - time[0]) / (count - 1)
    window = np.hanning(count)
    lines = np.fft.rfft((residual - np.mean(residual)) * window)[2:-1]
    power = 2.0 * interval * np.abs(lines) ** 2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(count, interval)[2:-1]
    # Means of the power over bands, so that a long record makes no black carpet.
    edges = np.geomspace(frequency[0], frequency[-1], _BANDS)
    inside = np.searchsorted(edges, frequency, side="right")
    number, middle, mean = (
        np.bincount(inside, weights=of, minlength=_BANDS + 1) for of in (None, frequency, power)
    )
    full = number > 0
    return middle[full] / number[full], np.sqrt(mean[full] / number[full])


def noise_level(content: Shown, frequency: FloatArray) -> FloatArray:
    """The noise's density that the diagnosis has used, rad/sqrt(Hz), at given frequencies."""
    noise, data = content.noise, content.data
    interval = float(data.time_s[-1] - data.time_s[0]) / (len(data) - 1)
    known = np.arange(len(noise.variance)) / (2.0 * len(noise.variance) * interval)
    found = noise.rms**2 * np.interp(frequency, known, noise.variance) / np.mean(noise.variance)
    return np.sqrt(2.0 * interval * found)


Curves = list[tuple[str, str, str, Spans]]
"""Name, colour, dashes and spans of models."""


@styled
def draw_damping(content: Shown) -> Figure:
    """Draw 1/Q of each span of cycles, and by how much it differs from the baseline's."""
    found, omega = content.measured, float(content.baseline.value[OMEGA])
    curves = _models(content)
    quality_sd = 2.0 * found.loss_sd / omega
    expected = 2.0 * curves[0][3].loss / omega
    power, factor = _power(np.concatenate([2.0 * found.loss / omega - expected, quality_sd]))
    upper = _against_amplitude(
        content, curves, lambda spans: 2e3 * spans.loss / omega, 1e3 * quality_sd
    )
    lower = _against_amplitude(
        content,
        curves,
        lambda spans: factor * (2.0 * spans.loss / omega - expected),
        factor * quality_sd,
    )
    off = f"1/Q − {content.baseline_name}'s ({power})"
    return figure_of(
        4.2,
        upper._replace(about={"ylabel": "Loss 1/Q (10⁻³)"}),
        lower._replace(about=lower.about | {"ylabel": off}, key=0),
        shares=(1.0, 0.8),
        margins={"bottom": 0.11, "top": 0.885, "hspace": 0.1},
    )


@styled
def draw_frequency(content: Shown) -> Figure:
    """Draw the frequency of each span of cycles, relative to the baseline's omega/(2 pi)."""
    found = content.measured
    origin = float(content.baseline.value[OMEGA]) / (2.0 * math.pi)
    shift_sd = found.frequency_sd_hz / origin
    power, factor = _power(np.concatenate([found.frequency_hz / origin - 1.0, shift_sd]))
    shifts = _against_amplitude(
        content,
        _models(content),
        lambda spans: factor * (spans.frequency_hz / origin - 1.0),
        factor * shift_sd,
    )
    about = shifts.about | {"ylabel": f"Frequency change from {origin:.5g} Hz ({power})"}
    return figure_of(3.2, shifts._replace(about=about), margins={"bottom": 0.145, "top": 0.84})


def _models(content: Shown) -> Curves:
    """The baseline and the extended model."""
    looks = ((VERMILION, "--"), (INK, "-"))
    return [
        (name, *look, content.of_model(fit))
        for (name, fit), look in zip(content.models, looks, strict=False)
    ]


def _against_amplitude(
    content: Shown,
    curves: Curves,
    quantity: Callable[[Spans], FloatArray],
    sd: FloatArray,
) -> Panel:
    """A quantity of the readings' spans, with its error, and of each model's."""
    across, unit = axis_unit(content.measured.amplitude, content.data.unit)
    x = across * content.measured.amplitude
    look: dict[str, Any] = THIN | {"markersize": 3.2, "elinewidth": 0.7, "label": "readings"}
    marks = [measured(x, quantity(content.measured), sd, **look)]
    marks += [
        curve(x, quantity(spans), colour, dashes, 1.2, label=name)
        for name, colour, dashes, spans in curves
    ]
    fall = float(np.max(x)) / float(np.min(x))
    if fall >= 3.0:
        marks.append(logarithmic("x", fall))
    return Panel(marks, {"xlabel": f"Amplitude ({unit})"}, key=2 if content.extended else 3)


def _power(values: FloatArray) -> tuple[str, float]:
    """The power of a thousand that scales an axis of pure numbers."""
    largest = float(np.nanmax(np.abs(values)))
    if largest >= 0.5 or largest == 0.0:
        return "1", 1.0
    if largest >= 0.5e-3:
        return "10⁻³", 1e3
    return "10⁻⁶", 1e6


@styled
def draw_curve(content: Shown) -> Figure:
    """Draw the missing force that stands in the place of each effect, one below the other.

    Those that stand out over all their knots; where none does, the first.
    """
    found = [effect.curve for effect in content.diagnosis.missing if effect.curve is not None]
    if not found:
        raise NothingToDrawError("nothing that is missing is a curve")
    drawn = [each for each in found if each["stands_out"]] or found[:1]
    below = [panel for each in drawn for panel in _curves(each)]
    # Above the axes, of two inches, stand up to two rows of a key and as many lines of a title.
    above = 0.38 + 0.18 * max(2 * bool(each.key) + 10.0 * (each.lift - 1.1) for each in below)
    height = (2.5 + above) * len(below)
    margins = {"bottom": 0.5 / height, "top": 1.0 - above / height, "hspace": 0.25 + above / 2.0}
    return figure_of(height, *below, margins=margins | {"left": 0.17}, sharex=False)


def _curves(drawn: Mapping[str, Any]) -> Iterator[Panel]:
    """A curve, or its two parts (in phase and in quadrature); and its local exponent."""
    at, argument = _scaled(drawn["at"], drawn["argument"])
    looks = [("value", "sd", BLUE, "-", "any form, 95 %")]
    if "quadrature" in drawn:
        looks[0] = (*looks[0][:-1], "in phase")
        looks.append(("quadrature", "quadrature_sd", GREEN, "--", "in quadrature"))
    named = {"value": drawn.get("named"), "quadrature": drawn.get("named_quadrature")}
    if (other := named["quadrature"]) is not None:
        # A part that a named effect has not would hide the one that it has.
        reach = 1.96 * np.asarray(drawn["quadrature_sd"])
        looks = looks[: 1 + bool(np.any(np.abs(np.asarray(other)) > reach))]
    name, _, unit = str(drawn["ordinate"]).replace("omega^2", "ω²").partition(", ")
    largest = max(float(np.max(np.abs(drawn[key]))) for key, *_ in looks)
    factor, short = prefixed(largest, unit) if unit in ("rad", "m") else (1.0, unit)
    marks = [level(0.0)]
    for key, sd, colour, dashes, label in looks:
        value = factor * np.asarray(drawn[key])
        marks += [
            band(at, value, 1.96 * factor * np.asarray(drawn[sd]), colour),
            curve(at, value, colour, dashes, label=label),
        ]
    for key, *_ in looks:
        if (over := named[key]) is not None:
            # A name that begins so is not in the key.
            named_as = drawn["named_as"] if key == "value" else "_"
            marks.append(curve(at, factor * np.asarray(over), VERMILION, "--", label=named_as))
    label = f"{name[:1].upper()}{name[1:]} ({pretty_unit(short)})"
    about = {"xlabel": argument, "xmargin": 0.01}
    title = textwrap.fill(drawn["summary"], 58)
    own = {"ylabel": textwrap.fill(label, 26), "title": title[:1].upper() + title[1:]}
    yield Panel(marks, about | own, key=2 * (len(marks) > 3), lift=1.1 + 0.1 * title.count("\n"))
    if "local_exponent" in drawn:
        # The power of the velocity that the whole loss follows, by amplitude.
        value = np.asarray(drawn["local_exponent"])
        reach = 1.96 * np.asarray(drawn["local_exponent_sd"])
        powers = [level(power, width=0.6, linestyle=":") for power in (0, 1, 2)]
        ends = max(float(np.min(value)) - 1.0, -2.0), min(float(np.max(value)) + 1.0, 5.0)
        yield Panel(
            [band(at, value, reach), curve(at, value, BLUE), *powers],
            about | {"ylabel": "Local exponent $n$ of |v|ⁿ", "ylim": ends},
        )


def _scaled(at: object, argument: str) -> tuple[FloatArray, str]:
    """Arguments in a suitable unit, and the label of their axis."""
    values = np.asarray(at, dtype=np.float64)
    name, _, unit = argument.partition(", ")
    has_prefix = unit in ("rad", "m") and not name.startswith("phase")
    factor, short = axis_unit(values, unit) if has_prefix else (1.0, unit)
    return factor * values, f"{name[:1].upper()}{name[1:]} ({short})"


DRAWINGS: Final[dict[str, Callable[[Shown], Figure]]] = {
    "decay": draw_decay,
    "residual_map": draw_residual_map,
    "residual_spectrum": draw_residual_spectrum,
    "damping": draw_damping,
    "frequency": draw_frequency,
    "curve": draw_curve,
}
"""By name, in the order in which they are read."""


def draw_each(outcome: Diagnosis) -> Iterator[tuple[str, Figure]]:
    """Draw what there is to show, each by its name."""
    content = shown(outcome)
    for name, draw in DRAWINGS.items():
        with suppress(NothingToDrawError):
            yield name, draw(content)


def plot(outcome: Diagnosis) -> Figure:
    """Draw the decay with both models, and what each of them leaves."""
    return draw_decay(shown(outcome))


def draw_diagnosis(outcome: Diagnosis, folder: Path) -> list[Path]:
    """Draw what there is to show into a folder.

    Returns
    -------
    list of Path
        The SVG files; a PNG stands beside each.
    """
    return [save(figure, folder / name, dpi=150)[0] for name, figure in draw_each(outcome)]
