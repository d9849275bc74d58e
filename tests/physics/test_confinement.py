"""A sphere oscillating near walls: published limits, symmetry, convergence."""

import numpy as np
import pytest

from pendpipe.physics.confinement import (
    Confined,
    Surface,
    _side_images,
    sphere_between_planes,
    sphere_in_tank,
)

A = 1.0


def impedance(found: Confined, depth: float) -> complex:
    """Force per velocity in units of 6 pi eta a, for a = 1."""
    alpha = (1.0 - 1.0j) / depth
    return found.force_factor * (1.0 + alpha + alpha**2 / 9.0)


@pytest.mark.parametrize("depth", [1e-3, 0.1, 1.0])
def test_distant_walls_leave_the_unbounded_sphere(depth: float) -> None:
    found = sphere_between_planes(A, 1e3, depth)
    assert found.force_factor == pytest.approx(1.0, abs=2e-3 * depth + 1e-9)
    assert found.added_mass_coefficient == pytest.approx(0.5 + 2.25 * depth, rel=1e-3)


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
    length, width, aside = 0.2, 0.11, 0.015
    n, m = np.arange(-400, 401)[:, None], np.arange(-400, 401)
    x, y = n * length, m * width - np.where(m % 2, 2.0 * aside, 0.0)
    square = np.where((n == 0) & (m == 0), np.inf, x**2 + y**2)
    # The rows farther and farther along cancel in pairs: half the last ones.
    weight = np.where(np.abs(n) == 400, 0.5, 1.0) * (-1.0) ** n
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
    with pytest.raises(ValueError, match="side walls"):
        sphere_in_tank(0.02, 0.03, 1e-3, surface_m=0.03, length_m=0.2, width_m=0.03)
    with pytest.raises(ValueError, match="side walls"):
        sphere_in_tank(
            0.02, 0.03, 1e-3, surface_m=0.03, length_m=0.2, width_m=0.06, off_centre_m=0.02
        )
