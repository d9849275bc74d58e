"""A pendulum and its measurement chain, described in a TOML file for `pendpipe simulate`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from pendpipe.arrays import FloatArray
from pendpipe.configuration.faults import as_input_error, read_text
from pendpipe.configuration.models import NotNegative, Positive, Section
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.errors import InputError, refuse_if
from pendpipe.recording import Recording
from pendpipe.simulation.instrument import Given, Instrument, read_effects


class PendulumModel(Section):
    """Eq. 8: a frequency, four losses, and a release."""

    frequency_hz: Positive = Field(description="Eq. 8's omega over 2 pi")
    quality_factor_hysteretic: Positive | None = Field(None, description="Q_h; blank: none")
    quality_factor_viscous: Positive | None = Field(None, description="Q_v; blank: none")
    a: NotNegative = Field(0.0, description="quadratic drag's rate in Eq. 13, 1/(rad s)")
    c: NotNegative = Field(0.0, description="Coulomb friction's rate in Eq. 13, rad/s")
    restoring: Literal["linear", "sine"] = Field(
        "linear", description="torque omega^2 x, or omega^2 sin x for any amplitude below pi"
    )
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
        )


class SensorModel(Section):
    """The angle sensor; without one the recording is in radians."""

    volts_per_radian: float = Field(3.85, description="its constant")
    offset_volts: float = Field(0.0, description="its reading at rest")
    noise_volts: NotNegative = Field(0.0, description="rms of its white noise")


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
    def _converter_has_a_sensor(self) -> Model:
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
    content = source if isinstance(source, Mapping) else _toml(Path(source))
    try:
        return Model.model_validate(content)
    except ValidationError as fault:
        raise as_input_error(place, fault, Model) from None


def _toml(path: Path) -> dict[str, Any]:
    """Read a TOML file."""
    try:
        return tomllib.loads(read_text(path, "file", "check the path", "TOML"))
    except tomllib.TOMLDecodeError as problem:
        raise InputError(path, f"this is no TOML ({problem})", "correct it") from None


def refuse_inert_effects(model: Model, given: Sequence[Given], place: str) -> None:
    """Refuse effects that have nothing to act on, and instrument faults that are given twice.

    Raises
    ------
    InputError
        Which effect, what is missing, what to do.
    """
    pendulum, seen = model.pendulum, set[str]()
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
                name == "coloured-noise" and not _noise(model),
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


def _noise(model: Model) -> bool:
    """Whether the readings have any."""
    return model.noise_rad > 0.0 or (model.sensor is not None and model.sensor.noise_volts > 0.0)


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
    given = read_effects(place, model.effects)
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
        read = instrument.spoilt(angle)
        return Recording(time, read, "angle_rad", metadata=metadata, radius_excess=along)
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
    is_sine = equation.restoring == "sine"
    refuse_if(
        is_sine and not abs(release.angle_rad) < math.pi,
        place,
        "with sin x it is released beyond pi",
        "release it below 3.14 rad",
    )
    refuse_if(
        is_sine and moving,
        place,
        "effects are solved for a linear torque",
        'leave restoring out and add the effect "circular-error"',
    )
    if moving:
        from pendpipe.simulation.motion import angles

        angle = angles(equation, release, moving, taken, place)
    else:
        angle = sample(equation, release, taken)
    return instrument.shaken(angle, time, equation)
