"""A sensor whose characteristic is curved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled


class SensorQuadratic(Effect):
    """y = x + s_2 x^2: mean shift and second harmonic, both s_2 y^2/2, and no other."""

    identifier = "sensor-quadratic"
    name = "quadratic sensor"
    kind = "measurement"
    equation = r"y = x + s_2 x^2"
    parameters = (Parameter("s2", "1/rad", -30.0, 30.0),)
    deciding = "calibrate the sensor at many angles"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s_2 x^2."""
        return np.asarray(values[0] * sampled.angle**2)


class SensorCubic(Effect):
    """y = x + s_3 x^3: third harmonic s_3 y^3/4 in phase, and no change of the frequency."""

    identifier = "sensor-cubic"
    name = "cubic sensor"
    kind = "measurement"
    equation = r"y = x + s_3 x^3"
    parameters = (Parameter("s3", "1/rad^2", -300.0, 300.0),)
    deciding = "calibrate the sensor at many angles"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s_3 x^3."""
        return np.asarray(values[0] * sampled.angle**3)
