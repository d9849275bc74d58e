"""A free decay in a fluid that remembers."""

import mpmath
import numpy as np
import pytest

from pendpipe import physics

INERTIA, STEADY, HISTORY, TORQUE = 0.0988, 7.3e-5, 3.0e-3, 1.04


def test_root_is_that_of_an_independent_solver() -> None:
    mpmath.mp.dps = 30

    def equation(s: mpmath.mpc) -> mpmath.mpc:
        return INERTIA * s**2 + STEADY * s + HISTORY * s ** mpmath.mpf("1.5") + TORQUE

    exact = mpmath.findroot(equation, mpmath.mpc(0, mpmath.sqrt(TORQUE / INERTIA)))
    root = physics.free_decay_root(INERTIA, STEADY, HISTORY, TORQUE)
    assert root.real == pytest.approx(float(exact.real), rel=1e-13)
    assert root.imag == pytest.approx(float(exact.imag), rel=1e-13)


@pytest.mark.parametrize("exponent", [0.0, -2.0])
def test_solid_friction_is_inside_the_root(exponent: float) -> None:
    mpmath.mp.dps = 30
    torque = 0.02

    def equation(real: mpmath.mpf, imaginary: mpmath.mpf) -> list[mpmath.mpf]:
        s = mpmath.mpc(real, imaginary)
        solid = torque * abs(s) ** (exponent - 1.0) * s
        left = INERTIA * s**2 + (STEADY * s + solid) + HISTORY * s ** mpmath.mpf("1.5") + TORQUE
        return [left.real, left.imag]

    exact = mpmath.findroot(equation, (-0.02, mpmath.sqrt(TORQUE / INERTIA)))
    root = physics.free_decay_root(INERTIA, STEADY, HISTORY, TORQUE, torque, exponent)
    assert root.real == pytest.approx(float(exact[0]), rel=1e-12)
    assert root.imag == pytest.approx(float(exact[1]), rel=1e-12)


def test_without_memory_it_is_the_damped_oscillator() -> None:
    root = physics.free_decay_root(0.1, 0.02, 0.0, 1.0)
    assert -root.real == pytest.approx(0.1, rel=1e-14)  # D/(2 I)
    assert abs(root) ** 2 == pytest.approx(10.0, rel=1e-14)  # K/I


def test_a_weak_memory_gives_the_drag_of_a_harmonic_motion_over_less_inertia() -> None:
    """The rate is D/(2 (I_all - I_layer/4)), to first order in the memory's inertia."""
    history = 1e-6 * np.array([1.0, 4.0])
    omega = np.sqrt(TORQUE / INERTIA)
    drag = history * np.sqrt(omega / 2.0)  # D2 s^(3/2) at s = i omega, in phase with velocity
    layer = history / np.sqrt(2.0 * omega)
    first = drag / (2.0 * (INERTIA + layer - 0.25 * layer))
    omega_all = np.sqrt(TORQUE / (INERTIA + layer))
    first *= np.sqrt(omega_all / omega)
    rate = -physics.free_decay_root(INERTIA, 0.0, history, TORQUE).real
    off = rate / first - 1.0
    assert np.all(np.abs(off) < (history / INERTIA) ** 2)  # second order is all that is left


def test_memory_of_stokes_drag_is_eq_2_and_the_added_mass() -> None:
    """The two parts of D2 s^(3/2) at s = i omega are Eq. 2's history term and 9 delta/(4 a)."""
    radius, omega, viscosity, density = 0.019, 3.24, 1.0016e-3, 1000.0
    history = 6.0 * np.pi * radius**2 * np.sqrt(density * viscosity)
    force = history * (1j * omega) ** 1.5
    drag = physics.harmonic_drag(1.0, radius, omega, viscosity, density)
    drag -= physics.stokes_drag(1.0, radius, viscosity)
    coefficient = physics.added_mass_coefficient(radius, omega, viscosity, density) - 0.5
    assert force.imag / omega == pytest.approx(float(drag), rel=1e-12)
    mass = float(coefficient) * density * float(physics.sphere_volume(radius))
    assert -force.real / omega**2 == pytest.approx(mass, rel=1e-12)


def test_cylinder_with_a_thin_layer_and_with_none() -> None:
    thin = physics.cylinder_drag(0.1, 100.0, 1e-3, 1000.0)
    depth = physics.penetration_depth(100.0, 1e-3, 1000.0)
    assert thin == pytest.approx(4.0 * np.pi * 1e-3 * (0.1 / depth + 0.5), rel=1e-5)


def test_cylinder_by_bessel_functions() -> None:
    from scipy.special import kv

    radius, omega = np.array([2e-4, 2.6e-3, 1e-2]), 0.8
    viscosity, density = 1.825e-5, 1.204
    argument = radius * np.sqrt(1j * omega * density / viscosity)
    ratio = kv(1, argument) / (argument * kv(0, argument))
    expected = np.pi * density * omega * radius**2 * np.real(4j * ratio)
    assert physics.cylinder_drag(radius, omega, viscosity, density) == pytest.approx(
        expected, rel=1e-12
    )


def test_rotation_is_a_ninth_of_a_sphere_twice_as_close() -> None:
    assert physics.rotation_of_sphere(0.019, 0.452) == pytest.approx(7.853e-4, rel=1e-3)
    assert physics.rotation_of_sphere(1.0, 2.0) == pytest.approx(1.0 / 9.0)
