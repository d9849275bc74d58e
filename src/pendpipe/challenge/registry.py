"""Every effect that can be hidden, by identifier: importing this fills the registry."""

from __future__ import annotations

from typing import Final

import numpy as np

from pendpipe.challenge import (
    hidden_instrument,
    hidden_losses,
    hidden_motion,
    hidden_outside,
)
from pendpipe.challenge.hidden import CATALOGUE, OUTSIDE, Hidden, Maker
from pendpipe.challenge.scenario import Scenario

MODULES: Final = (hidden_losses, hidden_motion, hidden_instrument, hidden_outside)

MEASUREMENT: Final = frozenset(
    {
        "sensor-quadratic", "sensor-cubic", "sensor-backlash", "offset-drift", "gain-drift",
        "ac-coupling", "tone-pickup", "clipping", "missing-codes", "coarse-quantisation",
        "clock-drift", "jitter", "dropped-samples", "glitches", "coloured-noise",
    }
)  # fmt: skip
"""Identifiers of the contract that change the reading and not the motion."""

EFFECTS: Final = tuple(CATALOGUE)
ONLY_VISCOUS: Final = frozenset({"coulomb-friction", "quadratic-drag"})
"""Inside the eq8 baseline: hidden only from the viscous one."""


def kind_of(effect: str) -> str:
    """``dynamics``, ``measurement`` or ``unnamed``."""
    if effect.startswith("unnamed-"):
        return "unnamed"
    return "measurement" if effect in MEASUREMENT else "dynamics"


def laws_of(effect: str) -> list[Maker]:
    """The laws by which an effect can act, in or outside the catalogue."""
    if effect in CATALOGUE:
        return CATALOGUE[effect]
    return OUTSIDE[effect]


def hide(
    random: np.random.Generator, effect: str, scenario: Scenario, *, own_form: bool | None = None
) -> Hidden:
    """Draw a law and its details.

    Parameters
    ----------
    effect
        Identifier, or a key of `OUTSIDE`.
    own_form
        Ask for a law that is (or is not) the catalogue's own; any if None or impossible.
    """
    makers = laws_of(effect)
    order = random.permutation(len(makers))
    drawn = [makers[i](random, scenario) for i in order]
    wanted = [h for h in drawn if own_form is None or h.own_form is own_form]
    found: Hidden = (wanted or drawn)[0]
    return found
