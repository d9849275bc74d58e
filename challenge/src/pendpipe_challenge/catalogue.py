"""Every effect that can be hidden, by identifier; of the catalogue or outside it.

For an effect that no catalogue entry describes, the right answer is ``unnamed-...`` of the
right kind.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

# Importing them enters their effects.
from pendpipe_challenge import hidden_instrument, hidden_pendulum  # noqa: F401
from pendpipe_challenge.hidden import (
    CATALOGUE,
    OUTSIDE,
    Hidden,
    Maker,
    amplitude,
    enter,
    outside,
)
from pendpipe_challenge.scenario import Scenario

Random = np.random.Generator
RESTORING, DAMPING = "unnamed-restoring", "unnamed-damping"
READING = "unnamed-measurement"


def _loss(s: Scenario) -> float:
    return s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-4 * s.omega


def _rub(s: Scenario) -> float:
    return 0.1 * _loss(s) * s.omega * amplitude(s)


def _magnet(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    """Its pull is felt over a small angle."""
    width = amplitude(s) * float(r.uniform(0.08, 0.3))
    return float(r.choice([-1, 1])) * 1e-4, {"magnet_width": width}


def _memory(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    """Friction that grows with the way from the last turning point."""
    p = float(r.uniform(0.3, 2.5))
    return _rub(s) / (2 * amplitude(s)) ** p, {"memory_power": p}


enter(
    *(RESTORING, "magnet near the centre", "magnet", _magnet),
    own=False,
    outside="magnet-near-centre",
)
enter(
    *(DAMPING, "rough spot off centre", "rough"),
    lambda r, s: (
        _rub(s),
        {
            "rough_place": amplitude(s) * float(r.choice([-1, 1]) * r.uniform(0.25, 0.7)),
            "rough_width": amplitude(s) * float(r.uniform(0.03, 0.12)),
        },
    ),
    own=False,
    outside="rough-spot",
)
# A motor's teeth.
enter(
    *(RESTORING, "cogging torque", "cogging"),
    lambda r, s: (
        1e-4 * amplitude(s),
        {
            "cogging_teeth": float(r.uniform(8, 25)) / amplitude(s),
            "cogging_phase": float(r.uniform(0, 2 * np.pi)),
        },
    ),
    own=False,
    outside="cogging-torque",
)
enter(
    *(DAMPING, "memory of the last turning point", "memory", _memory),
    own=False,
    outside="turning-point-memory",
)
enter(
    *(DAMPING, "damping periodic in time", "pulsed"),
    lambda r, s: (
        0.1 * _loss(s),
        {
            "pulsed_omega": 2 * np.pi / (s.span_s * float(r.uniform(0.08, 0.3))),
            "pulsed_phase": float(r.uniform(0, 2 * np.pi)),
        },
    ),
    own=False,
    outside="pulsed-damping",
)
enter(
    *(DAMPING, "kink of 1/Q", "kink"),
    lambda r, s: (
        _loss(s) / amplitude(s),
        {"kink_amplitude": amplitude(s) * float(r.uniform(0.5, 0.8))},
    ),
    own=False,
    outside="kinked-damping",
)


@outside("two-state-friction")
def telegraph(r: Random, s: Scenario) -> Hidden:
    """Friction that switches at random between two values."""
    flips = np.sort(r.uniform(0, s.span_s, int(r.integers(3, 9))))
    state = (np.searchsorted(flips, s.time_s[:-1]) % 2).astype(float)

    def build(base: Scenario, size: float) -> Scenario:
        return replace(base, motion=replace(base.motion, rubs_rad_s2=size * state))

    size = 0.05 * _loss(s) * s.omega * amplitude(s)
    return Hidden(DAMPING, "two-state friction", build, size, False, s, parameter="friction")


# A gain that ripples with the logarithm of the amplitude; a reading that lags more the wider the
# swing.
enter(
    *(READING, "log-periodic gain", "ripple"),
    lambda r, s: (1e-3, {"ripple_count": float(r.uniform(6, 14))}),
    chain=True,
    own=False,
    outside="rippled-gain",
)
enter(
    *(READING, "delay that grows with the swing", "delay_s_rad2"),
    lambda r, s: (float(r.choice([-1, 1])) * 1e-3 / s.omega / amplitude(s) ** 2, {}),
    chain=True,
    own=False,
    outside="swing-delay",
)


MEASUREMENT: Final = frozenset(
    {
        "sensor-quadratic",
        "sensor-cubic",
        "sensor-backlash",
        "offset-drift",
        "gain-drift",
        "ac-coupling",
        "tone-pickup",
        "clipping",
        "missing-codes",
        "coarse-quantisation",
        "clock-drift",
        "jitter",
        "dropped-samples",
        "glitches",
        "coloured-noise",
    }
)
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
