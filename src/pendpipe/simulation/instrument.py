"""The instrument: an ideal converter, and faults without a signature (jitter, glitches, ...).

The `[[effects]]` of a model file are read here: which of the catalogue, and how strong.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.configuration.faults import nearest
from pendpipe.dynamics import Eq8
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import Effect, Parameter
from pendpipe.errors import InputError, refuse_if


class Given(NamedTuple):
    """An effect with its values, a switch's size included."""

    effect: Effect
    values: FloatArray

    def named(self) -> dict[str, float]:
        """The values by their parameters' names."""
        first = 1 if self.effect.parameter_free else 0
        names = [parameter.name for parameter in self.effect.parameters]
        return dict(zip(names, self.values[first:].tolist(), strict=True))


def read_effects(place: str | Path, tables: Sequence[Mapping[str, Any]]) -> list[Given]:
    """Check the tables `[[effects]]` of a model file.

    Raises
    ------
    InputError
        Where an identifier or a parameter is unknown, missing, or out of its bounds.
    """
    return [
        _read(f"{place}, effects {number}", dict(table))
        for number, table in enumerate(tables, start=1)
    ]


def _read(place: str, table: dict[str, Any]) -> Given:
    identifier = table.pop("id", None)
    if not isinstance(identifier, str):
        raise InputError(place, "its id is missing", 'add id = "...", a name of docs/effects.md')
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
    refuse_if(not is_number, place, f"{name} is no number", f"give a number{unit}")
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
        if "clock-slips" in self.settings:
            slips = self.settings["clock-slips"]
            time_s = time_s + slips["dt"] * self._staircase(slips["number"], len(time_s))
        if "jitter" not in self.settings:
            return time_s
        scatter = self.settings["jitter"]["sigma_t"] * self.random.standard_normal(len(time_s))
        return np.sort(time_s + scatter)

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
        if "count-slips" in self.settings:
            slips = self.settings["count-slips"]
            angle += slips["step"] * self._staircase(slips["number"], len(angle))
        if "glitches" in self.settings:
            glitches = self.settings["glitches"]
            number = min(round(glitches["number"]), len(angle))
            where = self.random.choice(len(angle), number, replace=False)
            angle[where] += glitches["rms"] * self.random.standard_normal(number)
        if "clipping" in self.settings:
            levels = self.settings["clipping"]
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
        """Let some codes within the record's range never come: a neighbour comes instead."""
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
    if np.isfinite(high):
        angle = high - width * np.logaddexp(0.0, (high - angle) / width)
    if np.isfinite(low):
        angle = low + width * np.logaddexp(0.0, (angle - low) / width)
    return angle
