"""The numbers of one motion, by name: physical torques per moment of inertia.

Angles in rad, times in s. `x` is the angle, `v` its rate, `w` = omega. A zero switches the
term off (scales and exponents beside it then don't matter).
"""

from __future__ import annotations

from typing import Final

import numpy as np

PARAMETERS: Final = {
    # The free decay of the paper.
    "omega": 1.0,  # rad/s
    "gamma": 0.0,  # omega/Q_v, 1/s
    "coulomb": 0.0,  # f_c sgn v, rad/s^2
    "hysteretic": 0.0,  # f_h sqrt(w^2 x^2 + v^2) sgn v, 1/s
    "quadratic": 0.0,  # f_q (w^2 x^2 + v^2) sgn v, 1/rad
    # Restoring torque, all times w^2.
    "sine": 0.0,  # share of sin x in the place of x
    "cubic": 0.0,  # k3 x^3, 1/rad^2
    "square": 0.0,  # k2 x^2, 1/rad
    "stiffening": 0.0,  # flexure: x^3 at first, sinh in full, 1/rad^2
    "stiffening_scale": 0.5,  # rad
    "lopsided": 0.0,  # x^2 at first, exp in full, 1/rad
    "lopsided_scale": 0.5,  # rad
    "play": 0.0,  # half width of a dead zone, rad
    "magnet": 0.0,  # m x/(1 + (x/width)^2)^2
    "magnet_width": 0.02,  # rad
    "cogging": 0.0,  # rad
    "cogging_teeth": 40.0,
    "cogging_phase": 0.0,
    # Losses.
    "drag": 0.0,  # |v| v, 1/rad
    "power": 0.0,  # |v|^n sgn v
    "power_exponent": 1.5,
    "energy": 0.0,  # (w^2 x^2 + v^2)^lambda sgn v
    "energy_exponent": 0.75,
    "reynolds": 0.0,  # Schiller-Naumann drag: rate of its linear part, 1/s
    "reynolds_speed": 0.01,  # speed at which Re is 1, rad/s
    "rayleigh": 0.0,  # v^3, s/rad^2
    "van_der_pol": 0.0,  # x^2 v, 1/(s rad^2)
    "eddy": 0.0,  # brake whose magnet leaves its plate: rate at the centre, 1/s
    "eddy_width": 0.2,  # rad
    "stribeck": 0.0,  # rad/s^2
    "stribeck_speed": 0.05,  # rad/s
    "stribeck_power": 2.0,
    "dahl": 0.0,  # bristles' stiffness over w^2
    "dahl_reach": 0.01,  # deflection at which they slide, rad
    "bristle_damping": 0.0,  # LuGre: sigma_1, 1/s
    "bristle_stribeck": 0.0,  # LuGre: static over sliding friction, less 1
    "iwan": 0.0,  # four Dahl elements of several reaches (Iwan's model)
    "iwan_reach": 0.01,
    "basset": 0.0,  # half derivative of v, 1/sqrt(s)
    "shedding": 0.0,  # burst after each reversal above an amplitude
    "shedding_amplitude": 0.1,
    "shedding_power": 1.0,
    "maxwell": 0.0,  # relaxing springs' stiffness over w^2
    "maxwell_time": 10.0,  # s, of the fastest
    "rough": 0.0,  # friction on a spot, rad/s^2
    "rough_place": 0.05,
    "rough_width": 0.01,
    "memory": 0.0,  # friction that grows with |x - last turning point|^p
    "memory_power": 0.5,
    "pulsed": 0.0,  # damping that is periodic in time, 1/s
    "pulsed_omega": 1.0,
    "pulsed_phase": 0.0,
    "kink": 0.0,  # damping above an amplitude, 1/(s rad)
    "kink_amplitude": 0.1,
    # In time.
    "omega_drift": 0.0,  # relative, 1/s
    "omega_drift_time": 0.0,  # s; 0: straight
    "gamma_drift": 0.0,  # 1/s^2
    "gamma_drift_time": 0.0,
    "creep": 0.0,  # of the equilibrium, rad/s
    "creep_log": 0.0,  # rad
    "creep_log_time": 10.0,
    "rest_jump": 0.0,  # rad
    "rest_jump_at": 0.0,
    "omega_jump": 0.0,  # relative
    "omega_jump_at": 0.0,
    "gamma_jump": 0.0,  # 1/s
    "gamma_jump_at": 0.0,
    "release": 0.0,  # extra damping at the start, 1/s
    "release_finger": 0.0,  # extra friction at the start, rad/s^2
    "release_time": 2.0,  # s
    "impulse": 0.0,  # rad/s
    "impulse_at": 0.0,
    "impulse_width": 0.0,  # s; a half sine
    "scaling": 0.0,  # of x and v at one moment, relative
    "scaling_at": 0.0,
    "rub": 0.0,  # damping during a short time, 1/s
    "rub_at": 0.0,
    "rub_width": 1.0,
    # Drive and a second coordinate.
    "drive": 0.0,  # rad/s^2
    "drive_omega": 1.0,
    "drive_phase": 0.0,
    "second": 0.0,  # 1: the second coordinate moves
    "second_omega": 1.0,
    "second_gamma": 0.0,
    "coupling": 0.0,  # w^2 kappa u on x, and w^2 kappa x on u
    "inertial": 0.0,  # u is driven by -inertial x''
}
"""Every parameter with the value that it has when it is not spoken of."""

GROUPS: Final = {
    "any_restoring": (
        "play", "sine", "cubic", "square", "stiffening", "lopsided", "magnet", "cogging",
    ),
    "any_rate": (
        "gamma_drift", "gamma_jump", "release", "rub", "rayleigh", "van_der_pol", "eddy",
        "reynolds", "drag", "pulsed", "kink",
    ),
    "any_friction": (
        "energy", "power", "stribeck", "release_finger", "shedding", "rough", "memory",
    ),
    "any_time": ("creep", "creep_log", "rest_jump", "omega_drift", "omega_jump"),
    "any_push": ("drive", "impulse"),
    "any_hidden": ("dahl", "iwan", "maxwell", "basset"),
}  # fmt: skip
"""Terms of one kind, so that a whole kind which is absent is passed over at once."""

RECORD: Final = np.dtype([(name, np.float64) for name in (*PARAMETERS, *GROUPS)])

DAHL: Final = 2
IWAN: Final = 3
IWAN_ELEMENTS: Final = 4
MAXWELL: Final = IWAN + IWAN_ELEMENTS
MAXWELL_ELEMENTS: Final = 3
BASSET: Final = MAXWELL + MAXWELL_ELEMENTS
BASSET_ELEMENTS: Final = 12
SECOND: Final = BASSET + BASSET_ELEMENTS
STATES: Final = SECOND + 2
"""Where each hidden state stands behind x and v."""
