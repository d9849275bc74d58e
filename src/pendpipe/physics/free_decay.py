"""A free decay in a fluid that remembers: the root of its equation of motion, and small drags."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pendpipe.physics._floats import FloatArray, Numbers, equation, floats

_ROUNDS: Final = 50
_NODES: Final = np.linspace(0.0, 8.0, 161)
"""Of the trapezoidal rule over t in exp(-x cosh t): it converges exponentially."""


def free_decay_root(
    inertia_kg_m2: Numbers, steady: Numbers, history: Numbers, torque_n_m_per_rad: Numbers
) -> npt.NDArray[np.complex128]:
    """Complex rate s of a free decay ``exp(s t)``, damped by Stokes' drag with its memory.

    The root with positive imaginary part of ``I s^2 + D1 s + D2 s^(3/2) + K = 0``. A harmonic
    motion, s = i omega, would meet the drag of Eq. 2 and the added mass of
    `added_mass_coefficient`; a decay meets a little more drag: to first order
    ``-Re s = D/(2 (I_all - I_layer/4))`` with D the drag of Eq. 16, I_all the inertia with all
    added mass and I_layer that of the boundary layer, ``D2/sqrt(2 omega)``.

    Parameters
    ----------
    inertia_kg_m2
        I of the solid and of the potential flow, kg m^2.
    steady, history
        D1 in N m s, ``6 pi eta a L^2`` of a sphere, and D2 in N m s^(3/2),
        ``6 pi a^2 sqrt(rho eta) L^2``.
    torque_n_m_per_rad
        K, positive.

    Returns
    -------
    complex array
        s in 1/s: the decay rate b is -Re s, Eq. 8's angular frequency is abs(s).

    Examples
    --------
    >>> s = free_decay_root(1.0, 0.02, 0.0, 4.0)  # without memory: -D/(2 I), omega^2 = K/I
    >>> round(float(-s.real), 12), round(float(abs(s)), 12)
    (0.01, 2.0)
    """
    inertia, linear, memory, torque = floats(inertia_kg_m2, steady, history, torque_n_m_per_rad)
    root = 1j * np.sqrt(torque / (inertia + 0.0 * (linear + memory)))
    for _ in range(_ROUNDS):
        half = np.sqrt(root)
        value = inertia * root**2 + linear * root + memory * root * half + torque
        step = value / (2.0 * inertia * root + linear + 1.5 * memory * half)
        root = root - step
        if np.all(np.abs(step) <= 1e-15 * np.abs(root)):
            break
    return np.asarray(root, dtype=np.complex128)[()]


@equation
def rotation_of_sphere(radius_m: Numbers, distance_m: Numbers) -> FloatArray:
    """Drag of a sphere's own rotation over that of its path: ``(4/9) (a/L)^2``.

    A sphere fixed to the rod turns with it. Its thin boundary layer takes the torque
    ``(8 pi/3) eta a^4/delta`` for each rad/s (Landau and Lifshitz, section 24), beside
    ``6 pi eta a^2 L^2/delta`` of Eq. 2.

    Parameters
    ----------
    radius_m, distance_m
        a and L in m.

    Returns
    -------
    FloatArray
        A pure number, to be added to 1.
    """
    return 4.0 / 9.0 * (radius_m / distance_m) ** 2


@equation
def cylinder_drag(
    radius_m: Numbers,
    angular_frequency_per_s: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
) -> FloatArray:
    """Drag of a cylinder that oscillates across its axis, for each metre and each m/s.

    ``pi rho omega b^2 Re[-4 i K1(z)/(z K0(z))]``, z = (1 + i) b/delta with K the modified Bessel
    functions (Stokes 1850). For a thin layer it is ``4 pi eta (b/delta + 1/2)``.

    Parameters
    ----------
    radius_m, angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        b in m, omega in rad/s, eta in Pa s, rho in kg/m^3; broadcast.

    Returns
    -------
    FloatArray
        In N s/m^2, in phase with the velocity that it opposes.
    """
    argument = radius_m * np.sqrt(1j * angular_frequency_per_s * density_kg_per_m3 / viscosity_pa_s)
    # K_n(z) = int_0^inf exp(-z cosh t) cosh(n t) dt; the factor exp(z) cancels in the ratio.
    cosh = np.cosh(_NODES)
    kernel = np.exp(-argument[..., None] * (cosh - 1.0))
    kernel[..., 0] *= 0.5
    ratio = (kernel * cosh).sum(axis=-1) / kernel.sum(axis=-1)
    displaced = np.pi * density_kg_per_m3 * radius_m**2
    return displaced * angular_frequency_per_s * np.real(4.0j * ratio / argument)
