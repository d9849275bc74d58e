"""Hidden torques, losses, changes in time, pushes, and second coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pendpipe_challenge.hidden import (
    Hidden,
    amplitude,
    either_sign,
    enter,
    from_rest,
    law,
    moment,
)
from pendpipe_challenge.scenario import Scenario

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


def _viscous(s: Scenario) -> float:
    """Rate to which effects are set, where there may be no viscous loss."""
    return s.motion.value("gamma") + 1e-4 * s.omega


def _top(s: Scenario) -> float:
    """The first speed."""
    return s.omega * amplitude(s)


enter(
    *("cubic-stiffness", "x^3", "cubic"),
    lambda r, s: (either_sign(r) * 1e-3 / amplitude(s) ** 2, {}),
)
# A flexure.
enter(
    *("cubic-stiffness", "sinh flexure", "stiffening"),
    lambda r, s: (
        1e-3 / amplitude(s) ** 2,
        {"stiffening_scale": amplitude(s) * float(r.uniform(0.7, 1.5))},
    ),
    own=False,
)
enter(
    *("quadratic-stiffness", "x^2", "square"),
    lambda r, s: (either_sign(r) * 3e-3 / amplitude(s), {}),
)
# A magnet on one side, x^2 + x^3/(3 scale) + ...: the phase, which the odd part moves, is often the
# first to show.
enter(
    *("quadratic-stiffness", "exponential", "lopsided"),
    lambda r, s: (
        either_sign(r) * 3e-3 / amplitude(s),
        {"lopsided_scale": amplitude(s) * float(r.uniform(1, 3))},
    ),
    own=False,
    also=("cubic-stiffness",),
)
# These are hidden from Eq. 3.
enter(
    *("coulomb-friction", "sgn v", "coulomb"),
    lambda r, s: (0.02 * _bare(s).motion.value("gamma") * s.omega * amplitude(s), {}),
    prepare=_bare,
)
enter(
    *("coulomb-friction", "short bristles", "dahl"),
    lambda r, s: (
        0.02 * _bare(s).motion.value("gamma") / s.omega * amplitude(s) / (0.03 * amplitude(s)),
        {"dahl_reach": 0.03 * amplitude(s)},
    ),
    own=False,
    prepare=_bare,
    also=("presliding-friction",),
)
enter(
    *("quadratic-drag", "v|v|", "drag"),
    lambda r, s: (0.02 * _bare(s).motion.value("gamma") / s.omega / amplitude(s), {}),
    own=False,
    prepare=_bare,
)
enter(
    *("quadratic-drag", "Eq. 8", "quadratic"),
    lambda r, s: (0.02 * _bare(s).motion.value("gamma") / s.omega / amplitude(s), {}),
    prepare=_bare,
)
enter(
    *("drag-form", "v|v|", "drag"),
    lambda r, s: (
        0.3 * (s.motion.value("gamma") + 1e-3 * s.omega) / s.omega / amplitude(s),
        {},
    ),
    prepare=lambda s: s.with_motion(quadratic=0.0),
)


def _power(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    n = float(r.choice([r.uniform(0.35, 0.65), r.uniform(1.3, 1.7)]))
    return 0.1 * _viscous(s) * _top(s) ** (1 - n), {"power_exponent": n}


def _energy(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    exponent = float(r.choice([0.25, 0.75]) + r.uniform(-0.08, 0.08))
    return 0.1 * _viscous(s) * _top(s) ** (1 - 2 * exponent), {"energy_exponent": exponent}


enter("power-law-damping", "|v|^n", "power", _power)
enter("power-law-damping", "E^lambda", "energy", _energy)
# A sphere, by Schiller and Naumann.
enter(
    *("power-law-damping", "C_D(Re)", "reynolds"),
    lambda r, s: (
        0.1 * _viscous(s),
        {"reynolds_speed": _top(s) / float(np.exp(r.uniform(np.log(20), np.log(600))))},
    ),
    own=False,
)
enter(
    *("cubic-damping", "v^3", "rayleigh"),
    lambda r, s: (0.1 * _viscous(s) / _top(s) ** 2, {}),
)
enter(
    *("cubic-damping", "x^2 v", "van_der_pol"),
    lambda r, s: (0.1 * _viscous(s) / amplitude(s) ** 2, {}),
)
# An eddy-current brake whose magnet leaves its plate.
enter(
    *("cubic-damping", "brake's edge", "eddy"),
    lambda r, s: (0.1 * _viscous(s), {"eddy_width": amplitude(s) * float(r.uniform(1.2, 2.0))}),
    own=False,
)
for _law, _power_of_v in (("Gaussian", 2.0), ("exponential", 1.0)):
    enter(
        *("stribeck-friction", _law, "stribeck"),
        lambda r, s, power=_power_of_v: (  # type: ignore[misc]
            0.02 * _viscous(s) * s.omega * amplitude(s),
            {
                "stribeck_speed": s.omega * amplitude(s) * float(r.uniform(0.05, 0.3)),
                "stribeck_power": power,
            },
        ),
        own=_law == "Gaussian",
    )
enter(
    *("presliding-friction", "Dahl", "dahl"),
    lambda r, s: (1e-4, {"dahl_reach": amplitude(s) * float(r.uniform(0.1, 0.8))}),
)


@law("presliding-friction")
def lugre(r: Random, s: Scenario) -> Hidden:
    """LuGre: bristles with damping and a static friction above the sliding one."""
    a = amplitude(s)
    reach, slow = a * float(r.uniform(0.1, 0.5)), s.omega * a * float(r.uniform(0.1, 0.4))

    def build(base: Scenario, strength: float) -> Scenario:
        return base.with_motion(
            dahl=strength,
            dahl_reach=reach,
            bristle_stribeck=0.3,
            stribeck_speed=slow,
            bristle_damping=0.1 * strength * base.omega,
        )

    return Hidden(
        "presliding-friction",
        "LuGre",
        build,
        1e-4,
        False,
        s,
        parameter="dahl",
        details={"dahl_reach": reach, "stribeck_speed": slow},
    )


# Elements of several reaches.
enter(
    *("presliding-friction", "Iwan", "iwan"),
    lambda r, s: (1e-4, {"iwan_reach": amplitude(s) * float(r.uniform(0.1, 0.5))}),
    own=False,
)
enter("backlash", "dead zone", "play", lambda r, s: (1e-4 * amplitude(s), {}))
enter("history-force", "Basset", "basset", lambda r, s: (1e-3, {}), prepare=from_rest)


def _shedding(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    a, exponent = amplitude(s), float(r.choice([0.5, 1.0, 1.5]))
    size = 0.1 * _viscous(s) * s.omega * a ** (1 - exponent)
    above = a * float(r.uniform(0.4, 0.8))
    return size, {"shedding_amplitude": above, "shedding_power": exponent}


def _release(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    tau = 2 * np.pi / s.omega * float(r.uniform(1.0, 6.0))
    return 0.01 / tau, {"release_time": tau}


def _finger(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    tau = 2 * np.pi / s.omega * float(r.uniform(1.0, 4.0))
    return 0.01 / tau * s.omega * amplitude(s), {"release_time": tau}


# A burst of drag after each reversal above an amplitude.
enter("vortex-shedding", "burst after reversal", "shedding", _shedding, own=False)
enter("release-transient", "damping", "release", _release, prepare=from_rest)
# A finger that rubs on the first swings.
enter(*("release-transient", "rubbing", "release_finger", _finger), own=False, prepare=from_rest)


@law("second-mode")
def second_mode(r: Random, s: Scenario) -> Hidden:
    """A quick mode of the rod, seen by the sensor and dying out."""
    nyquist = np.pi / s.interval_s
    omega = float(min(s.omega * np.exp(r.uniform(np.log(3), np.log(12))), 0.8 * nyquist))
    tau = 2 * np.pi / s.omega * float(r.uniform(5.0, 30.0))
    phase = float(r.uniform(0, 2 * np.pi))

    def build(base: Scenario, size: float) -> Scenario:
        motion = replace(
            base.motion,
            second_rad=size * np.cos(phase),
            second_rate_rad_s=-size * omega * np.sin(phase),
        ).changed(second=1.0, second_omega=omega, second_gamma=2.0 / tau)
        return replace(base, motion=motion).with_chain(second_share=1.0)

    return Hidden(
        "second-mode",
        "ringing",
        build,
        s.sd_rad,
        True,
        s,
        parameter="amplitude_rad",
        details={"frequency_hz": omega / 2 / np.pi, "decay_s": tau},
    )


@law("second-mode")
def rocking(r: Random, s: Scenario) -> Hidden:
    """A bob that rocks, set off at the release by the pendulum's own acceleration."""
    nyquist = np.pi / s.interval_s
    omega = float(min(s.omega * r.uniform(3.0, 8.0), 0.8 * nyquist))
    tau = 2 * np.pi / s.omega * float(r.uniform(5.0, 30.0))

    def build(base: Scenario, size: float) -> Scenario:
        base = base.with_motion(
            second=1.0, second_omega=omega, second_gamma=2.0 / tau, inertial=1.0
        )
        return base.with_chain(second_share=size)

    return Hidden(
        "second-mode",
        "rocking",
        build,
        1e-3,
        False,
        from_rest(s),
        parameter="share",
        details={"frequency_hz": omega / 2 / np.pi},
    )


def _beat(r: Random, s: Scenario) -> float:
    """Detuning of a beat that the record can show, relative."""
    beats = float(r.uniform(0.7, 5.0))
    return either_sign(r) * 2 * np.pi * beats / s.span_s / s.omega


@law("plane-coupling")
def crossed(r: Random, s: Scenario) -> Hidden:
    """The sensor lies askew to the two principal axes of the suspension."""
    detuning = _beat(r, s)
    motion, phase = s.motion, float(r.uniform(0, 2 * np.pi))
    loss = motion.value("gamma") + 4 / np.pi * motion.value("hysteretic")

    def build(base: Scenario, size: float) -> Scenario:
        omega = base.omega * (1.0 + detuning)
        moved = replace(
            base.motion,
            second_rad=size * np.cos(phase),
            second_rate_rad_s=-size * omega * np.sin(phase),
        ).changed(second=1.0, second_omega=omega, second_gamma=loss)
        return replace(base, motion=moved).with_chain(second_share=1.0)

    return Hidden(
        "plane-coupling",
        "askew sensor",
        build,
        s.sd_rad,
        True,
        s,
        parameter="amplitude_rad",
        details={"detuning": detuning},
    )


def _coupled(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    """Swing flows into the other plane and back."""
    detuning = _beat(r, s)
    loss = s.motion.value("gamma") + 4 / np.pi * s.motion.value("hysteretic")
    omega = s.omega * (1.0 + detuning)
    return 0.1 * abs(detuning), {"second": 1.0, "second_omega": omega, "second_gamma": loss}


def _drive(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    """A fan, a building."""
    ratio = float(r.choice([r.uniform(0.3, 0.8), r.uniform(1.2, 3.5)]))
    omega = min(ratio * s.omega, 0.8 * np.pi / s.interval_s)
    phase = float(r.uniform(0, 2 * np.pi))
    return s.sd_rad * s.omega**2, {"drive_omega": omega, "drive_phase": phase}


enter("plane-coupling", "coupled planes", "coupling", _coupled, own=False, growth=4.0)
enter("periodic-drive", "cosine", "drive", _drive)


@law("broadband-drive")
def broadband(r: Random, s: Scenario) -> Hidden:
    """White acceleration: a random change of v in each sampling interval."""
    unit = r.standard_normal(s.samples - 1)

    def build(base: Scenario, density: float) -> Scenario:
        # One-sided density S: the change of v in dt has the variance S dt/2.
        kicks = np.sqrt(0.5 * density**2 * base.interval_s) * unit
        return replace(base, motion=replace(base.motion, kicks_rad_s=kicks))

    scale = 2.0 * s.sd_rad * s.omega / np.sqrt(s.span_s)
    return Hidden(
        "broadband-drive", "white", build, scale, True, s, sized="process", parameter="root_density"
    )


def _loss(s: Scenario) -> float:
    return s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-5 * s.omega


for _law in ("straight", "relaxing"):
    # A rod, a bearing that warm up.
    enter(
        *("frequency-drift", _law, "omega_drift"),
        lambda r, s, law=_law: (  # type: ignore[misc]
            either_sign(r) * 1e-4 / s.span_s,
            {
                "omega_drift_time": 0.0
                if law == "straight"
                else float(r.uniform(0.15, 0.5)) * s.span_s
            },
        ),
    )
for _law in ("straight", "relaxing"):
    enter(
        *("damping-drift", _law, "gamma_drift"),
        lambda r, s, law=_law: (  # type: ignore[misc]
            either_sign(r) * 0.05 * _loss(s) / s.span_s,
            {
                "gamma_drift_time": 0.0
                if law == "straight"
                else float(r.uniform(0.15, 0.5)) * s.span_s
            },
        ),
    )
enter(
    *("equilibrium-creep", "straight", "creep"),
    lambda r, s: (either_sign(r) * s.sd_rad / s.span_s, {}),
)


def _creep_log(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    """Primary creep."""
    tau = float(r.uniform(0.02, 0.1)) * s.span_s
    return either_sign(r) * s.sd_rad, {"creep_log_time": tau}


enter("equilibrium-creep", "logarithmic", "creep_log", _creep_log)


def _held(s: Scenario) -> Scenario:
    start = from_rest(s)
    return replace(start, motion=replace(start.motion, held_rad=start.motion.angle_rad))


# Springs that relax after the pendulum was held aside.
enter(
    *("equilibrium-creep", "Maxwell elements", "maxwell"),
    lambda r, s: (
        s.sd_rad / amplitude(s),
        {"maxwell_time": float(r.uniform(0.03, 0.1)) * s.span_s},
    ),
    own=False,
    prepare=_held,
)
# A mesoanelastic jump.
enter(
    *("equilibrium-step", "jump", "rest_jump"),
    lambda r, s: (either_sign(r) * s.sd_rad, {"rest_jump_at": moment(r, s, 0.15, 0.85)}),
)
enter(
    *("amplitude-step", "instant", "scaling"),
    lambda r, s: (-1e-3, {"scaling_at": moment(r, s, 0.1, 0.8)}),
)


def _touch(r: Random, s: Scenario) -> tuple[float, dict[str, float]]:
    width = float(r.uniform(0.3, 2.0)) * 2 * np.pi / s.omega
    return 1e-3 / width, {"rub_at": moment(r, s, 0.1, 0.8), "rub_width": width}


# A swing or two.
enter("amplitude-step", "a touch", "rub", _touch, own=False)
# A flexure finds another seat; a bubble leaves, a rub sets in.
enter(
    *("frequency-step", "jump", "omega_jump"),
    lambda r, s: (either_sign(r) * 1e-5, {"omega_jump_at": moment(r, s, 0.15, 0.8)}),
)
enter(
    *("damping-step", "jump", "gamma_jump"),
    lambda r, s: (0.05 * _loss(s), {"gamma_jump_at": moment(r, s, 0.15, 0.8)}),
)


def _knock(r: Random, s: Scenario, width: float) -> tuple[float, dict[str, float]]:
    size = either_sign(r) * s.sd_rad * s.omega
    return size, {"impulse_at": moment(r, s, 0.1, 0.85), "impulse_width": width}


enter("impulse", "sudden", "impulse", lambda r, s: _knock(r, s, 0.0))
# It lasts a part of a swing.
enter(
    *("impulse", "half sine", "impulse"),
    lambda r, s: _knock(r, s, float(r.uniform(0.05, 0.3)) * 2 * np.pi / s.omega),
    own=False,
)
