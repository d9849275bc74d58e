"""A sphere in the told tank: what walls, floor and surface do to its drag.

`confined` is a smooth function of how close they are, which the search for what is missing fits;
`told` is the drag in the tank as it is told, with the uncertainty of the depth and of the place.
"""

from functools import cache
from typing import Final, Literal, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.configuration.apparatus import in_tank
from pendpipe.configuration.models import Tank

Surface = Literal["slip", "film"]
_SURFACES: Final[dict[str, Surface]] = {"clean": "slip", "film": "film"}
CLOSENESS: Final = np.array([0.03, 0.08, 0.16, 0.28, 0.42, 0.5])
"""(2 a/H)^3 of the tanks that are computed; 0.44 is the paper's 3.8 cm in 5 cm."""
DEPTHS: Final = np.array([0.02, 0.06, 0.14, 0.3])
"""Penetration depths, in radii: those of water between 1 Hz and 0.05 Hz, and of glycerol."""
_FEW_NEAR: Final = CLOSENESS[[0, 2, 3, 5]]
"""Of `CLOSENESS`: see `_FEW_DEPTHS`."""
_FEW_DEPTHS: Final = DEPTHS[::3]
"""Those at which other heights are computed, which change less."""


_RADIUS_M: Final = 0.01
"""Of the sphere for which tanks are computed: only proportions count."""


def confined(
    tank: Tank,
    film: FloatArray | float,
    closeness: FloatArray,
    depth: FloatArray,
    higher: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Drag over that of Eq. 2, and added mass above that without walls.

    Tanks of the given one's proportions, from far away (closeness 0) to close: the excesses are a
    polynomial in the closeness and in delta/a that goes through `physics.sphere_in_tank`, and a
    parabola in the height of the sphere.

    Parameters
    ----------
    tank
        Its proportions, and where the sphere hangs in it.
    film
        0 under a level surface that is clean, 1 under a film (a lid, or a contaminated surface); in
        between for a share of both. It broadcasts as the others do.
    closeness
        (2 a/H)^3 with H the depth of the fluid; walls nearer than the closest computed count
        as these.
    depth
        delta/a; broadcasts with the closeness.
    higher
        Height of the sphere above the configured one, in depths of the fluid; broadcasts too.

    Returns
    -------
    drag, mass
        The drag's factor; the added mass less ``1/2 + 9 delta/(4 a)``, in the displaced fluid.
    """
    nodes, scale = _nodes(tank), _closest(tank)
    near, thick = np.broadcast_arrays(np.minimum(closeness / scale, 1.0), depth)
    proportions = tuple(
        size / tank.depth_m for size in (tank.length_m, tank.width_m, tank.off_centre_m)
    )
    whole = _table(proportions, nodes[1], scale)
    excess = _powers(near, thick, len(CLOSENESS), len(DEPTHS)) @ whole
    up = np.asarray(higher) / max(nodes[1] - nodes[0], 1e-9)
    # Lagrange's parabola through three heights; the middle one is `whole`.
    for weight, height in ((up * (up - 1.0) / 2.0, nodes[0]), (up * (up + 1.0) / 2.0, nodes[2])):
        if np.any(weight):
            moved = _moved(proportions, (nodes[1], height), scale)
            rows = _powers(near, thick, len(_FEW_NEAR), len(_FEW_DEPTHS))
            excess = excess + weight[..., None] * (rows @ moved)
    clean, covered = excess[..., :2], excess[..., 2:]
    mixed = clean + np.asarray(film)[..., None] * (covered - clean)
    return np.asarray(1.0 + mixed[..., 0]), np.asarray(mixed[..., 1])


def height_sd(tank: Tank) -> float:
    """Standard uncertainty of the sphere's height in depths of the fluid.

    Half the depth stays half the depth, however deep the fluid is.
    """
    height = 0.0 if tank.height_m is None else tank.height_m
    return float(np.hypot(tank.height_sd_m, height / tank.depth_m * tank.depth_sd_m)) / tank.depth_m


def _nodes(tank: Tank) -> tuple[float, float, float]:
    """The heights that are computed, in depths: the configured one, and one sd to each side."""
    height = 0.5 if tank.height_m is None else tank.height_m / tank.depth_m
    step = min(height_sd(tank), 0.2 * min(height, 1.0 - height))
    return height - step, height, height + step


def _closest(tank: Tank) -> float:
    """The largest closeness at which floor, surface and side walls are outside the sphere."""
    nodes = _nodes(tank)
    aside = (0.5 * tank.width_m - tank.off_centre_m) / tank.depth_m
    ahead = 0.5 * tank.length_m / tank.depth_m
    room = 2.0 * min(nodes[0], 1.0 - nodes[-1], aside, ahead)
    return float(min(CLOSENESS[-1], (0.95 * room) ** 3))


def _powers(closeness: FloatArray, depth: FloatArray, nears: int, depths: int) -> FloatArray:
    """The polynomial's terms: every one has the closeness as a factor."""
    rows = np.polynomial.polynomial.polyvander2d(closeness, depth, [nears, depths - 1])
    return np.asarray(rows[..., depths:], dtype=np.float64)


@cache
def _table(proportions: tuple[float, ...], height: float, closest: float) -> FloatArray:
    """Coefficients of the columns of `_excess`; sizes in depths of the fluid."""
    near, depth = (each.ravel() for each in np.meshgrid(CLOSENESS / CLOSENESS[-1], DEPTHS))
    found = _excess(proportions, height, closest * near, depth)
    return np.asarray(np.linalg.solve(_powers(near, depth, len(CLOSENESS), len(DEPTHS)), found))


@cache
def _moved(
    proportions: tuple[float, ...], heights: tuple[float, float], closest: float
) -> FloatArray:
    """Coefficients of their change from one height to another, at fewer nodes."""
    near, depth = (each.ravel() for each in np.meshgrid(_FEW_NEAR / CLOSENESS[-1], _FEW_DEPTHS))
    before = _powers(near, depth, len(CLOSENESS), len(DEPTHS)) @ _table(
        proportions, heights[0], closest
    )
    after = _excess(proportions, heights[1], closest * near, depth)
    rows = _powers(near, depth, len(_FEW_NEAR), len(_FEW_DEPTHS))
    return np.asarray(np.linalg.solve(rows, after - before))


def _excess(
    proportions: tuple[float, ...],
    height: float,
    closeness: FloatArray,
    depth: FloatArray,
) -> FloatArray:
    """Excess of drag and added mass, under a clean surface and a film; shape (tanks, 4)."""
    length, width, aside = proportions
    found = []
    for close, delta in zip(closeness.tolist(), depth.tolist(), strict=True):
        deep = 2.0 * close ** (-1.0 / 3.0) * _RADIUS_M
        tank = Tank(
            length_m=length * deep,
            width_m=width * deep,
            depth_m=deep,
            height_m=height * deep,
            off_centre_m=aside * deep,
        )
        clean, film = (
            in_tank(tank, _RADIUS_M, delta * _RADIUS_M, each) for each in _SURFACES.values()
        )
        free = in_tank(None, _RADIUS_M, delta * _RADIUS_M).added_mass_coefficient
        found.append(
            (
                *(clean.drag_factor - 1.0, clean.added_mass_coefficient - free),
                *(film.drag_factor - 1.0, film.added_mass_coefficient - free),
            )
        )
    return np.array(found)


class Told(NamedTuple):
    """The drag in a tank over that of Eq. 2, and its standard uncertainty."""

    factor: FloatArray
    sd: FloatArray


def told(tank: Tank, radius_m: float, penetration_m: FloatArray) -> Told:
    """Return what the walls of a tank do to the drag, as the tank is told.

    The factor is the mean of a clean surface and of a film, which are equally probable; its
    variance is that of the two, of the depth and of the sphere's height.

    Parameters
    ----------
    tank
        With the standard uncertainties of its depth and of the sphere's height.
    radius_m
        Of the sphere.
    penetration_m
        delta of each record, shape (records,).

    Raises
    ------
    ValueError
        The sphere has no room in it.
    """
    # Up to walls that a standard deviation more would touch.
    far = 0.5 * room_m(tank, radius_m)
    higher_m, deeper_m = min(tank.height_sd_m, far), min(tank.depth_sd_m, far)
    nodes = np.unique(np.quantile(penetration_m, [0.0, 0.5, 1.0]))

    def drag(surface: Surface, deeper_m: float = 0.0, higher_m: float = 0.0) -> FloatArray:
        found = [_drag(tank, radius_m, each, surface, deeper_m, higher_m) for each in nodes]
        # The force is a polynomial of the second degree in delta, but for a few per mille.
        return np.asarray(np.polyval(np.polyfit(nodes, found, len(nodes) - 1), penetration_m))

    clean, film = drag("slip"), drag("film")
    deeper = 0.5 * (drag("film", -deeper_m) - drag("film", deeper_m))
    higher = drag("film", higher_m=higher_m) - film
    return Told(0.5 * (clean + film), np.sqrt(0.25 * (film - clean) ** 2 + deeper**2 + higher**2))


def room_m(tank: Tank, radius_m: float) -> float:
    """Return what is free between the sphere and the nearest wall, floor or surface, in m."""
    height = 0.5 * tank.depth_m if tank.height_m is None else tank.height_m
    aside = 0.5 * tank.width_m - tank.off_centre_m
    return min(height, tank.depth_m - height, aside, 0.5 * tank.length_m) - radius_m


def by_depth(tank: Tank, radius_m: float, penetration_m: float) -> dict[str, list[float]]:
    """Return the least drag over that of Eq. 2 against the depth of the fluid.

    The sphere hangs half way up, where it is the least; ``clean`` and ``film`` say of what surface.
    """
    middle = tank.model_copy(update={"height_m": None})
    depths = np.geomspace(2.15, 6.0, 24) * radius_m
    found = {
        name: [
            _drag(middle, radius_m, penetration_m, surface, depth - tank.depth_m)
            for depth in depths.tolist()
        ]
        for name, surface in _SURFACES.items()
    }
    return {"depth_m": depths.tolist(), **found}


def _drag(
    tank: Tank,
    radius_m: float,
    penetration_m: float,
    surface: Surface,
    deeper_m: float = 0.0,
    higher_m: float = 0.0,
) -> float:
    """Drag over that of Eq. 2, with more fluid in the tank and the sphere higher up."""
    return in_tank(tank, radius_m, penetration_m, surface, deeper_m, higher_m).drag_factor
