"""A sphere oscillating near walls: exact solutions, published limits, symmetry, convergence."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from pendpipe.physics import penetration_depth
from pendpipe.physics.confinement import (
    Confined,
    Surface,
    _confined,
    sphere_between_planes,
    sphere_in_tank,
)

A, B = 1.0, 2.0


def thin_layer_concentric(radius_m: float, outer_radius_m: float) -> tuple[float, float]:
    """Drag factor and added-mass coefficient in a concentric sphere, for thin layers.

    ``K = (1 + s^4)/(1 - s^3)^2`` and ``C_m = (1 + 2 s^3)/(2 (1 - s^3))`` with ``s = a/b``: the
    slip of the potential flow, squared, over both spheres (Stokes 1851 has C_m).

    Parameters
    ----------
    radius_m, outer_radius_m
        a and b in m.

    Returns
    -------
    tuple of float
        Drag over that of the unbounded sphere, and added mass over the displaced mass.

    """
    s = radius_m / outer_radius_m
    return (1.0 + s**4) / (1.0 - s**3) ** 2, (1.0 + 2.0 * s**3) / (2.0 * (1.0 - s**3))


def concentric_sphere(radius_m: float, outer_radius_m: float, depth_m: float) -> Confined:
    """Return the exact force on a sphere oscillating inside a concentric sphere at rest.

    The four solutions of order one (two of the potential, two of the vorticity: modified
    spherical Bessel functions of ``alpha r``) are fitted to the velocity on both spheres.

    Parameters
    ----------
    radius_m, outer_radius_m, depth_m
        a, b > a, and the penetration depth delta, in m.

    Returns
    -------
    Confined
        Force factor, drag factor, added-mass coefficient.

    Raises
    ------
    ValueError
        If the outer sphere is not the larger one, or a length is not positive.

    Notes
    -----
    Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8; Landau and Lifshitz, Fluid Mechanics, section 24.

    """
    if not 0.0 < radius_m < outer_radius_m or depth_m <= 0.0:
        raise ValueError("lengths have to be positive, and the outer sphere the larger one")
    alpha = (1.0 - 1.0j) * radius_m / depth_m
    ratio = outer_radius_m / radius_m

    def velocity(r: float) -> np.ndarray:
        """Return the radial and polar amplitude of each solution at r, in units of a."""
        x = alpha * r
        # g = k_1(x) and i_1(x), and (x g)'; each without its exponential.
        outward = np.exp(-alpha * (r - 1.0))
        inward = np.exp(alpha * (r - ratio))
        back = np.exp(-2.0 * x)
        decaying = np.array([1.0 / x + 1.0 / x**2, -(1.0 + 1.0 / x + 1.0 / x**2)]) * outward
        growing = inward * np.array(
            [
                (1.0 + back) / x - (1.0 - back) / x**2,
                (1.0 - back) - (1.0 + back) / x + (1.0 - back) / x**2,
            ]
        )
        radial = [-2.0 / r**3, 1.0, 2.0 * decaying[0] / r, 2.0 * growing[0] / r]
        polar = [1.0 / r**3, 1.0, decaying[1] / r, growing[1] / r]
        return np.array([radial, polar], dtype=np.complex128)

    matrix = np.concatenate([velocity(1.0), velocity(ratio)])
    dipole = np.linalg.solve(matrix, np.array([1.0, 1.0, 0.0, 0.0], dtype=np.complex128))[0]
    return _confined(complex(dipole), alpha)


def impedance(found: Confined, depth: float) -> complex:
    """Force per velocity in units of 6 pi eta a, for a = 1."""
    alpha = (1.0 - 1.0j) / depth
    return found.force_factor * (1.0 + alpha + alpha**2 / 9.0)


def impedance_from_energy(depth: float, ratio: float, nodes: int = 90) -> complex:
    """Solve the stream function's ODE by collocation; add dissipation and kinetic energy.

    psi = F(r) sin^2 theta with L (L - alpha^2) F = 0, L = d^2/dr^2 - 2/r^2, u_r = 2 F cos/r^2,
    u_theta = -F' sin/r. The complex power is that of the vorticity, and of the motion.
    """
    alpha_squared = -2.0j / depth**2
    x = chebyshev.chebpts2(nodes)
    r = 1.0 + (ratio - 1.0) * (x + 1.0) / 2.0
    basis = np.eye(nodes)
    stretch = 2.0 / (ratio - 1.0)

    def derivative(order: int) -> np.ndarray:
        columns = [chebyshev.chebval(x, chebyshev.chebder(c, order)) for c in basis]
        return stretch**order * np.stack(columns, axis=1)

    value, slope, second, fourth = (derivative(order) for order in (0, 1, 2, 4))
    r = r[:, None]
    lap = second - 2.0 / r**2 * value
    # L^2 F = F'''' - 4 F''/r^2 + 8 F'/r^3 - 8 F/r^4
    lap_lap = fourth - 4.0 / r**2 * second + 8.0 / r**3 * slope - 8.0 / r**4 * value
    matrix = (lap_lap - alpha_squared * lap).astype(complex)
    right = np.zeros(nodes, dtype=complex)
    for row, condition, wanted in (
        (0, value[0], 0.5),
        (1, slope[0], 1.0),
        (-1, value[-1], 0.0),
        (-2, slope[-1], 0.0),
    ):
        matrix[row], right[row] = condition, wanted
    coefficients = np.linalg.solve(matrix, right)
    node, weight = np.polynomial.legendre.leggauss(200)
    weight = weight * (ratio - 1.0) / 2.0
    at = 1.0 + (ratio - 1.0) * (node + 1.0) / 2.0
    f, f1, f2 = (
        stretch**order * chebyshev.chebval(node, chebyshev.chebder(coefficients, order))
        for order in range(3)
    )
    vorticity = np.sum(weight * abs(f2 - 2.0 * f / at**2) ** 2)
    motion = np.sum(weight * (2.0 * abs(f) ** 2 / at**2 + abs(f1) ** 2))
    return complex(8.0 * np.pi / 3.0 * (vorticity + alpha_squared * motion) / (6.0 * np.pi))


@pytest.mark.parametrize("depth", [0.03, 0.1, 0.4, 3.0])
@pytest.mark.parametrize("ratio", [1.3, 2.0, 4.0])
def test_concentric_spheres_lose_what_the_vorticity_dissipates(depth: float, ratio: float) -> None:
    exact = impedance(concentric_sphere(A, ratio, depth), depth)
    assert exact == pytest.approx(impedance_from_energy(depth, ratio), rel=1e-7)


@pytest.mark.parametrize("ratio", [1.3, 2.0, 4.0])
def test_concentric_spheres_with_thin_layers_have_the_potential_flows_factors(ratio: float) -> None:
    drag, mass = thin_layer_concentric(A, ratio)
    exact = concentric_sphere(A, ratio, 1e-5)
    assert exact.drag_factor == pytest.approx(drag, rel=1e-4)
    assert exact.added_mass_coefficient == pytest.approx(mass, rel=1e-3)


@pytest.mark.parametrize("depth", [1e-3, 0.1, 1.0])
def test_distant_walls_leave_the_unbounded_sphere(depth: float) -> None:
    for found in (concentric_sphere(A, 3e4, depth), sphere_between_planes(A, 1e3, depth)):
        assert found.force_factor == pytest.approx(1.0, abs=2e-3 * depth + 1e-9)
        assert found.added_mass_coefficient == pytest.approx(0.5 + 2.25 * depth, rel=1e-3)


@pytest.mark.parametrize(
    ("gap_mm", "at_high_8", "at_006_hz"), [(12.0, 1.06942, 1.31257), (6.0, 1.18062, 2.20787)]
)
def test_thin_layers_underestimate_the_drag_in_the_papers_gaps(
    gap_mm: float, at_high_8: float, at_006_hz: float
) -> None:
    # The stress of the closed form, integrated over the sphere in 40 digits.
    radius = 0.01895
    outer = radius + 1e-3 * gap_mm
    for frequency, expected in ((1.06, at_high_8), (0.06, at_006_hz)):
        depth = penetration_depth(2.0 * np.pi * frequency, 1.0e-3, 1000.0)
        thin = 1.0 + thin_layer_concentric(radius, outer)[0] * radius / depth
        exact = concentric_sphere(radius, outer, depth).drag_factor * (1.0 + radius / depth)
        assert exact / thin == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("distance", "published"),
    [(10.0677, 1.0591), (3.7622, 1.1738), (2.3524, 1.3079), (1.5431, 1.5675)],
)
def test_slow_sphere_near_a_floor_has_the_steady_resistance(
    distance: float, published: float
) -> None:
    # Goldman, Cox and Brenner (1967): translation without rotation, parallel to a wall.
    found = sphere_between_planes(A, distance, 1e3, order=20)
    assert impedance(found, 1e3).real == pytest.approx(published, abs=2e-4)


def test_slow_sphere_far_from_a_floor_follows_lorentz() -> None:
    found = sphere_between_planes(A, 30.0, 1e3)
    assert impedance(found, 1e3).real == pytest.approx(1.0 + 9.0 / 16.0 / 30.0, abs=4e-4)


@pytest.mark.parametrize(("surface", "sign"), [("film", 1.0), ("slip", 1.0)])
def test_thin_layers_leave_lambs_image_of_the_sphere(surface: Surface, sign: float) -> None:
    distance = 5.0
    found = sphere_between_planes(A, 60.0, 1e-5, surface_m=distance, surface=surface)
    image = 0.5 * (1.0 + sign * 3.0 / 16.0 / distance**3)
    assert found.added_mass_coefficient - 2.25e-5 == pytest.approx(image, abs=2e-5)


def test_floor_and_lid_can_be_exchanged() -> None:
    one = sphere_between_planes(A, 1.4, 0.05, surface_m=2.5)
    other = sphere_between_planes(A, 2.5, 0.05, surface_m=1.4)
    assert one.force_factor == pytest.approx(other.force_factor, rel=1e-9)


@pytest.mark.parametrize("surface", ["film", "slip"])
def test_distant_surface_leaves_the_floor_alone(surface: Surface) -> None:
    alone = sphere_between_planes(A, 1.4, 0.05)
    covered = sphere_between_planes(A, 1.4, 0.05, surface_m=80.0, surface=surface)
    assert covered.force_factor == pytest.approx(alone.force_factor, rel=1e-5)


@pytest.mark.parametrize("surface", ["film", "slip"])
def test_layers_cost_added_mass_as_much_as_drag(surface: Surface) -> None:
    """The force is analytic in alpha: its term of first order has equal real and imaginary part."""
    thin, thinner = (
        sphere_between_planes(A, 1.32, depth, surface_m=1.32, surface=surface)
        for depth in (2e-4, 1e-4)
    )
    slope = (thin.added_mass_coefficient - thinner.added_mass_coefficient) / 1e-4
    assert slope / 2.25 == pytest.approx(thinner.drag_factor, rel=2e-3)


@pytest.mark.parametrize("depth", [0.03, 0.3])
def test_orders_converge_geometrically(depth: float) -> None:
    best = sphere_between_planes(A, 1.32, depth, surface_m=1.32, order=32).force_factor
    errors = [
        abs(sphere_between_planes(A, 1.32, depth, surface_m=1.32, order=order).force_factor - best)
        for order in (4, 8, 16)
    ]
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.05 * errors[1]
    assert errors[2] < 1e-7


# The paper's tank, 23 cm by 11 cm by 5 cm, and its sphere.
RADIUS, HALF = 0.01895, 0.025


@pytest.mark.parametrize(("length", "width", "expected"), [(0.23, 0.11, 0.67), (0.11, 0.23, 0.64)])
def test_tank_with_thin_layers_has_the_added_mass_of_potential_flow(
    length: float, width: float, expected: float
) -> None:
    # Laplace's equation in the box by fundamental solutions, which shares nothing with this.
    found = sphere_in_tank(
        RADIUS, HALF, 1e-6, surface_m=HALF, length_m=length, width_m=width, surface="film"
    )
    assert found.added_mass_coefficient == pytest.approx(expected, rel=0.025)


def test_side_walls_act_as_the_images_of_the_dipole_in_them() -> None:
    from pendpipe.physics.confinement import _side_images

    length, width, aside = 0.2, 0.11, 0.015
    n, m = np.arange(-3000, 3001)[:, None], np.arange(-3000, 3001)
    x, y = n * length, m * width - np.where(m % 2, 2.0 * aside, 0.0)
    square = np.where((n == 0) & (m == 0), np.inf, x**2 + y**2)
    # The rows farther and farther along cancel in pairs: half the last ones.
    weight = np.where(np.abs(n) == 3000, 0.5, 1.0) * (-1.0) ** n
    direct = np.sum(weight * (y**2 - x**2) / square**2)
    assert _side_images(length, width, aside) == pytest.approx(direct, rel=1e-3)


def test_left_and_right_of_the_middle_are_the_same_and_a_near_side_wall_adds() -> None:
    def force(aside: float) -> complex:
        return sphere_in_tank(
            RADIUS,
            HALF,
            5e-4,
            surface_m=HALF,
            length_m=0.23,
            width_m=0.11,
            off_centre_m=aside,
        ).force_factor

    assert force(0.015) == pytest.approx(force(-0.015), rel=1e-12)
    assert force(0.0).real < force(0.015).real < force(0.03).real


def test_large_tank_is_two_planes() -> None:
    wide = sphere_in_tank(
        RADIUS, HALF, 5e-4, surface_m=HALF, length_m=90.0, width_m=90.0, surface="film"
    )
    planes = sphere_between_planes(RADIUS, HALF, 5e-4, surface_m=HALF)
    assert wide.force_factor == pytest.approx(planes.force_factor, rel=1e-5)


def test_walls_inside_the_sphere_are_refused() -> None:
    with pytest.raises(ValueError, match="outside the sphere"):
        sphere_between_planes(0.02, 0.019, 1e-3)
    with pytest.raises(ValueError, match="larger"):
        concentric_sphere(0.02, 0.019, 1e-3)
    with pytest.raises(ValueError, match="side walls"):
        sphere_in_tank(0.02, 0.03, 1e-3, surface_m=0.03, length_m=0.2, width_m=0.03)
    with pytest.raises(ValueError, match="side walls"):
        sphere_in_tank(
            0.02, 0.03, 1e-3, surface_m=0.03, length_m=0.2, width_m=0.06, off_centre_m=0.02
        )
