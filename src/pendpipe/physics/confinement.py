"""Drag and added mass of an oscillating sphere near walls, at any penetration depth.

The fluid obeys the unsteady Stokes equations, ``-i omega rho u = -grad p + eta lap u`` with
``div u = 0``, and sticks to the sphere and to the walls. All lengths matter only in ratios, so
that a sphere's radius, its walls and the penetration depth ``delta = sqrt(2 nu/omega)`` say all.
The force on the fluid per velocity is ``6 pi eta a Z``, its real part drag, and its imaginary
part ``-omega`` times the added mass. Unbounded,
``Z = 1 + alpha a + (alpha a)^2/9`` with ``alpha = (1 - i)/delta`` (Stokes 1851).

Thin boundary layers, which the usual factors assume, are a limit: at 5 to 25 penetration depths in
a gap they are still off by some per cent.
"""

from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from pendpipe.arrays import FloatArray

ComplexArray = npt.NDArray[np.complex128]
Surface = Literal["film", "slip"]
"""What covers the fluid: a lid or a rigid film (no slip), or a flat surface without shear stress:
what gravity holds flat, far below the first sloshing mode."""

_DECAY: Final = 40.0
"""Plane waves are followed until they have decayed by e^-40."""


class Confined(NamedTuple):
    """What walls do to the force on an oscillating sphere.

    Parameters
    ----------
    force_factor
        F(omega)/F_unbounded(omega), a complex number.
    drag_factor
        Drag over that of Eq. 2 with C_H = 1.
    added_mass_coefficient
        Added mass over the mass of the displaced fluid (1/2 + 9 delta/(4 a) without walls).
    """

    force_factor: complex
    drag_factor: float
    added_mass_coefficient: float


def sphere_between_planes(
    radius_m: float,
    floor_m: float,
    depth_m: float,
    *,
    surface_m: float | None = None,
    surface: Surface = "film",
    order: int = 16,
) -> Confined:
    """Return the force on a sphere oscillating parallel to a floor and under a surface.

    Multipoles about the sphere's centre (one of the potential and two of the vorticity for each
    order) are each completed by what floor and surface send back, plane wave by plane wave; the
    sum is fitted to the velocity on the sphere. That is exact but for the number of orders.

    Parameters
    ----------
    radius_m, floor_m, depth_m
        The radius, the distance of the floor from the sphere's centre, and the penetration depth
        delta, in m.
    surface_m
        Distance of the surface from the sphere's centre in m; None: unbounded above.
    surface
        ``"film"`` (a lid, or a contaminated surface) or ``"slip"``.
    order
        Number of multipole orders.

    Returns
    -------
    Confined
        Force factor, drag factor, added-mass coefficient.

    Raises
    ------
    ValueError
        If a plane touches the sphere, or a length is not positive.

    Notes
    -----
    Sixteen orders leave less than 1e-7 of the force at gaps of a third of the radius, and 3e-4 at
    gaps of a twentieth. The penetration depth may be up to 1000 radii. The flow is linear: the
    amplitude is small beside the radius.

    Limits: Felderhof, J. Phys. Chem. B 109 (2005) 21406 (a small sphere); Goldman, Cox and
    Brenner, Chem. Eng. Sci. 22 (1967) 637 (steady); Lamb, Hydrodynamics, section 137 (inviscid).

    Examples
    --------
    In the middle of 5 cm of water, at 0.516 Hz, under a rigid film:

    >>> film = sphere_between_planes(0.019, 0.025, 0.00079, surface_m=0.025)
    >>> round(film.drag_factor, 2), round(film.added_mass_coefficient, 2)
    (1.24, 0.72)
    """
    dipole, alpha = _dipole(radius_m, floor_m, depth_m, surface_m, surface, order)
    return _confined(dipole, alpha)


def sphere_in_tank(
    radius_m: float,
    floor_m: float,
    depth_m: float,
    *,
    surface_m: float,
    length_m: float,
    width_m: float,
    off_centre_m: float = 0.0,
    surface: Surface = "slip",
    order: int = 16,
) -> Confined:
    """Return the force on a sphere that swings along a rectangular tank, about its centre.

    Floor and surface act as in `sphere_between_planes`. Side walls send back a flow that is nearly
    uniform over the sphere: ``u = -kappa (U - u)``, so that the dipole of the potential grows by
    ``1/(1 - kappa)``. The images of the dipole in the side walls give

    ``kappa = -2 p (a^3/H) S``, ``S = sum' (-1)^n (y^2 - x^2)/(x^2 + y^2)^2``

    at x = n L, and y = m W for even m, m W - 2 e for odd m, with e off the centre. Here p is the
    dipole over U a^3 (-1/2 unbounded).

    Parameters
    ----------
    radius_m, floor_m, depth_m, surface_m, surface
        As in `sphere_between_planes`.
    length_m, width_m
        The tank's size along and across the swing, in m.
    off_centre_m
        Distance of the sphere from the middle, across the swing.
    order
        Number of multipole orders.

    Returns
    -------
    Confined
        Force factor, drag factor, added-mass coefficient.

    Raises
    ------
    ValueError
        As `sphere_between_planes`; or a side wall touches the sphere.

    Notes
    -----
    Side walls count as potential flow sees them, farther than half the depth (what is left of
    other modes there is e^(-pi W/H)); their own boundary layers are left out (about 1 % of the
    drag).

    The images: Lamb, Hydrodynamics, section 98.

    Examples
    --------
    A tank of 23 cm by 11 cm with 5 cm of water, at 0.516 Hz, with a lid and with none:

    >>> tank = {"surface_m": 0.025, "length_m": 0.23, "width_m": 0.11}
    >>> lid = sphere_in_tank(0.019, 0.025, 0.00079, surface="film", **tank)
    >>> clean = sphere_in_tank(0.019, 0.025, 0.00079, **tank)
    >>> round(lid.drag_factor, 2), round(clean.drag_factor, 2)
    (1.35, 1.31)
    """
    if radius_m >= min(length_m, width_m - 2.0 * abs(off_centre_m)) / 2.0:
        raise ValueError("the side walls have to be outside the sphere")
    dipole, alpha = _dipole(radius_m, floor_m, depth_m, surface_m, surface, order)
    images = 2.0 / (floor_m + surface_m) * _side_images(length_m, width_m, off_centre_m)
    return _confined(dipole / (1.0 + dipole * radius_m**3 * images), alpha)


def _dipole(
    radius_m: float,
    floor_m: float,
    depth_m: float,
    surface_m: float | None,
    surface: Surface,
    order: int,
) -> tuple[complex, complex]:
    """Return the dipole of the potential between planes, over U a^3, and alpha a."""
    if radius_m <= 0.0 or depth_m <= 0.0 or min(floor_m, surface_m or np.inf) <= radius_m:
        raise ValueError("lengths have to be positive, and the planes outside the sphere")
    alpha = (1.0 - 1.0j) * radius_m / depth_m
    floor = floor_m / radius_m
    above = None if surface_m is None else surface_m / radius_m
    cosine, weight = np.polynomial.legendre.leggauss(2 * order + 8)
    own, target = _on_the_sphere(order, alpha, cosine)
    sent_back = _sent_back(order, alpha, cosine, floor, above, surface)
    weights = np.sqrt(np.tile(weight, 3))[:, None]
    matrix = weights * (own + sent_back)
    scale = np.linalg.norm(matrix, axis=0)
    solved = np.linalg.lstsq(matrix / scale, (weights[:, 0] * target).astype(complex), rcond=None)
    return complex(solved[0][0] / scale[0]), alpha


def _side_images(length_m: float, width_m: float, off_centre_m: float) -> float:
    """Return S: d/dx of x/(x^2 + y^2), summed over the images in the side walls.

    A row of images across the tank, 2 W apart, sums to the real part of
    (pi/2W)^2/sinh^2(pi (x + i y)/(2 W)) with y that of one of them: 0 for the images of even
    order, W - 2 e for those of odd order.
    """
    x = length_m * np.arange(1, 2 + int(12.0 * width_m / length_m + 1.0))
    signs = -((-1.0) ** np.arange(1, x.size + 1))
    scale = np.pi / (2.0 * width_m)
    aside = scale * (width_m - 2.0 * off_centre_m)
    rows = np.sinh(scale * x) ** -2.0 + (np.sinh(scale * x + 1j * aside) ** -2.0).real
    own = 1.0 / 3.0 + 1.0 / np.sin(aside) ** 2
    return float(scale**2 * (own + 2.0 * (signs * rows).sum()))


def _confined(dipole: complex, alpha: complex) -> Confined:
    """Turn the potential's dipole into the force; lengths in radii.

    The pressure of the dipole belongs to the force on the fluid outside and to that which would
    move the displaced fluid along: F = -4 pi eta a alpha^2 dipole - (4/3) pi eta a alpha^2.
    """
    force = -(alpha**2) * (2.0 / 3.0 * dipole + 2.0 / 9.0)
    unbounded = 1.0 + alpha + alpha**2 / 9.0
    # omega times the displaced mass is (2/9) |alpha|^2 in units of 6 pi eta a.
    mass = -force.imag / (2.0 / 9.0 * abs(alpha) ** 2)
    return Confined(force / unbounded, force.real / unbounded.real, mass)


def _legendre(order: int, x: Any, s: Any) -> tuple[Any, Any, Any]:
    """Return P_l, P_l^1 and P_l^2 for l = 1 to `order`, with s = sqrt(|1 - x^2|) given.

    P_l^m = s^m d^m P_l/dx^m, for any complex x; the last axis is l.
    """
    legendre = np.polynomial.legendre
    values = legendre.legvander(x, order)
    # A derivative is a sum of lower polynomials, all with positive factors.
    first, second = (
        values[..., :-m] @ legendre.legder(np.eye(order + 1), m)[:, 1:] * s[..., None] ** m
        for m in (1, 2)
    )
    return values[..., 1:], first, second


def _bessel(order: int, alpha: complex) -> tuple[ComplexArray, ComplexArray]:
    """Return e^x k_l(x) and (x k_l)'/k_l at x = alpha, for l = 1 to `order`."""
    from scipy.special import kve

    orders = np.arange(order + 1)
    k = np.sqrt(2.0 / (np.pi * alpha)) * kve(orders + 0.5, alpha)
    return k[1:], -(alpha * k[:-1] / k[1:] + orders[1:])


def _on_the_sphere(
    order: int, alpha: complex, cosine: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Return each multipole's velocity on the sphere, and that of a sphere moving along x.

    Rows are u_r, u_theta (both times cos phi) and u_phi (times sin phi) at each node; columns
    are grad of the potential, curl curl (r psi) and curl (r chi), in order.
    """
    sine = np.sqrt(1.0 - cosine**2)
    zeroth, first, _ = _legendre(order, cosine, sine)
    orders = np.arange(1, order + 1)
    over_sine = first / sine[:, None]
    slope = orders * (orders + 1) * zeroth - cosine[:, None] * over_sine
    _, growth = _bessel(order, alpha)
    none = np.zeros_like(first)
    potential = np.concatenate([-(orders + 1) * first, slope, -over_sine])
    poloidal = np.concatenate([orders * (orders + 1) * first, growth * slope, -growth * over_sine])
    toroidal = np.concatenate([none, over_sine, -slope])
    target = np.concatenate([sine, cosine, -np.ones_like(sine)])
    return np.concatenate([potential, poloidal, toroidal], axis=1), target


def _sent_back(
    order: int,
    alpha: complex,
    cosine: FloatArray,
    floor: float,
    above: float | None,
    surface: Surface,
) -> ComplexArray:
    """Return what the planes send back to the sphere of each multipole; rows as on the sphere.

    A plane wave has a vertical velocity w J_1(k rho) cos phi, and a horizontal one
    u_x = p J_0 + q J_2 cos 2 phi, u_y = q J_2 sin 2 phi. With d = q - p and t = q + p
    continuity is k d + dw/dz = 0, and t, alone, is the part without divergence.
    """
    from scipy import special

    k, weight = _wave_numbers(min(floor, above or floor) - 1.0)
    gamma = np.sqrt(k**2 + alpha**2)
    amplitudes = _reflected(order, alpha, k, gamma, floor, above, surface)
    sine = np.sqrt(1.0 - cosine**2)
    rho = np.outer(sine, k)
    j0, j1 = special.j0(rho), special.j1(rho)
    j2 = 2.0 * j1 / np.maximum(rho, 1e-12) - j0
    up, even, odd = (np.zeros((cosine.size, 3 * order), dtype=np.complex128) for _ in range(3))
    for distance, sign, waves in amplitudes:
        away = (distance - sign * cosine)[:, None]
        potential, vortical = np.exp(-away * k), np.exp(-away * gamma)
        # A wave from below (sign -1) decays upwards: dw/dz = -k w, so d = w.
        flat, curled, across = (weight[:, None] * wave for wave in waves)
        up += _sum(potential * j1, flat) + (k / gamma * vortical * j1) @ curled
        flat, curled = sign * flat, sign * curled
        even += (_sum(potential * j0, flat) + (vortical * j0) @ (curled + across)) / 2.0
        odd += ((vortical * j2) @ (across - curled) - _sum(potential * j2, flat)) / 2.0
    along, sine, cosine = even + odd, sine[:, None], cosine[:, None]
    radial, polar = along * sine + up * cosine, along * cosine - up * sine
    return np.concatenate([radial, polar, odd - even])


def _sum(factors: FloatArray, waves: ComplexArray) -> ComplexArray:
    """Their product: real factors times complex waves, without making these complex too."""
    return (factors @ np.ascontiguousarray(waves).view(np.float64)).view(np.complex128)


def _wave_numbers(gap: float) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights for integrals over k from 0 to where e^{-2 k gap} is nothing."""
    # As 48 nodes in 24 parts, to 1e-8 of the force at a gap of 0.5 % of the radius, 1e-13 at 10 %.
    node, weight = np.polynomial.legendre.leggauss(12)
    edges = np.concatenate([[0.0], np.geomspace(0.05, _DECAY / (2.0 * gap), 14)])
    width = np.diff(edges)[:, None]
    k = edges[:-1, None] + width * (node + 1.0) / 2.0
    return k.ravel(), (width * weight / 2.0).ravel()


def _plane_waves(
    order: int, alpha: complex, k: FloatArray, gamma: ComplexArray, distance: float, sign: float
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return w, d and t of each multipole on the plane above (sign 1) or below (-1) the sphere.

    P_l^m/r^{l+1} is the integral of k^l e^{-k |z|} J_m(k rho)/(l-m)! over k, and
    k_l(alpha r) P_l^m that of k/(alpha gamma) P_l^m(gamma/alpha) e^{-gamma |z|} J_m(k rho).
    """
    from scipy.special import gammaln

    orders = np.arange(1, order + 1)
    parity = sign**orders
    scaled, _ = _bessel(order, alpha)
    zeroth, first, second = _legendre(order, gamma / alpha, k / alpha)
    zeroth = parity * orders * (orders + 1) * zeroth
    first, second = sign * parity * first, parity * second
    k, gamma = k[:, None], gamma[:, None]
    flat = sign * parity * np.exp(orders * np.log(k) - gammaln(orders) - k * distance)
    curled = k / (alpha * gamma) * np.exp(alpha - gamma * distance) / scaled
    none = np.zeros_like(curled)
    w = [-sign * k * flat, k * (zeroth + second) / 2.0 * curled, -first * curled]
    d = [-k * flat, sign * gamma * (second + zeroth) / 2.0 * curled, (second - zeroth) / 2 * curled]
    t = [
        none,
        (k * first + sign * gamma * (second - zeroth) / 2.0) * curled,
        (second + zeroth) / 2.0 * curled,
    ]
    return tuple(np.concatenate(part, axis=1) for part in (w, d, t))  # type: ignore[return-value]


def _reflected(
    order: int,
    alpha: complex,
    k: FloatArray,
    gamma: ComplexArray,
    floor: float,
    above: float | None,
    surface: Surface,
) -> list[tuple[float, float, tuple[Any, Any, Any]]]:
    """Return the waves that each plane sends out: potential, vortical and transverse amplitudes.

    Potential waves have w = 1 and |d| = 1 at their plane, vortical ones w = k/gamma and |d| = 1.
    """
    planes = [(floor, -1.0, "film")] + ([] if above is None else [(above, 1.0, surface)])
    count, size = len(planes), 3 * order
    matrix = np.zeros((k.size, 2 * count, 2 * count), dtype=np.complex128)
    across = np.zeros((k.size, count, count), dtype=np.complex128)
    right = np.zeros((k.size, 2 * count, size), dtype=np.complex128)
    right_across = np.zeros((k.size, count, size), dtype=np.complex128)
    gap = floor + (above or 0.0)

    def conditions(kind: str, w: Any, d: Any, t: Any, rate: Any) -> tuple[Any, Any, Any]:
        """Return what has to vanish on a plane; `rate` is d/dz."""
        wave = k[:, None]
        return (w, d, t) if kind == "film" else (w, rate * d / wave, rate * t / wave)

    rates = np.stack([k.astype(complex), gamma], axis=1)
    of_column = np.repeat([0, 1, 1], order)
    for row, (distance, side, kind) in enumerate(planes):
        for column, (_, sign, _) in enumerate(planes):
            fade = np.exp(-rates * gap) if row != column else np.ones_like(rates)
            w = np.stack([np.ones_like(gamma), k / gamma], axis=1) * fade
            vertical, along, turned = conditions(kind, w, -sign * fade, fade[:, 1:], sign * rates)
            matrix[:, 2 * row, 2 * column : 2 * column + 2] = vertical
            matrix[:, 2 * row + 1, 2 * column : 2 * column + 2] = along
            # The transverse wave is vortical.
            across[:, row, column] = turned[:, -1]
        incoming = _plane_waves(order, alpha, k, gamma, distance, side)
        found = conditions(kind, *incoming, -side * rates[:, of_column])
        right[:, 2 * row], right[:, 2 * row + 1], right_across[:, row] = (-each for each in found)
    waves = np.linalg.solve(matrix, right)
    turned = np.linalg.solve(across, right_across)
    return [
        (distance, sign, (waves[:, 2 * row], waves[:, 2 * row + 1], turned[:, row]))
        for row, (distance, sign, _) in enumerate(planes)
    ]
