"""An ideal analogue-to-digital converter."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray


def quantised(volts: FloatArray, step_volts: float) -> FloatArray:
    """Round to the nearest code: ``step round(volts/step)``; the error is at most half a step."""
    return step_volts * np.round(volts / step_volts)


def clipped(volts: FloatArray, range_volts: float, step_volts: float) -> FloatArray:
    """Limit to the codes of an offset-binary converter: from -range to +range less a step."""
    return np.clip(volts, -range_volts, range_volts - step_volts)
