"""Hidden torques, losses, changes in time, pushes, and second coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pendpipe_challenge.hidden import Hidden, amplitude, either_sign, from_rest, law, moment, torque
from pendpipe_challenge.scenario import Scenario


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
    return torque(
        s, "cubic-stiffness", "sinh flexure", "stiffening", size, own=False, stiffening_scale=scale
    )


@law("quadratic-stiffness")
def square(r: Random, s: Scenario) -> Hidden:
    """k2 x^2."""
    return torque(s, "quadratic-stiffness", "x^2", "square", either_sign(r) * 3e-3 / amplitude(s))


@law("quadratic-stiffness")
def lopsided(r: Random, s: Scenario) -> Hidden:
    """A magnet on one side: exponential."""
    a = amplitude(s)
    found = torque(
        s,
        "quadratic-stiffness",
        "exponential",
        "lopsided",
        either_sign(r) * 3e-3 / a,
        own=False,
        lopsided_scale=a * float(r.uniform(1, 3)),
    )
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
    found = torque(
        bare, "coulomb-friction", "short bristles", "dahl", size, own=False, dahl_reach=reach
    )
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
    return torque(
        s, "power-law-damping", "C_D(Re)", "reynolds", size, own=False, reynolds_speed=speed
    )


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
    return torque(
        s,
        "stribeck-friction",
        law_name,
        "stribeck",
        size,
        own=own,
        stribeck_speed=slow,
        stribeck_power=exponent,
    )


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
    return torque(
        s,
        "vortex-shedding",
        "burst after reversal",
        "shedding",
        size,
        own=False,
        shedding_amplitude=a * float(r.uniform(0.4, 0.8)),
        shedding_power=exponent,
    )


@law("release-transient")
def release(r: Random, s: Scenario) -> Hidden:
    """Damping that dies away."""
    tau = 2 * np.pi / s.omega * float(r.uniform(1.0, 6.0))
    return torque(
        from_rest(s), "release-transient", "damping", "release", 0.01 / tau, release_time=tau
    )


@law("release-transient")
def finger(r: Random, s: Scenario) -> Hidden:
    """A finger that rubs on the first swings."""
    tau = 2 * np.pi / s.omega * float(r.uniform(1.0, 4.0))
    size = 0.01 / tau * s.omega * amplitude(s)
    return torque(
        from_rest(s),
        "release-transient",
        "rubbing",
        "release_finger",
        size,
        own=False,
        release_time=tau,
    )


Random = np.random.Generator


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


@law("plane-coupling")
def coupled(r: Random, s: Scenario) -> Hidden:
    """Swing flows into the other plane and back."""
    detuning = _beat(r, s)
    loss = s.motion.value("gamma") + 4 / np.pi * s.motion.value("hysteretic")
    omega = s.omega * (1.0 + detuning)
    found = torque(
        s,
        "plane-coupling",
        "coupled planes",
        "coupling",
        0.1 * abs(detuning),
        own=False,
        second=1.0,
        second_omega=omega,
        second_gamma=loss,
    )
    return replace(found, growth=4.0, details={"detuning": detuning})


@law("periodic-drive")
def drive(r: Random, s: Scenario) -> Hidden:
    """A fan, a building."""
    ratio = float(r.choice([r.uniform(0.3, 0.8), r.uniform(1.2, 3.5)]))
    omega = min(ratio * s.omega, 0.8 * np.pi / s.interval_s)
    return torque(
        s,
        "periodic-drive",
        "cosine",
        "drive",
        s.sd_rad * s.omega**2,
        drive_omega=omega,
        drive_phase=float(r.uniform(0, 2 * np.pi)),
    )


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


def _drift_time(r: Random, s: Scenario, straight: bool) -> float:
    return 0.0 if straight else float(r.uniform(0.15, 0.5)) * s.span_s


def _frequency_drift(r: Random, s: Scenario, straight: bool) -> Hidden:
    return torque(
        s,
        "frequency-drift",
        "straight" if straight else "relaxing",
        "omega_drift",
        either_sign(r) * 1e-4 / s.span_s,
        omega_drift_time=_drift_time(r, s, straight),
    )


@law("frequency-drift")
def frequency_drift(r: Random, s: Scenario) -> Hidden:
    """Straight."""
    return _frequency_drift(r, s, True)


@law("frequency-drift")
def frequency_relaxing(r: Random, s: Scenario) -> Hidden:
    """A rod that warms up."""
    return _frequency_drift(r, s, False)


def _damping_drift(r: Random, s: Scenario, straight: bool) -> Hidden:
    loss = s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-5 * s.omega
    return torque(
        s,
        "damping-drift",
        "straight" if straight else "relaxing",
        "gamma_drift",
        either_sign(r) * 0.05 * loss / s.span_s,
        gamma_drift_time=_drift_time(r, s, straight),
    )


@law("damping-drift")
def damping_drift(r: Random, s: Scenario) -> Hidden:
    """Straight."""
    return _damping_drift(r, s, True)


@law("damping-drift")
def damping_relaxing(r: Random, s: Scenario) -> Hidden:
    """A bearing that warms up."""
    return _damping_drift(r, s, False)


@law("equilibrium-creep")
def creep(r: Random, s: Scenario) -> Hidden:
    """Secondary creep."""
    return torque(s, "equilibrium-creep", "straight", "creep", either_sign(r) * s.sd_rad / s.span_s)


@law("equilibrium-creep")
def creep_log(r: Random, s: Scenario) -> Hidden:
    """Primary creep, logarithmic."""
    tau = float(r.uniform(0.02, 0.1)) * s.span_s
    return torque(
        s,
        "equilibrium-creep",
        "logarithmic",
        "creep_log",
        either_sign(r) * s.sd_rad,
        creep_log_time=tau,
    )


@law("equilibrium-creep")
def anelastic(r: Random, s: Scenario) -> Hidden:
    """Springs that relax after the pendulum was held aside (Maxwell elements)."""
    start = from_rest(s)
    held = replace(start, motion=replace(start.motion, held_rad=start.motion.angle_rad))
    tau = float(r.uniform(0.03, 0.1)) * s.span_s
    return torque(
        held,
        "equilibrium-creep",
        "Maxwell elements",
        "maxwell",
        s.sd_rad / amplitude(s),
        own=False,
        maxwell_time=tau,
    )


@law("equilibrium-step")
def rest_jump(r: Random, s: Scenario) -> Hidden:
    """A mesoanelastic jump."""
    return torque(
        s,
        "equilibrium-step",
        "jump",
        "rest_jump",
        either_sign(r) * s.sd_rad,
        rest_jump_at=moment(r, s, 0.15, 0.85),
    )


@law("amplitude-step")
def scaled(r: Random, s: Scenario) -> Hidden:
    """A loss in an instant."""
    return torque(
        s, "amplitude-step", "instant", "scaling", -1e-3, scaling_at=moment(r, s, 0.1, 0.8)
    )


@law("amplitude-step")
def rubbed(r: Random, s: Scenario) -> Hidden:
    """A touch that lasts a swing or two."""
    width = float(r.uniform(0.3, 2.0)) * 2 * np.pi / s.omega
    return torque(
        s,
        "amplitude-step",
        "a touch",
        "rub",
        1e-3 / width,
        own=False,
        rub_at=moment(r, s, 0.1, 0.8),
        rub_width=width,
    )


@law("frequency-step")
def omega_jump(r: Random, s: Scenario) -> Hidden:
    """A flexure that finds another seat."""
    return torque(
        s,
        "frequency-step",
        "jump",
        "omega_jump",
        either_sign(r) * 1e-5,
        omega_jump_at=moment(r, s, 0.15, 0.8),
    )


@law("damping-step")
def gamma_jump(r: Random, s: Scenario) -> Hidden:
    """A bubble leaves, a rub sets in."""
    loss = s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-5 * s.omega
    return torque(
        s, "damping-step", "jump", "gamma_jump", 0.05 * loss, gamma_jump_at=moment(r, s, 0.15, 0.8)
    )


def _impulse(r: Random, s: Scenario, width: float, name: str) -> Hidden:
    size = either_sign(r) * s.sd_rad * s.omega
    return torque(
        s,
        "impulse",
        name,
        "impulse",
        size,
        own=width == 0.0,
        impulse_at=moment(r, s, 0.1, 0.85),
        impulse_width=width,
    )


@law("impulse")
def knock(r: Random, s: Scenario) -> Hidden:
    """Sudden."""
    return _impulse(r, s, 0.0, "sudden")


@law("impulse")
def pushed(r: Random, s: Scenario) -> Hidden:
    """A push that lasts a part of a swing."""
    return _impulse(r, s, float(r.uniform(0.05, 0.3)) * 2 * np.pi / s.omega, "half sine")
