"""Hidden changes in time, pushes, and second coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pendpipe.challenge.hidden import (
    Hidden,
    amplitude,
    either_sign,
    from_rest,
    law,
    moment,
    torque,
)
from pendpipe.challenge.scenario import Scenario

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
            base.motion, second_rad=size * np.cos(phase),
            second_rate_rad_s=-size * omega * np.sin(phase),
        ).changed(second=1.0, second_omega=omega, second_gamma=2.0 / tau)  # fmt: skip
        return replace(base, motion=motion).with_chain(second_share=1.0)

    return Hidden("second-mode", "ringing", build, s.sd_rad, True, s, parameter="amplitude_rad",
                  details={"frequency_hz": omega / 2 / np.pi, "decay_s": tau})  # fmt: skip


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

    return Hidden("second-mode", "rocking", build, 1e-3, False, from_rest(s),
                  parameter="share", details={"frequency_hz": omega / 2 / np.pi})  # fmt: skip


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
            base.motion, second_rad=size * np.cos(phase),
            second_rate_rad_s=-size * omega * np.sin(phase),
        ).changed(second=1.0, second_omega=omega, second_gamma=loss)  # fmt: skip
        return replace(base, motion=moved).with_chain(second_share=1.0)

    return Hidden("plane-coupling", "askew sensor", build, s.sd_rad, True, s,
                  parameter="amplitude_rad", details={"detuning": detuning})  # fmt: skip


@law("plane-coupling")
def coupled(r: Random, s: Scenario) -> Hidden:
    """Swing flows into the other plane and back."""
    detuning = _beat(r, s)
    loss = s.motion.value("gamma") + 4 / np.pi * s.motion.value("hysteretic")
    omega = s.omega * (1.0 + detuning)
    found = torque(s, "plane-coupling", "coupled planes", "coupling", 0.1 * abs(detuning),
                   own=False, second=1.0, second_omega=omega, second_gamma=loss)  # fmt: skip
    return replace(found, growth=4.0, details={"detuning": detuning})


@law("periodic-drive")
def drive(r: Random, s: Scenario) -> Hidden:
    """A fan, a building."""
    ratio = float(r.choice([r.uniform(0.3, 0.8), r.uniform(1.2, 3.5)]))
    omega = min(ratio * s.omega, 0.8 * np.pi / s.interval_s)
    return torque(s, "periodic-drive", "cosine", "drive", s.sd_rad * s.omega**2,
                  drive_omega=omega, drive_phase=float(r.uniform(0, 2 * np.pi)))  # fmt: skip


@law("broadband-drive")
def broadband(r: Random, s: Scenario) -> Hidden:
    """White acceleration: a random change of v in each sampling interval."""
    unit = r.standard_normal(s.samples - 1)

    def build(base: Scenario, density: float) -> Scenario:
        # One-sided density S: the change of v in dt has the variance S dt/2.
        kicks = np.sqrt(0.5 * density**2 * base.interval_s) * unit
        return replace(base, motion=replace(base.motion, kicks_rad_s=kicks))

    scale = 2.0 * s.sd_rad * s.omega / np.sqrt(s.span_s)
    return Hidden("broadband-drive", "white", build, scale, True, s, sized="process",
                  parameter="root_density")  # fmt: skip


def _drift_time(r: Random, s: Scenario, straight: bool) -> float:
    return 0.0 if straight else float(r.uniform(0.15, 0.5)) * s.span_s


def _frequency_drift(r: Random, s: Scenario, straight: bool) -> Hidden:
    return torque(s, "frequency-drift", "straight" if straight else "relaxing", "omega_drift",
                  either_sign(r) * 1e-4 / s.span_s,
                  omega_drift_time=_drift_time(r, s, straight))  # fmt: skip


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
    return torque(s, "damping-drift", "straight" if straight else "relaxing", "gamma_drift",
                  either_sign(r) * 0.05 * loss / s.span_s,
                  gamma_drift_time=_drift_time(r, s, straight))  # fmt: skip


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
    return torque(s, "equilibrium-creep", "straight", "creep",
                  either_sign(r) * s.sd_rad / s.span_s)  # fmt: skip


@law("equilibrium-creep")
def creep_log(r: Random, s: Scenario) -> Hidden:
    """Primary creep, logarithmic."""
    tau = float(r.uniform(0.02, 0.1)) * s.span_s
    return torque(s, "equilibrium-creep", "logarithmic", "creep_log",
                  either_sign(r) * s.sd_rad, creep_log_time=tau)  # fmt: skip


@law("equilibrium-creep")
def anelastic(r: Random, s: Scenario) -> Hidden:
    """Springs that relax after the pendulum was held aside (Maxwell elements)."""
    start = from_rest(s)
    held = replace(start, motion=replace(start.motion, held_rad=start.motion.angle_rad))
    tau = float(r.uniform(0.03, 0.1)) * s.span_s
    return torque(held, "equilibrium-creep", "Maxwell elements", "maxwell",
                  s.sd_rad / amplitude(s), own=False, maxwell_time=tau)  # fmt: skip


@law("equilibrium-step")
def rest_jump(r: Random, s: Scenario) -> Hidden:
    """A mesoanelastic jump."""
    return torque(s, "equilibrium-step", "jump", "rest_jump", either_sign(r) * s.sd_rad,
                  rest_jump_at=moment(r, s, 0.15, 0.85))  # fmt: skip


@law("amplitude-step")
def scaled(r: Random, s: Scenario) -> Hidden:
    """A loss in an instant."""
    return torque(s, "amplitude-step", "instant", "scaling", -1e-3,
                  scaling_at=moment(r, s, 0.1, 0.8))  # fmt: skip


@law("amplitude-step")
def rubbed(r: Random, s: Scenario) -> Hidden:
    """A touch that lasts a swing or two."""
    width = float(r.uniform(0.3, 2.0)) * 2 * np.pi / s.omega
    return torque(s, "amplitude-step", "a touch", "rub", 1e-3 / width, own=False,
                  rub_at=moment(r, s, 0.1, 0.8), rub_width=width)  # fmt: skip


@law("frequency-step")
def omega_jump(r: Random, s: Scenario) -> Hidden:
    """A flexure that finds another seat."""
    return torque(s, "frequency-step", "jump", "omega_jump", either_sign(r) * 1e-5,
                  omega_jump_at=moment(r, s, 0.15, 0.8))  # fmt: skip


@law("damping-step")
def gamma_jump(r: Random, s: Scenario) -> Hidden:
    """A bubble leaves, a rub sets in."""
    loss = s.motion.value("gamma") + s.motion.value("hysteretic") + 1e-5 * s.omega
    return torque(s, "damping-step", "jump", "gamma_jump", 0.05 * loss,
                  gamma_jump_at=moment(r, s, 0.15, 0.8))  # fmt: skip


def _impulse(r: Random, s: Scenario, width: float, name: str) -> Hidden:
    size = either_sign(r) * s.sd_rad * s.omega
    return torque(s, "impulse", name, "impulse", size, own=width == 0.0,
                  impulse_at=moment(r, s, 0.1, 0.85), impulse_width=width)  # fmt: skip


@law("impulse")
def knock(r: Random, s: Scenario) -> Hidden:
    """Sudden."""
    return _impulse(r, s, 0.0, "sudden")


@law("impulse")
def pushed(r: Random, s: Scenario) -> Hidden:
    """A push that lasts a part of a swing."""
    return _impulse(r, s, float(r.uniform(0.05, 0.3)) * 2 * np.pi / s.omega, "half sine")
