"""The pendulum in its fluid: inertia, drag, walls, and its free decay."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import brentq

from pendpipe import physics
from pendpipe.physics import (
    STANDARD_GRAVITY_M_PER_S2,
    Fluid,
    Part,
    PointMass,
    Rod,
    Sphere,
    added_inertia,
    added_mass_coefficient,
    bearing_friction_rate,
    harmonic_drag,
    inertia_from_frequency,
    moment_of_inertia,
    penetration_depth,
    period_lengthening,
    quadratic_drag_rate,
    restoring_torque,
    sphere_volume,
    static_moment,
    stokes_drag,
    swing,
    viscous_quality_factor,
    water_density,
    water_viscosity,
)
from pendpipe.physics.confinement import (
    Confined,
    Surface,
    _side_images,
    sphere_between_planes,
    sphere_in_tank,
)

# The compound pendulum: textbook bodies, the paper's apparatus, and water.

WATER = Fluid(1000.0, 1.0016e-3)
G = STANDARD_GRAVITY_M_PER_S2


def apparatus(lower: object, upper: object = None) -> list[Part]:
    """The paper's rod, weights and wooden sphere; positions of the weights in m."""
    parts: list[Part] = [
        Rod(0.0444, 0.77),
        Sphere(0.0358, 0.01895, 0.452, submerged=True),
        PointMass(0.993, lower),  # type: ignore[arg-type]
    ]
    return parts if upper is None else [*parts, PointMass(0.711, -np.asarray(upper))]


def test_textbook_pendulums() -> None:
    simple = swing([PointMass(1.0, 2.0)])
    assert simple.angular_frequency_per_s == pytest.approx(np.sqrt(G / 2.0), rel=1e-15)
    rod = swing([Rod(0.3, 1.2, centre_m=0.6)])  # hung at its end: l_eff = 2 l/3
    assert rod.angular_frequency_per_s == pytest.approx(np.sqrt(G / 0.8), rel=1e-14)
    ball = swing([Sphere(2.0, 0.1, 1.0)])
    assert ball.angular_frequency_per_s == pytest.approx(np.sqrt(G / 1.004), rel=1e-14)


@given(inertia=st.floats(0.0, 1.0), mass=st.floats(0.1, 10.0), at=st.floats(-1.0, 1.0))
def test_parallel_axes(inertia: float, mass: float, at: float) -> None:
    assert moment_of_inertia([PointMass(mass, at, inertia)]) == pytest.approx(
        inertia + mass * at**2, rel=1e-14, abs=1e-300
    )


def test_a_balanced_pendulum_has_no_frequency() -> None:
    parts = [PointMass(1.0, 0.3), PointMass(1.0, -0.3)]
    assert static_moment(parts) == 0.0
    assert np.isnan(swing(parts).angular_frequency_per_s)
    assert np.isnan(swing([PointMass(1.0, -0.3)]).frequency_hz)


def test_the_apparatus_closes_on_the_papers_record() -> None:
    motion = swing(apparatus(0.25, [0.19, 0.20]), WATER)
    assert motion.frequency_hz[0] > 0.516 > motion.frequency_hz[1]
    np.testing.assert_allclose(motion.frequency_hz, 0.52, atol=0.02)
    np.testing.assert_allclose(motion.moment_of_inertia_kg_m2, 0.10, atol=0.004)


def test_the_high_branch_reaches_1_06_hz_and_its_exponent_is_near_the_papers() -> None:
    motion = swing(apparatus(np.linspace(0.11, 0.29, 8)), WATER)
    assert motion.frequency_hz[0] == pytest.approx(1.06, abs=0.005)
    quality = viscous_quality_factor(
        motion.moment_of_inertia_kg_m2,
        motion.angular_frequency_per_s,
        0.01895,
        0.452,
        WATER.viscosity_pa_s,
        WATER.density_kg_per_m3,
    )
    slope = np.polyfit(np.log(motion.frequency_hz), np.log(quality), 1)[0]
    assert -5.8 <= slope <= -5.5


@given(lower=st.floats(0.1, 0.35), upper=st.floats(0.0, 0.05))
def test_frequency_and_added_mass_agree_with_each_other(lower: float, upper: float) -> None:
    parts = apparatus(lower, upper)
    torque = float(restoring_torque(parts, WATER))

    def imbalance(omega: float) -> float:
        inertia = moment_of_inertia(parts) + added_inertia(parts, WATER, omega)
        return float(inertia * omega**2 - torque)

    found = swing(parts, WATER)
    expected = brentq(imbalance, 0.1, 20.0, xtol=1e-15, rtol=1e-14)
    assert float(found.angular_frequency_per_s) == pytest.approx(expected, rel=1e-12)
    assert float(
        inertia_from_frequency(found.frequency_hz, found.restoring_torque_n_m_per_rad)
    ) == pytest.approx(float(found.moment_of_inertia_kg_m2), rel=1e-12)


def test_buoyancy_weighs_the_sphere_less_its_water() -> None:
    parts: list[Part] = [Sphere(0.0358, 0.01895, 0.452, submerged=True)]
    net = (0.0358 - 1000.0 * sphere_volume(0.01895)) * G * 0.452
    assert restoring_torque(parts, WATER) == pytest.approx(net, rel=1e-13)
    assert restoring_torque(parts) == pytest.approx(0.0358 * G * 0.452, rel=1e-13)


def test_a_submerged_screw_is_buoyed_too() -> None:
    parts: list[Part] = [PointMass(0.004, 0.43, displaced_m3=5e-7)]
    assert restoring_torque(parts, WATER) == pytest.approx((0.004 - 5e-4) * G * 0.43, rel=1e-13)


def test_plain_added_mass_is_half_the_displaced_water() -> None:
    parts = apparatus(0.25)
    half = 0.5 * 1000.0 * sphere_volume(0.01895) * 0.452**2
    assert added_inertia(parts, WATER, 3.0, plain_added_mass=True) == pytest.approx(half, rel=1e-14)
    assert added_inertia(parts, WATER, 3.0) > half
    assert added_inertia(parts, None, 3.0) == 0.0


def test_water_lengthens_the_period_and_more_so_where_it_is_long() -> None:
    longer = period_lengthening(apparatus(0.25, [0.15, 0.19, 0.22]), WATER)
    assert np.all(longer.buoyancy > 0.0)
    assert np.all(longer.added_mass > 0.0)
    assert np.all(np.diff(longer.buoyancy) > 0.0)
    # The two factors multiply, up to the added mass's dependence on the frequency.
    product = (1.0 + longer.buoyancy) * (1.0 + longer.added_mass) - 1.0
    np.testing.assert_allclose(longer.both, product, rtol=0.01)


def test_a_thin_fluid_changes_nothing() -> None:
    longer = period_lengthening(apparatus(0.25), Fluid(1e-9, 1e-15))
    assert max(map(float, longer)) < 1e-10


def test_buoyancy_may_leave_no_restoring_torque() -> None:
    parts = apparatus(0.25, 0.3665)
    assert swing(parts).frequency_hz > 0.0
    assert np.isnan(swing(parts, WATER).frequency_hz)


@given(torque=st.floats(1e-8, 1e-3), y=st.floats(1e-3, 0.1))
def test_bearing_friction_takes_four_torques_times_amplitude_a_cycle(
    torque: float, y: float
) -> None:
    inertia, omega = 0.099, 3.24
    c = float(bearing_friction_rate(torque, inertia, omega))
    energy_loss = inertia * omega**2 * y * c * 2.0 * np.pi / omega
    assert energy_loss == pytest.approx(4.0 * torque * y, rel=1e-12)


def test_units_scale_out_of_the_frequency() -> None:
    # Lengths twice as long at the same g: the period grows by sqrt(2), whatever the masses.
    small = swing([Rod(0.1, 0.5, 0.1), PointMass(0.7, 0.3)])
    large = swing([Rod(0.3, 1.0, 0.2), PointMass(2.1, 0.6)])
    assert large.frequency_hz * np.sqrt(2.0) == pytest.approx(small.frequency_hz, rel=1e-14)


# Properties of water, and what a sphere loses in it (Eqs. 2 to 4, 16).


def test_outside_the_formulas_range_there_is_no_value() -> None:
    assert np.isnan(water_viscosity([-21.0, 111.0])).all()
    assert np.isnan(water_density([-1.0, 41.0])).all()


def test_a_kelvin_changes_the_viscous_quality_factor_by_about_a_percent() -> None:
    q = viscous_quality_factor(
        0.099, 3.24, 0.01895, 0.452, water_viscosity([20.0, 21.0]), water_density([20.0, 21.0])
    )
    assert 0.010 < q[1] / q[0] - 1.0 < 0.014


VISCOSITY, DENSITY = 1.0016e-3, 1000.0
RADIUS, DISTANCE, INERTIA = 0.01895, 0.452, 0.099
OMEGA = 2.0 * np.pi * 0.516


def decades(low: int, high: int) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda power: 10.0**power)


RECORD_HZ = np.array([0.516, 0.05, 1.06])


@pytest.mark.parametrize(
    ("found", "published", "within"),
    [
        (water_viscosity(20.0) * 1e3, 1.0016, 5e-5),
        # IAPWS values for the saturated liquid at 290, 300, 320 and 340 K, in uPa s, to 0.1 %.
        (
            water_viscosity(np.array([290.0, 300.0, 320.0, 340.0]) - 273.15)
            / [1084e-6, 853.84e-6, 577.02e-6, 421.97e-6],
            1.0,
            1e-3,
        ),
        # Tanaka et al. 2001: largest at 3.983035 C; 998.2067 at 20 C, 997.0470 at 25 C.
        (water_density([3.983035, 20.0, 25.0]), [999.97495, 998.2067, 997.0470], 5e-5),
        (np.argmax(water_density(np.linspace(0.0, 10.0, 1001))), 398, 0),
        (0.0358 / sphere_volume(0.01895), 1256.0, 0.5),
        (bearing_friction_rate(7.1e-7, INERTIA, OMEGA), 1.4e-6, 0.01e-6),
        (
            RADIUS / penetration_depth(2.0 * np.pi * RECORD_HZ, VISCOSITY, DENSITY),
            [24.1, 7.5, 34.6],
            0.05,
        ),
        (
            harmonic_drag(0.01, 0.019, OMEGA, VISCOSITY, DENSITY)
            / stokes_drag(0.01, 0.019, VISCOSITY),
            25.2,
            0.05,
        ),
        (
            viscous_quality_factor(
                INERTIA, OMEGA, np.array([0.019, 0.01895]), DISTANCE, VISCOSITY, DENSITY
            ),
            [174.0, 174.9],
            0.05,
        ),
        (added_mass_coefficient(RADIUS, OMEGA, VISCOSITY, DENSITY), 0.593, 5e-4),
        (added_mass_coefficient(RADIUS, OMEGA, 0.0, DENSITY), 0.5, 0.0),
        (quadratic_drag_rate(0.62, INERTIA, OMEGA, RADIUS, DISTANCE, DENSITY), 0.45, 0.002),
        (physics.rotation_of_sphere(0.019, 0.452), 7.853e-4, 8e-7),
        (physics.rotation_of_sphere(1.0, 2.0), 1.0 / 9.0, 1e-7),
    ],
    ids=[
        *("viscosity at 20 C", "viscosity of IAPWS", "density", "largest density"),
        *("the wooden sphere's density", "bearing friction", "radius in penetration depths"),
        *("history term over steady drag", "Eq. 16", "added mass", "added mass without layer"),
        *("quadratic drag", "rotation in the tank", "rotation twice as close"),
    ],
)
def test_water_sphere_and_record_have_the_published_numbers(
    found: object, published: object, within: float
) -> None:
    np.testing.assert_allclose(found, published, rtol=0.0, atol=within)  # type: ignore[arg-type]


def test_eq16_is_the_energy_over_the_loss_of_a_radian() -> None:
    y = 0.01
    phase = 2.0 * np.pi * np.arange(64) / 64
    velocity = DISTANCE * OMEGA * y * np.cos(phase)
    power = harmonic_drag(velocity, RADIUS, OMEGA, VISCOSITY, DENSITY) * velocity
    loss_in_cycle = np.mean(power) * 2.0 * np.pi / OMEGA
    quality = 2.0 * np.pi * 0.5 * INERTIA * (OMEGA * y) ** 2 / loss_in_cycle
    theory = viscous_quality_factor(INERTIA, OMEGA, RADIUS, DISTANCE, VISCOSITY, DENSITY)
    assert theory == pytest.approx(quality, rel=1e-13)


@given(omega=decades(-2, 3), radius=decades(-4, 0), viscosity=decades(-6, 0), rho=decades(0, 4))
def test_drag_and_added_mass_are_the_two_parts_of_the_stokes_solution(
    omega: float, radius: float, viscosity: float, rho: float
) -> None:
    # Force on a sphere moving as exp(-i omega t): 6 pi eta a (1 + z + z^2/9) v with
    # z = sqrt(-i omega rho a^2/eta); its imaginary part is -omega times the added mass.
    z = np.sqrt(-1j * omega * rho / viscosity) * radius
    impedance = 6.0 * np.pi * viscosity * radius * (1.0 + z + z**2 / 9.0)
    displaced = rho * sphere_volume(radius)
    assert harmonic_drag(1.0, radius, omega, viscosity, rho) == pytest.approx(
        impedance.real, rel=1e-12
    )
    assert added_mass_coefficient(radius, omega, viscosity, rho) == pytest.approx(
        -impedance.imag / omega / displaced, rel=1e-12
    )


def test_drag_falls_to_steady_stokes_at_zero_frequency_and_without_history() -> None:
    steady = stokes_drag(1.0, RADIUS, VISCOSITY)
    assert harmonic_drag(1.0, RADIUS, 1e-16, VISCOSITY, DENSITY) == pytest.approx(steady, rel=1e-6)
    assert harmonic_drag(1.0, RADIUS, OMEGA, VISCOSITY, DENSITY, 0.0) == steady


def test_quadratic_drag_rate_is_the_energy_loss_of_harmonic_motion() -> None:
    y, coefficient = 0.05, 0.62
    phase = 2.0 * np.pi * np.arange(4096) / 4096
    speed = np.abs(DISTANCE * OMEGA * y * np.cos(phase))
    force = 0.5 * DENSITY * coefficient * np.pi * RADIUS**2 * speed**2
    mean_power = np.mean(force * speed)
    # d(I omega^2 y^2/2)/dt = -power, so y' = -power/(I omega^2 y) = -a y^2.
    a = mean_power / (INERTIA * OMEGA**2 * y**3)
    assert quadratic_drag_rate(
        coefficient, INERTIA, OMEGA, RADIUS, DISTANCE, DENSITY
    ) == pytest.approx(a, rel=1e-6)


# A sphere oscillating near walls: published limits, symmetry, convergence.

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
SPHERE, MIDDLE = 0.01895, 0.025


@pytest.mark.parametrize(("length", "width", "expected"), [(0.23, 0.11, 0.67), (0.11, 0.23, 0.64)])
def test_tank_with_thin_layers_has_the_added_mass_of_potential_flow(
    length: float, width: float, expected: float
) -> None:
    # Laplace's equation in the box by fundamental solutions, which shares nothing with this.
    found = sphere_in_tank(
        SPHERE, MIDDLE, 1e-6, surface_m=MIDDLE, length_m=length, width_m=width, surface="film"
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
            SPHERE,
            MIDDLE,
            5e-4,
            surface_m=MIDDLE,
            length_m=0.23,
            width_m=0.11,
            off_centre_m=aside,
        ).force_factor

    assert force(0.015) == pytest.approx(force(-0.015), rel=1e-12)
    assert force(0.0).real < force(0.015).real < force(0.03).real


def test_large_tank_is_two_planes() -> None:
    wide = sphere_in_tank(
        SPHERE, MIDDLE, 5e-4, surface_m=MIDDLE, length_m=90.0, width_m=90.0, surface="film"
    )
    planes = sphere_between_planes(SPHERE, MIDDLE, 5e-4, surface_m=MIDDLE)
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


# A free decay in a fluid that remembers.

MOMENT, STEADY, HISTORY, TORQUE = 0.0988, 7.3e-5, 3.0e-3, 1.04


@pytest.mark.parametrize(("torque", "exponent"), [(0.0, 0.0), (0.02, 0.0), (0.02, -2.0)])
def test_root_is_that_of_an_independent_solver(torque: float, exponent: float) -> None:
    """Solid friction is inside the root."""
    mpmath.mp.dps = 30

    def equation(real: mpmath.mpf, imaginary: mpmath.mpf) -> list[mpmath.mpf]:
        s = mpmath.mpc(real, imaginary)
        solid = torque * abs(s) ** (exponent - 1.0) * s
        left = MOMENT * s**2 + (STEADY * s + solid) + HISTORY * s ** mpmath.mpf("1.5") + TORQUE
        return [left.real, left.imag]

    exact = mpmath.findroot(equation, (-0.02, mpmath.sqrt(TORQUE / MOMENT)))
    solid = (torque, exponent) if torque else ()
    root = physics.free_decay_root(MOMENT, STEADY, HISTORY, TORQUE, *solid)
    assert root.real == pytest.approx(float(exact[0]), rel=1e-12)
    assert root.imag == pytest.approx(float(exact[1]), rel=1e-12)


def test_without_memory_it_is_the_damped_oscillator() -> None:
    root = physics.free_decay_root(0.1, 0.02, 0.0, 1.0)
    assert -root.real == pytest.approx(0.1, rel=1e-14)  # D/(2 I)
    assert abs(root) ** 2 == pytest.approx(10.0, rel=1e-14)  # K/I


def test_a_weak_memory_gives_the_drag_of_a_harmonic_motion_over_less_inertia() -> None:
    """The rate is D/(2 (I_all - I_layer/4)), to first order in the memory's inertia."""
    history = 1e-6 * np.array([1.0, 4.0])
    omega = np.sqrt(TORQUE / MOMENT)
    drag = history * np.sqrt(omega / 2.0)  # D2 s^(3/2) at s = i omega, in phase with velocity
    layer = history / np.sqrt(2.0 * omega)
    first = drag / (2.0 * (MOMENT + layer - 0.25 * layer))
    omega_all = np.sqrt(TORQUE / (MOMENT + layer))
    first *= np.sqrt(omega_all / omega)
    rate = -physics.free_decay_root(MOMENT, 0.0, history, TORQUE).real
    off = rate / first - 1.0
    assert np.all(np.abs(off) < (history / MOMENT) ** 2)  # second order is all that is left


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
