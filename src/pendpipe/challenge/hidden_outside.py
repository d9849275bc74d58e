"""What no catalogue entry describes: the right answer is ``unnamed-...`` of the right kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pendpipe.challenge.hidden import Hidden, amplitude, outside, reading, torque
from pendpipe.challenge.scenario import Scenario

Random = np.random.Generator
RESTORING, DAMPING = "unnamed-restoring", "unnamed-damping"
MEASUREMENT = "unnamed-measurement"


def _loss(s: Scenario) -> float:
    return s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-4 * s.omega


@outside("magnet-near-centre")
def magnet(r: Random, s: Scenario) -> Hidden:
    """A magnet under the rest position; its pull is felt over a small angle."""
    width = amplitude(s) * float(r.uniform(0.08, 0.3))
    return torque(s, RESTORING, "magnet near the centre", "magnet",
                  float(r.choice([-1, 1])) * 1e-4, own=False, magnet_width=width)  # fmt: skip


@outside("rough-spot")
def rough(r: Random, s: Scenario) -> Hidden:
    """A spot off centre that rubs."""
    a = amplitude(s)
    return torque(s, DAMPING, "rough spot off centre", "rough", 0.1 * _loss(s) * s.omega * a,
                  own=False, rough_place=a * float(r.choice([-1, 1]) * r.uniform(0.25, 0.7)),
                  rough_width=a * float(r.uniform(0.03, 0.12)))  # fmt: skip


@outside("cogging-torque")
def cogging(r: Random, s: Scenario) -> Hidden:
    """A motor's teeth."""
    a = amplitude(s)
    return torque(s, RESTORING, "cogging torque", "cogging", 1e-4 * a, own=False,
                  cogging_teeth=float(r.uniform(8, 25)) / a,
                  cogging_phase=float(r.uniform(0, 2 * np.pi)))  # fmt: skip


@outside("turning-point-memory")
def memory(r: Random, s: Scenario) -> Hidden:
    """Friction that grows with the way from the last turning point."""
    a, p = amplitude(s), float(r.uniform(0.3, 2.5))
    return torque(s, DAMPING, "memory of the last turning point", "memory",
                  0.1 * _loss(s) * s.omega * a / (2 * a) ** p, own=False,
                  memory_power=p)  # fmt: skip


@outside("pulsed-damping")
def pulsed(r: Random, s: Scenario) -> Hidden:
    """Damping that comes and goes in time."""
    omega = 2 * np.pi / (s.span_s * float(r.uniform(0.08, 0.3)))
    return torque(s, DAMPING, "damping periodic in time", "pulsed", 0.1 * _loss(s), own=False,
                  pulsed_omega=omega, pulsed_phase=float(r.uniform(0, 2 * np.pi)))  # fmt: skip


@outside("kinked-damping")
def kink(r: Random, s: Scenario) -> Hidden:
    """1/Q with a kink at one amplitude."""
    a = amplitude(s)
    return torque(s, DAMPING, "kink of 1/Q", "kink", _loss(s) / a, own=False,
                  kink_amplitude=a * float(r.uniform(0.5, 0.8)))  # fmt: skip


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
    return reading(s, MEASUREMENT, "log-periodic gain", "ripple", 1e-3, own=False,
                   ripple_count=float(r.uniform(6, 14)))  # fmt: skip


@outside("swing-delay")
def delay(r: Random, s: Scenario) -> Hidden:
    """A reading that lags more the wider the swing."""
    return reading(s, MEASUREMENT, "delay that grows with the swing", "delay_s_rad2",
                   float(r.choice([-1, 1])) * 1e-3 / s.omega / amplitude(s) ** 2,
                   own=False)  # fmt: skip
