"""Hidden restoring torques and losses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pendpipe.challenge.hidden import (
    Hidden,
    amplitude,
    either_sign,
    from_rest,
    law,
    torque,
)
from pendpipe.challenge.scenario import Scenario

Random = np.random.Generator


def _bare(scenario: Scenario) -> Scenario:
    """Eq. 3 and nothing more, judged by the viscous baseline."""
    motion = scenario.motion
    gamma = motion.value("gamma") + 4.0 / np.pi * motion.value("hysteretic")
    gamma = max(gamma, 1e-4 * scenario.omega)
    plain = motion.changed(gamma=gamma, hysteretic=0.0, quadratic=0.0, coulomb=0.0)
    return replace(scenario, motion=plain, baseline="viscous")


def swung(scenario: Scenario, factor: float) -> Scenario:
    """The same pendulum from another amplitude, its losses' shares kept."""
    motion = scenario.motion
    return replace(
        scenario,
        motion=replace(
            motion.changed(
                coulomb=motion.value("coulomb") * factor,
                quadratic=motion.value("quadratic") / factor,
            ),
            angle_rad=motion.angle_rad * factor,
            rate_rad_s=motion.rate_rad_s * factor,
        ),
    )


@law("circular-error")
def circular(_: Random, s: Scenario) -> Hidden:
    """Sin x; it has no strength but the amplitude."""
    return Hidden(
        "circular-error",
        "sin x",
        lambda base, factor: swung(base, factor).with_motion(sine=1.0),
        0.03 / amplitude(s),
        True,
        s,
        base=swung,
        growth=6.0,
        largest=min(1.2, 0.9 * s.chain.range_volts / s.chain.volts_per_radian) / amplitude(s),
        parameter="amplitude_factor",
    )


@law("cubic-stiffness")
def cubic(r: Random, s: Scenario) -> Hidden:
    """k3 x^3."""
    size = either_sign(r) * 1e-3 / amplitude(s) ** 2
    return torque(s, "cubic-stiffness", "x^3", "cubic", size)


@law("cubic-stiffness")
def flexure(r: Random, s: Scenario) -> Hidden:
    """A flexure that stiffens as sinh."""
    a = amplitude(s)
    size, scale = 1e-3 / a**2, a * float(r.uniform(0.7, 1.5))
    return torque(s, "cubic-stiffness", "sinh flexure", "stiffening", size, own=False,
                  stiffening_scale=scale)  # fmt: skip


@law("quadratic-stiffness")
def square(r: Random, s: Scenario) -> Hidden:
    """k2 x^2."""
    return torque(s, "quadratic-stiffness", "x^2", "square", either_sign(r) * 3e-3 / amplitude(s))


@law("quadratic-stiffness")
def lopsided(r: Random, s: Scenario) -> Hidden:
    """A magnet on one side: exponential."""
    a = amplitude(s)
    found = torque(s, "quadratic-stiffness", "exponential", "lopsided",
                   either_sign(r) * 3e-3 / a, own=False,
                   lopsided_scale=a * float(r.uniform(1, 3)))  # fmt: skip
    # x^2 + x^3/(3 scale) + ...: the phase, which the odd part moves, is often the first to show.
    return replace(found, also=("cubic-stiffness",))


@law("coulomb-friction")
def coulomb(_: Random, s: Scenario) -> Hidden:
    """Constant friction, hidden from Eq. 3."""
    bare = _bare(s)
    size = 0.02 * bare.motion.value("gamma") * s.omega * amplitude(s)
    return torque(bare, "coulomb-friction", "sgn v", "coulomb", size)


@law("coulomb-friction")
def bristles(_: Random, s: Scenario) -> Hidden:
    """Bristles (LuGre) that slide almost at once."""
    bare, reach = _bare(s), 0.03 * amplitude(s)
    size = 0.02 * bare.motion.value("gamma") / s.omega * amplitude(s) / reach
    found = torque(bare, "coulomb-friction", "short bristles", "dahl", size, own=False,
                   dahl_reach=reach)  # fmt: skip
    return replace(found, also=("presliding-friction",))


@law("quadratic-drag")
def drag(_: Random, s: Scenario) -> Hidden:
    """True v|v|, hidden from Eq. 3."""
    bare = _bare(s)
    size = 0.02 * bare.motion.value("gamma") / s.omega / amplitude(s)
    return torque(bare, "quadratic-drag", "v|v|", "drag", size, own=False)


@law("quadratic-drag")
def energy_drag(_: Random, s: Scenario) -> Hidden:
    """Eq. 8's energy form, hidden from Eq. 3."""
    bare = _bare(s)
    size = 0.02 * bare.motion.value("gamma") / s.omega / amplitude(s)
    return torque(bare, "quadratic-drag", "Eq. 8", "quadratic", size)


@law("drag-form")
def form(_: Random, s: Scenario) -> Hidden:
    """v|v| where Eq. 8 has (w^2 x^2 + v^2) sgn v."""
    plain = s.with_motion(quadratic=0.0)
    size = 0.3 * (s.motion.value("gamma") + 1e-3 * s.omega) / s.omega / amplitude(s)
    return torque(plain, "drag-form", "v|v|", "drag", size)


@law("power-law-damping")
def power(r: Random, s: Scenario) -> Hidden:
    """|v|^n."""
    n = float(r.choice([r.uniform(0.35, 0.65), r.uniform(1.3, 1.7)]))
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega) * (s.omega * amplitude(s)) ** (1 - n)
    return torque(s, "power-law-damping", "|v|^n", "power", size, power_exponent=n)


@law("power-law-damping")
def energy(r: Random, s: Scenario) -> Hidden:
    """Eq. 9a with a free lambda."""
    exponent = float(r.choice([0.25, 0.75]) + r.uniform(-0.08, 0.08))
    top = s.omega * amplitude(s)
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega) * top ** (1 - 2 * exponent)
    return torque(s, "power-law-damping", "E^lambda", "energy", size, energy_exponent=exponent)


@law("power-law-damping")
def reynolds(r: Random, s: Scenario) -> Hidden:
    """A sphere's drag by C_D(Re), Schiller and Naumann."""
    speed = s.omega * amplitude(s) / float(np.exp(r.uniform(np.log(20), np.log(600))))
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega)
    return torque(s, "power-law-damping", "C_D(Re)", "reynolds", size, own=False,
                  reynolds_speed=speed)  # fmt: skip


@law("cubic-damping")
def rayleigh(_: Random, s: Scenario) -> Hidden:
    """v^3."""
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega) / (s.omega * amplitude(s)) ** 2
    return torque(s, "cubic-damping", "v^3", "rayleigh", size)


@law("cubic-damping")
def van_der_pol(_: Random, s: Scenario) -> Hidden:
    """x^2 v."""
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega) / amplitude(s) ** 2
    return torque(s, "cubic-damping", "x^2 v", "van_der_pol", size)


@law("cubic-damping")
def eddy(r: Random, s: Scenario) -> Hidden:
    """An eddy-current brake whose magnet leaves its plate."""
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega)
    width = amplitude(s) * float(r.uniform(1.2, 2.0))
    return torque(s, "cubic-damping", "brake's edge", "eddy", size, own=False, eddy_width=width)


def _stribeck(r: Random, s: Scenario, exponent: float, law_name: str, own: bool) -> Hidden:
    slow = s.omega * amplitude(s) * float(r.uniform(0.05, 0.3))
    size = 0.02 * (s.motion.value("gamma") + 1e-4 * s.omega) * s.omega * amplitude(s)
    return torque(s, "stribeck-friction", law_name, "stribeck", size, own=own,
                  stribeck_speed=slow, stribeck_power=exponent)  # fmt: skip


@law("stribeck-friction")
def stribeck(r: Random, s: Scenario) -> Hidden:
    """exp(-(v/v_s)^2)."""
    return _stribeck(r, s, 2.0, "Gaussian", True)


@law("stribeck-friction")
def stribeck_exponential(r: Random, s: Scenario) -> Hidden:
    """exp(-|v|/v_s)."""
    return _stribeck(r, s, 1.0, "exponential", False)


@law("presliding-friction")
def dahl(r: Random, s: Scenario) -> Hidden:
    """Dahl."""
    reach = amplitude(s) * float(r.uniform(0.1, 0.8))
    return torque(s, "presliding-friction", "Dahl", "dahl", 1e-4, dahl_reach=reach)


@law("presliding-friction")
def lugre(r: Random, s: Scenario) -> Hidden:
    """LuGre: bristles with damping and a static friction above the sliding one."""
    a = amplitude(s)
    reach, slow = a * float(r.uniform(0.1, 0.5)), s.omega * a * float(r.uniform(0.1, 0.4))

    def build(base: Scenario, strength: float) -> Scenario:
        return base.with_motion(
            dahl=strength, dahl_reach=reach, bristle_stribeck=0.3, stribeck_speed=slow,
            bristle_damping=0.1 * strength * base.omega,
        )  # fmt: skip

    return Hidden("presliding-friction", "LuGre", build, 1e-4, False, s, parameter="dahl",
                  details={"dahl_reach": reach, "stribeck_speed": slow})  # fmt: skip


@law("presliding-friction")
def iwan(r: Random, s: Scenario) -> Hidden:
    """Elements of several reaches."""
    reach = amplitude(s) * float(r.uniform(0.1, 0.5))
    return torque(s, "presliding-friction", "Iwan", "iwan", 1e-4, own=False, iwan_reach=reach)


@law("backlash")
def backlash(_: Random, s: Scenario) -> Hidden:
    """A dead zone in the restoring torque."""
    return torque(s, "backlash", "dead zone", "play", 1e-4 * amplitude(s))


@law("history-force")
def history(_: Random, s: Scenario) -> Hidden:
    """Basset's force after a release from rest."""
    return torque(from_rest(s), "history-force", "Basset", "basset", 1e-3)


@law("vortex-shedding")
def shedding(r: Random, s: Scenario) -> Hidden:
    """A burst of drag after each reversal above an amplitude."""
    a, exponent = amplitude(s), float(r.choice([0.5, 1.0, 1.5]))
    size = 0.1 * (s.motion.value("gamma") + 1e-4 * s.omega) * s.omega * a ** (1 - exponent)
    return torque(s, "vortex-shedding", "burst after reversal", "shedding", size, own=False,
                  shedding_amplitude=a * float(r.uniform(0.4, 0.8)), shedding_power=exponent,
                  )  # fmt: skip


@law("release-transient")
def release(r: Random, s: Scenario) -> Hidden:
    """Damping that dies away."""
    tau = 2 * np.pi / s.omega * float(r.uniform(1.0, 6.0))
    return torque(from_rest(s), "release-transient", "damping", "release", 0.01 / tau,
                  release_time=tau)  # fmt: skip


@law("release-transient")
def finger(r: Random, s: Scenario) -> Hidden:
    """A finger that rubs on the first swings."""
    tau = 2 * np.pi / s.omega * float(r.uniform(1.0, 4.0))
    size = 0.01 / tau * s.omega * amplitude(s)
    return torque(from_rest(s), "release-transient", "rubbing", "release_finger", size,
                  own=False, release_time=tau)  # fmt: skip
