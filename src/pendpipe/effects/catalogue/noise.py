"""Noise that is not white: glitches, and what grows to low frequencies."""

from __future__ import annotations

import math
from typing import Final

from pendpipe.effects.effect import Effect, Parameter, without_template

GLITCHES: Final[Effect] = without_template(
    __name__,
    "Single readings far off.",
    identifier="glitches",
    name="glitches",
    equation=r"y_k = x_k + g_k, \quad k \in \mathcal{G}",
    parameters=(Parameter("number", "1", 0.0, 1e6), Parameter("rms", "rad", 0.0, math.inf)),
    discriminating_test="change cable and supply, and record at rest",
)
COLOURED_NOISE: Final[Effect] = without_template(
    __name__,
    """Noise that grows to low frequencies.

    The diagnosis reports how steeply it falls about the pendulum's own frequency: the slope
    -d ln S/d ln f, which is alpha far below the corner and less about it.
    """,
    identifier="coloured-noise",
    name="coloured noise",
    equation=r"S(f) = S_0 \left[1 + (f_0/f)^{\alpha}\right]",
    parameters=(
        Parameter("corner", "Hz", 0.0, math.inf),
        Parameter("exponent", "1", 0.0, 4.0),
    ),
    discriminating_test="record with the pendulum held",
)
