"""Short recordings with an effect that Eq. 8 lacks, and their diagnoses, each made once."""

import functools
import math
from collections.abc import Callable
from copy import copy
from typing import Any
from unittest.mock import patch

import numpy as np

from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import silent
from pendpipe.diagnosis.begin import Beginning, begin
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.hypothesis import Hypothesis, Task
from pendpipe.diagnosis.noise import Noise, white_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import _fit_of, diagnose_recording
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.any_law import Motion
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.effects import Effect
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.effect import Parameter, Pendulum
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

FREQUENCY_HZ = 0.9
OMEGA_RAD_S = 2.0 * math.pi * FREQUENCY_HZ
NOISE_RAD = 1e-4
INTERVAL_S = 1.0 / 15.0
TIME_S = np.arange(1500) * INTERVAL_S
TRUTH = np.array([7.2e-3, 9.6e-3, 1.3e-4, 0.4, OMEGA_RAD_S, 0.15, -0.3, 0.01])
"""a, b, c, share, omega, angle and time of the release, offset."""
LINEAR = np.array([0.0, 9.6e-3, 0.0, 0.0, OMEGA_RAD_S, 0.15, -0.3, 0.01])
"""The same pendulum with viscous friction alone."""

INSTANT_S, LATER_S, TONE_HZ = 41.3, 70.2, 3.3
VALUES: dict[str, tuple[float, ...]] = {
    "circular-error": (1.0,),
    "frequency-drift": (6e-6, 40.0),
    "equilibrium-step": (4e-4, INSTANT_S),
    "tone-pickup": (2e-4, 1.5e-4, TONE_HZ),
    "sensor-quadratic": (0.02,),
    "sensor-cubic": (0.2,),
}
"""Effects of ten standard deviations or more."""


def white(seed: int, count: int = len(TIME_S), rms: float = NOISE_RAD) -> FloatArray:
    return np.asarray(rms * np.random.default_rng(seed).standard_normal(count))


def other_engine(values: FloatArray, time_s: FloatArray = TIME_S) -> FloatArray:
    """Eq. 8 by the compiled engine, which the diagnosis does not use."""
    a, b, c, share, omega, angle, start_s, offset = (float(value) for value in values)
    law = Eq8(omega, a, share * b, (1.0 - share) * b, c)
    return sample(law, Release(start_s, angle, offset), time_s)


def with_effects(*identifiers: str, base: FloatArray = TRUTH) -> FloatArray:
    """Readings without noise."""
    effects = tuple(by_identifier(identifier) for identifier in identifiers)
    values = [number for identifier in identifiers for number in VALUES[identifier]]
    return Model(TIME_S, INTERVAL_S, effects).reading(np.append(base, values))


def recording(readings: FloatArray, seed: int) -> Recording:
    count = len(readings)
    return Recording(TIME_S[:count], readings + white(seed, count), "angle_rad")


def beginning_of(record: Recording, restoring: Restoring | None = None) -> Beginning:
    """What a diagnosis starts from, as in `diagnose_recording`."""
    from pendpipe.analysis.fit import fit_recording
    from pendpipe.analysis.free_decay import measure_recording

    points, part = measure_recording(record, "the test")
    fit = fit_recording(part, points=points, restoring=restoring)
    return begin(prepare(part, "the test"), points, fit, baseline="eq8", fixed={})


def hypothesis_of(
    fit: Fit, data: Data, noise: Noise, held: tuple[int, ...], *more: Any, **names: Any
) -> Hypothesis:
    """What may be true of readings that were chosen as they are; then the fields as they come."""
    begun = Beginning(data, fit.model.bare(), fit.value[: len(TRUTH)], held)
    return Hypothesis(begun, fit, data, noise, held, *more, **names)


def task_of(samples: Samples | None = None) -> Task:
    """What a search for anything of the catalogue is to do, at a level of 1 %."""
    return Task(CATALOGUE, (), "eq8", 0.01, 1, silent, samples)


def prepared(
    readings: FloatArray, time_s: FloatArray = TIME_S, rms: float = NOISE_RAD
) -> tuple[Data, Noise]:
    """Readings with white noise of known size."""
    data = Data(time_s, readings, INTERVAL_S, True, np.ones(len(time_s)))
    return data, white_noise(data, rms)


def stribeck_record() -> tuple[Model, Data, Noise, FloatArray]:
    """A model with Stribeck's friction, its readings and their noise, and its values.

    Coulomb and quadratic losses take its place, and the refits of other losses creep.
    """
    time_s = np.arange(3600) * INTERVAL_S
    truth = np.array([2e-4, 1.2e-3, 1e-6, 0.5, 6.09, 0.0389, -0.25, 0.006, 0.0063, 0.0345])
    model = Model(time_s, INTERVAL_S, (by_identifier("stribeck-friction"),))
    data, noise = prepared(model.reading(truth) + white(5, 3600, 2e-5), time_s, 2e-5)
    return model, data, noise, truth


@functools.cache
def null_fit(seed: int = 3) -> tuple[Fit, Data, Noise]:
    """Eq. 8 fitted to itself with noise, from the truth."""
    data, noise = prepared(other_engine(TRUTH) + white(seed))
    return refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH), data, noise


def _pivot_misplaced() -> FloatArray:
    """A camera's pivot lies a twenty-fifth of the length beside the pendulum's."""
    angle = other_engine(TRUTH)
    return angle - 0.04 * (np.cos(angle) - 1.0)


def _dropped() -> FloatArray:
    """Three readings are missing at 46.7 s, without a gap in the times."""
    whole = other_engine(TRUTH)
    return np.concatenate([whole[:700], whole[703:]])


def _two_steps() -> FloatArray:
    """The equilibrium jumps one way, and by half of it back."""
    step = by_identifier("equilibrium-step")
    size, instant_s = VALUES["equilibrium-step"]
    values = (size, instant_s, -0.5 * size, LATER_S)
    return Model(TIME_S, INTERVAL_S, (step, copy(step))).reading(np.append(TRUTH, values))


_READINGS: dict[str, Callable[[], FloatArray]] = {
    "null": lambda: other_engine(TRUTH),
    "dropped-samples": _dropped,
    "camera-geometry": _pivot_misplaced,
    "two steps": _two_steps,
    "linear": lambda: other_engine(LINEAR),
}


@functools.cache
def diagnosed(name: str, seed: int = 1) -> Diagnosis:
    """The diagnosis of an effect's recording, or of one of the others above: wheels and springs."""
    if name == "circular-error":
        return scanned(name)
    make = _READINGS.get(name, lambda: with_effects(name))
    return diagnose_recording(recording(make(), seed), restoring="linear")


@functools.cache
def scanned(name: str) -> Diagnosis:
    """The same where the fit takes x, so that the scan finds whatever else there is."""

    def linear(*given: Any) -> FitResult | None:
        return _fit_of(*given[:-2], "linear", given[-1])

    with patch("pendpipe.diagnosis.run._fit_of", linear):
        return diagnose_recording(recording(with_effects(name), 1))


def classes_found(outcome: Diagnosis) -> list[set[str]]:
    """The identifiers of each found effect's class."""
    return [
        {effect.identifier, *(name for name, _ in effect.indistinguishable)}
        for effect in outcome.effects
    ]


class Magnet(Effect):
    """A pull to the centre that reaches 40 mrad: the torque -m x/(1 + (x/w)^2)^2."""

    identifier = "magnet"
    name = "a magnet under the pendulum"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{-}= m x/(1 + (x/w)^2)^2"
    parameters = (Parameter("m", "1/s^2", -10.0, 10.0), Parameter("w", "rad", 1e-3, 1.0))
    discriminating_test = "take it away"

    def acceleration(
        self,
        motion: Motion,
        pendulum: Pendulum,  # noqa: ARG002
        values: FloatArray,
    ) -> FloatArray:
        """Return the torque over the moment of inertia."""
        pull, width = values
        return np.asarray(-pull * motion.angle / (1.0 + (motion.angle / width) ** 2) ** 2)


def pulled(pull_s2: float = 0.02, width_rad: float = 0.04) -> FloatArray:
    """Readings of a pendulum over a magnet, without noise."""
    model = Model(TIME_S, INTERVAL_S, (Magnet(),))
    return model.reading(np.append(TRUTH, [pull_s2, width_rad]))
