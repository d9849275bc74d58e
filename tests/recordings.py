"""What recordings of all rooms are made of."""

import numpy as np

from pendpipe.arrays import FloatArray


def white(seed: int, count: int, rms: float) -> FloatArray:
    """White noise of readings, the same for one seed."""
    return np.asarray(rms * np.random.default_rng(seed).standard_normal(count))
