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
    outside,
    reading,
    torque,
)
from pendpipe_challenge.scenario import Scenario

Random = np.random.Generator
RESTORING, DAMPING = "unnamed-restoring", "unnamed-damping"
READING = "unnamed-measurement"


def _loss(s: Scenario) -> float:
    return s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-4 * s.omega


@outside("magnet-near-centre")
def magnet(r: Random, s: Scenario) -> Hidden:
    """A magnet under the rest position; its pull is felt over a small angle."""
    width = amplitude(s) * float(r.uniform(0.08, 0.3))
    return torque(
        s,
        RESTORING,
        "magnet near the centre",
        "magnet",
        float(r.choice([-1, 1])) * 1e-4,
        own=False,
        magnet_width=width,
    )


@outside("rough-spot")
def rough(r: Random, s: Scenario) -> Hidden:
    """A spot off centre that rubs."""
    a = amplitude(s)
    return torque(
        s,
        DAMPING,
        "rough spot off centre",
        "rough",
        0.1 * _loss(s) * s.omega * a,
        own=False,
        rough_place=a * float(r.choice([-1, 1]) * r.uniform(0.25, 0.7)),
        rough_width=a * float(r.uniform(0.03, 0.12)),
    )


@outside("cogging-torque")
def cogging(r: Random, s: Scenario) -> Hidden:
    """A motor's teeth."""
    a = amplitude(s)
    return torque(
        s,
        RESTORING,
        "cogging torque",
        "cogging",
        1e-4 * a,
        own=False,
        cogging_teeth=float(r.uniform(8, 25)) / a,
        cogging_phase=float(r.uniform(0, 2 * np.pi)),
    )


@outside("turning-point-memory")
def memory(r: Random, s: Scenario) -> Hidden:
    """Friction that grows with the way from the last turning point."""
    a, p = amplitude(s), float(r.uniform(0.3, 2.5))
    return torque(
        s,
        DAMPING,
        "memory of the last turning point",
        "memory",
        0.1 * _loss(s) * s.omega * a / (2 * a) ** p,
        own=False,
        memory_power=p,
    )


@outside("pulsed-damping")
def pulsed(r: Random, s: Scenario) -> Hidden:
    """Damping that comes and goes in time."""
    omega = 2 * np.pi / (s.span_s * float(r.uniform(0.08, 0.3)))
    return torque(
        s,
        DAMPING,
        "damping periodic in time",
        "pulsed",
        0.1 * _loss(s),
        own=False,
        pulsed_omega=omega,
        pulsed_phase=float(r.uniform(0, 2 * np.pi)),
    )


@outside("kinked-damping")
def kink(r: Random, s: Scenario) -> Hidden:
    """1/Q with a kink at one amplitude."""
    a = amplitude(s)
    return torque(
        s,
        DAMPING,
        "kink of 1/Q",
        "kink",
        _loss(s) / a,
        own=False,
        kink_amplitude=a * float(r.uniform(0.5, 0.8)),
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


@outside("rippled-gain")
def ripple(r: Random, s: Scenario) -> Hidden:
    """A gain that ripples with the logarithm of the amplitude."""
    return reading(
        s,
        READING,
        "log-periodic gain",
        "ripple",
        1e-3,
        own=False,
        ripple_count=float(r.uniform(6, 14)),
    )


@outside("swing-delay")
def delay(r: Random, s: Scenario) -> Hidden:
    """A reading that lags more the wider the swing."""
    return reading(
        s,
        READING,
        "delay that grows with the swing",
        "delay_s_rad2",
        float(r.choice([-1, 1])) * 1e-3 / s.omega / amplitude(s) ** 2,
        own=False,
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
