"""A pendulum and its measurement chain, described in a TOML file for `pendpipe simulate`.

The motion with any effects of the catalogue, to the stop; the instrument: an ideal converter, and
faults without a signature (jitter, glitches, ...).
"""

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from pendpipe.arrays import FloatArray
from pendpipe.configuration.load import as_input_error
from pendpipe.configuration.models import NotNegative, Positive, Section, Sensor
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.any_law import Motion, NoMotionError, sample_pieces
from pendpipe.dynamics.eq8 import TIME, Drag, Restoring
from pendpipe.dynamics.eq8_model import values_of
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import Effect, Parameter
from pendpipe.effects.model import Model as EffectsModel
from pendpipe.errors import InputError, nearest, refuse_if
from pendpipe.files import read_text
from pendpipe.recording import Recording


class PendulumModel(Section):
    """Eq. 8: a frequency, four losses, and a release."""

    frequency_hz: Positive = Field(description="Eq. 8's omega over 2 pi")
    quality_factor_hysteretic: Positive | None = Field(None, description="Q_h; blank: none")
    quality_factor_viscous: Positive | None = Field(None, description="Q_v; blank: none")
    a: NotNegative = Field(0.0, description="quadratic drag's rate in Eq. 13, 1/(rad s)")
    c: NotNegative = Field(0.0, description="Coulomb friction's rate in Eq. 13, rad/s")
    restoring: Restoring = Field(
        "sine", description="torque omega^2 sin x, or omega^2 x: a spring, a torsion wheel"
    )
    drag: Drag = Field("energy", description="quadratic drag as Eq. 8 has it, or v|v|: speed")
    release_angle_rad: float = Field(description="angle from which it is let go, at rest")
    release_time_s: float = Field(
        0.0, le=0.0, description="when it is let go; the record starts at 0"
    )

    def equation(self) -> Eq8:
        """Eq. 8 with these numbers."""
        omega = 2.0 * np.pi * self.frequency_hz
        hysteretic, viscous = self.quality_factor_hysteretic, self.quality_factor_viscous
        return Eq8(
            angular_frequency=omega,
            quadratic=self.a,
            hysteretic=omega / (2.0 * hysteretic) if hysteretic else 0.0,
            viscous=omega / (2.0 * viscous) if viscous else 0.0,
            coulomb=self.c,
            restoring=self.restoring,
            drag=self.drag,
        )


class SensorModel(Sensor):
    """The angle sensor, of either sign; without one the recording is in radians."""

    volts_per_radian: float = Field(3.85, description="its constant")


class ConverterModel(Section):
    """The analogue-to-digital converter; without one the volts are not rounded."""

    bits: Annotated[int, Field(ge=2, le=32)] = Field(16, description="bits of a code")
    range_volts: Positive = Field(10.0, description="it spans minus to plus this")


class SamplingModel(Section):
    """When samples are taken."""

    sample_rate_hz: Positive = Field(description="samples a second")
    duration_s: Positive = Field(description="length of the record")


class Model(Section):
    """A recording to be simulated."""

    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the noise")
    pendulum: PendulumModel = Field(description="the motion")
    noise_rad: NotNegative = Field(0.0, description="rms of white noise added to the angle")
    sensor: SensorModel | None = Field(None, description="the sensor; none: radians")
    converter: ConverterModel | None = Field(None, description="the converter; none: no steps")
    sampling: SamplingModel = Field(description="rate and length")
    effects: list[dict[str, Any]] = Field(
        [], description="effects of docs/effects.md: id, and its parameters by their names"
    )

    @model_validator(mode="after")
    def _converter_has_a_sensor(self) -> Self:
        if self.converter is not None and self.sensor is None:
            raise ValueError("a converter needs a sensor before it")
        return self


def read_model(source: str | Path | Mapping[str, Any]) -> Model:
    """Read a model from a TOML file, or check a mapping of the same form.

    Raises
    ------
    InputError
        For what the model can't have: the key and the nearest known name.
    """
    place = "model" if isinstance(source, Mapping) else Path(source)
    try:
        content = (
            tomllib.loads(read_text(place, "check the path", form="TOML"))
            if isinstance(place, Path)
            else source
        )
        return Model.model_validate(content)
    except tomllib.TOMLDecodeError as problem:
        raise InputError(place, f"this is not TOML ({problem})", "correct it") from None
    except ValidationError as fault:
        raise as_input_error(place, fault, Model) from None


class Given(NamedTuple):
    """An effect with its values, a switch's size included."""

    effect: Effect
    values: FloatArray

    def named(self) -> dict[str, float]:
        """The values by their parameters' names."""
        first = 1 if self.effect.parameter_free else 0
        names = [parameter.name for parameter in self.effect.parameters]
        return dict(zip(names, self.values[first:].tolist(), strict=True))


def _read(place: str, table: dict[str, Any]) -> Given:
    identifier = table.pop("id", None)
    if not isinstance(identifier, str):
        raise InputError(
            place, "its id is missing", 'add id = "...", a name that pendpipe effects --list prints'
        )
    effect = by_identifier(identifier, place)
    place = f"{place} ({identifier})"
    known = [parameter.name for parameter in effect.parameters]
    for name in table:
        refuse_if(name not in known, place, f"unknown parameter '{name}'", nearest(name, known))
    values = [_value(place, parameter, table) for parameter in effect.parameters]
    return Given(effect, np.array([1.0] * effect.parameter_free + values))


def _value(place: str, parameter: Parameter, table: Mapping[str, Any]) -> float:
    given = table.get(parameter.name, parameter.default)
    unit = f", in {parameter.unit}" if parameter.unit_in("rad") else ""
    name = f"'{parameter.name}'"
    refuse_if(given is None, place, f"{name} is missing", f"add it{unit}")
    is_number = isinstance(given, int | float) and not isinstance(given, bool)
    refuse_if(not is_number, place, f"{name} is not a number", f"give a number{unit}")
    refuse_if(
        not parameter.low <= given <= parameter.high,
        place,
        f"{name} is {given:g}",
        f"give a number from {parameter.low:g} to {parameter.high:g}{unit}",
    )
    return float(given)


class Instrument:
    """What a list of effects does to times, angles, noise and codes.

    Parameters
    ----------
    given
        The effects; those with a signature in the readings are ignored.
    random
        Numbers for what is drawn.
    place
        For messages.
    """

    def __init__(
        self, given: Sequence[Given], random: np.random.Generator, place: str | Path
    ) -> None:
        self.random, self.place = random, place
        self.settings = {one.effect.identifier: one.named() for one in given}

    def times(self, time_s: FloatArray) -> FloatArray:
        """When the readings are really taken (slips, jitter)."""
        if slips := self.settings.get("clock-slips"):
            time_s = time_s + slips["dt"] * self._staircase(slips["number"], len(time_s))
        if jitter := self.settings.get("jitter"):
            scatter = self.random.standard_normal(len(time_s))
            time_s = np.sort(time_s + jitter["sigma_t"] * scatter)
        return time_s

    def _staircase(self, number: float, count: int) -> FloatArray:
        """Steps of one, up or down, at random readings."""
        where = self.random.choice(count, min(round(number), count), replace=False)
        return np.cumsum(np.bincount(where, self.random.choice([-1.0, 1.0], len(where)), count))

    def shaken(self, angle: FloatArray, time_s: FloatArray, equation: Eq8) -> FloatArray:
        """Add what a random torque of constant density does (linear response, by impulses)."""
        if "broadband-drive" not in self.settings:
            return angle
        from scipy.signal import lfilter

        density = self.settings["broadband-drive"]["acceleration_density"]
        interval = float(time_s[1] - time_s[0])
        loss = equation.hysteretic + equation.viscous
        turn = math.sqrt(max(equation.angular_frequency**2 - loss**2, 0.0))
        left = math.exp(-loss * interval)
        # One-sided density: the velocity's impulses have the variance S_a dt/2.
        impulses = math.sqrt(0.5 * density * interval) * self.random.standard_normal(len(angle))
        rings = [0.0, left * math.sin(turn * interval) / turn]
        back = [1.0, -2.0 * left * math.cos(turn * interval), left**2]
        return np.asarray(angle + lfilter(rings, back, impulses))

    def coloured(self, noise: FloatArray, rate_hz: float) -> FloatArray:
        """Give white noise the density 1 + (corner/f)^exponent."""
        if "coloured-noise" not in self.settings:
            return noise
        colour = self.settings["coloured-noise"]
        lines = np.fft.rfft(noise)
        frequency = np.fft.rfftfreq(len(noise), 1.0 / rate_hz)
        frequency[0] = frequency[1] if len(frequency) > 1 else 1.0
        lines *= np.sqrt(1.0 + (colour["corner"] / frequency) ** colour["exponent"])
        return np.asarray(np.fft.irfft(lines, len(noise)))

    def wander(self, count: int) -> FloatArray | None:
        """What a wandering mark adds to the distance from the pivot; some 20 samples long."""
        if "tracking-noise" not in self.settings:
            return None
        steps = np.exp(-np.arange(100) / 20.0)
        drawn = np.convolve(self.random.standard_normal(count + 99), steps, "valid")
        return np.asarray(drawn / np.std(drawn) * self.settings["tracking-noise"]["rms"])

    def spoilt(self, angle: FloatArray) -> FloatArray:
        """Add slips and glitches, then clip, then round coarsely."""
        angle = angle.copy()
        if slips := self.settings.get("count-slips"):
            angle += slips["step"] * self._staircase(slips["number"], len(angle))
        if glitches := self.settings.get("glitches"):
            number = min(round(glitches["number"]), len(angle))
            where = self.random.choice(len(angle), number, replace=False)
            angle[where] += glitches["rms"] * self.random.standard_normal(number)
        if levels := self.settings.get("clipping"):
            refuse_if(
                not levels["lower_level"] < levels["upper_level"],
                self.place,
                "clipping: lower_level is not below upper_level",
                "swap them",
            )
            angle = _limited(angle, levels["lower_level"], levels["upper_level"], levels["width"])
        step = self.settings.get("coarse-quantisation", {}).get("step", 0.0)
        return step * np.round(angle / step) if step else angle

    def given_codes(self, codes: FloatArray) -> FloatArray:
        """Replace some codes within the record's range by a neighbour, wherever they occur."""
        number = round(self.settings.get("missing-codes", {}).get("number", 0.0))
        if not number:
            return codes
        low, high = int(codes.min()), int(codes.max())
        refuse_if(
            number > (high - low) // 4,
            self.place,
            f"{number} missing codes of {high - low + 1}",
            "leave most of them",
        )
        missing = self.random.choice(np.arange(low + 1, high), number, replace=False)
        while np.any(lost := np.isin(codes, missing)):
            codes = np.where(lost, codes + self.random.choice([-1.0, 1.0], len(codes)), codes)
        return codes


def _limited(angle: FloatArray, low: float, high: float, width: float) -> FloatArray:
    """Cut off at two levels; smoothly over a width: y = L - w ln(1 + e^((L - x)/w))."""
    if width == 0.0:
        return np.clip(angle, low, high)
    for level, side in ((high, width), (low, -width)):
        if np.isfinite(level):
            angle = level - side * np.logaddexp(0.0, (level - angle) / side)
    return angle


def refuse_inert_effects(model: Model, given: Sequence[Given], place: str) -> None:
    """Refuse effects that have nothing to act on, and instrument faults that are given twice.

    Raises
    ------
    InputError
        Which effect, what is missing, what to do.
    """
    pendulum, seen = model.pendulum, set[str]()
    noisy = model.noise_rad > 0.0 or (model.sensor is not None and model.sensor.noise_volts > 0.0)
    damped = any(
        (
            pendulum.a,
            pendulum.c,
            pendulum.quality_factor_hysteretic,
            pendulum.quality_factor_viscous,
        )
    )
    for number, one in enumerate(given, start=1):
        name = one.effect.identifier
        where = f"{place}, effects {number} ({name})"
        levels = [one.named().get(level, math.nan) for level in ("lower_level", "upper_level")]
        for wrong, problem, remedy in (
            (
                not one.effect.has_signature and name in seen,
                "it is given before",
                "write one table of it",
            ),
            *(
                (
                    not getattr(pendulum, need),
                    f"it does nothing where the pendulum's {need} is 0",
                    f"give {need}",
                )
                for need in one.effect.needs
            ),
            (
                name == "damping-step" and not damped,
                "it does nothing where the pendulum has no damping",
                "give a, c or a quality factor",
            ),
            (
                name == "missing-codes" and model.converter is None,
                "there are no missing codes without a converter",
                "add [converter]",
            ),
            (
                name == "coloured-noise" and not noisy,
                "it colours the noise, and there is none",
                "give noise_rad, or noise_volts",
            ),
            (
                name == "clipping" and not np.isfinite(levels).any(),
                "neither of its levels is given",
                "give upper_level or lower_level, in rad",
            ),
        ):
            refuse_if(wrong, where, problem, remedy)
        seen.add(name)


def simulate(model: Model, source: str = "simulated", place: str = "the model") -> Recording:
    """Make the recording that a model describes.

    Parameters
    ----------
    model, source
        What is simulated, and what the recording gives as its source.
    place
        For messages about its effects.

    Returns
    -------
    Recording
        In volts where there is a sensor, else in radians, with its metadata.
    """
    tables = enumerate(model.effects, start=1)
    given = [_read(f"{place}, effects {number}", dict(table)) for number, table in tables]
    refuse_inert_effects(model, given, place)
    rate = model.sampling.sample_rate_hz
    time = np.arange(int(np.floor(model.sampling.duration_s * rate + 1e-9))) / rate
    instrument = Instrument(given, np.random.default_rng([model.seed, 1]), place)
    angle = _angles(model, given, instrument, time, place)
    random = np.random.default_rng(model.seed)
    angle += instrument.coloured(model.noise_rad * random.standard_normal(len(time)), rate)
    along = instrument.wander(len(time))
    if along is not None:
        angle += instrument.settings["tracking-noise"]["kappa"] * along
    metadata = {"source": source, "seed": str(model.seed)}
    if given:
        metadata["effects"] = ", ".join(one.effect.identifier for one in given)
    sensor, converter = model.sensor, model.converter
    if sensor is None:
        return Recording(
            time, instrument.spoilt(angle), "angle_rad", metadata=metadata, radius_excess=along
        )
    noise = sensor.noise_volts * random.standard_normal(len(time))
    angle += instrument.coloured(noise, rate) / sensor.volts_per_radian
    volts = sensor.offset_volts + sensor.volts_per_radian * instrument.spoilt(angle)
    metadata["volts_per_radian"] = repr(sensor.volts_per_radian)
    if converter is None:
        return Recording(time, volts, "volts", metadata=metadata)
    metadata |= {"bits": str(converter.bits), "range_volts": repr(converter.range_volts)}
    step = 2.0 * converter.range_volts / 2.0**converter.bits
    # The codes of an offset-binary converter: from -range to +range less a step.
    codes = np.round(np.clip(volts, -converter.range_volts, converter.range_volts - step) / step)
    volts = step * instrument.given_codes(codes)
    return Recording(time, volts, "volts", metadata=metadata, resolution=step)


def simulated_volts(model: Model, place: str = "the model") -> Callable[[FloatArray], FloatArray]:
    """What an instrument reads of a model: volts at any time, before its own converter.

    Between the samples of `simulate` it goes straight; give a `sample_rate_hz` at which that is
    no matter. After their end the pendulum hangs at rest.

    Raises
    ------
    InputError
        If the model has no sensor.
    """
    if model.sensor is None:
        raise InputError(f"{place}, sensor", "an instrument reads volts", "add a sensor")
    recording = simulate(model.model_copy(update={"converter": None}), place=place)
    rest_volts = model.sensor.offset_volts

    def volts(time_s: FloatArray) -> FloatArray:
        return np.interp(time_s, recording.time_s, recording.values, right=rest_volts)

    return volts


def _angles(
    model: Model, given: list[Given], instrument: Instrument, time: FloatArray, place: str
) -> FloatArray:
    """The motion at the instants of the readings; by Eq. 8's engine where that is all."""
    equation = model.pendulum.equation()
    release = Release(model.pendulum.release_time_s, model.pendulum.release_angle_rad)
    taken = instrument.times(time)
    moving = [one for one in given if one.effect.has_signature]
    refuse_if(
        equation.restoring == "sine" and not abs(release.angle_rad) < math.pi,
        place,
        "with sin x it is released beyond pi",
        "release it below 3.14 rad",
    )
    angle = (
        _with_effects(equation, release, moving, taken, place)
        if moving
        else sample(equation, release, taken)
    )
    return instrument.shaken(angle, time, equation)


_ORDER: Final = 64
"""Nodes of a half cycle: with sin x from 2.6 rad the readings are then good to 2e-7 rad."""
Pieces = list[tuple[float, Motion]]


def _with_effects(
    equation: Eq8, release: Release, given: Sequence[Given], time_s: FloatArray, place: str
) -> FloatArray:
    """Return the readings at rising times, in rad: motion, and what effects add to it.

    Where friction ends the motion, the pendulum rests at its last turning point: the last
    swings, of about the friction's own displacement, are not followed.

    Raises
    ------
    InputError
        If the pendulum never turns.
    """
    effects = tuple(one.effect for one in given)
    value = np.concatenate([values_of(equation, release), *(one.values for one in given)])
    interval = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 1.0
    model = EffectsModel(
        time_s, interval, effects, _ORDER, restoring=equation.restoring, drag=equation.drag
    )
    pieces = _longest(model, value, equation.angular_frequency, place)
    stamps = model.taken_at(value)
    end = float(pieces[-1][1].time_s[-1, -1])
    sampled = replace(sample_pieces(pieces, np.minimum(stamps, end)), time_s=stamps)
    return model.read(sampled, value)


def _longest(model: EffectsModel, value: FloatArray, omega: float, place: str) -> Pieces:
    """Follow the motion past the last reading, or as far as friction lets it go."""
    begin, last = float(value[TIME]), float(model.time_s[-1])
    count, good, bad = math.ceil((last - begin) * omega / math.pi) + 1, 0, math.inf
    found: Pieces | None = None
    while good < count < bad:
        try:
            pieces = model.over(count).follow(value)
        except NoMotionError:
            bad = count
        else:
            good, found = count, pieces
            end = float(pieces[-1][1].time_s[-1, -1])
            if end > last:
                return pieces
            count = count + math.ceil(count * (last - end) / (end - begin)) + 1
        if bad < math.inf:
            count = (good + int(bad)) // 2
    if found is None:
        raise InputError(place, "the pendulum does not swing", "weaken its friction or effects")
    return found
