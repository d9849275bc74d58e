"""Drag and added mass in a tank against how close its walls are, as smooth functions."""

from __future__ import annotations

from functools import cache
from typing import Final, Literal

import numpy as np

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.configuration.models import Tank

Surface = Literal["slip", "film"]
CLOSENESS: Final = np.array([0.03, 0.08, 0.16, 0.28, 0.42, 0.5])
"""(2 a/H)^3 of the tanks that are computed; 0.44 is the paper's 3.8 cm in 5 cm."""
DEPTHS: Final = np.array([0.02, 0.06, 0.14, 0.3])
"""Penetration depths, in radii: those of water between 1 Hz and 0.05 Hz, and of glycerol."""
_ORDER: Final = 10
"""Of the multipoles: 1e-5 of the force at the closest walls."""


def confined(
    tank: Tank, surface: Surface, closeness: FloatArray, depth: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Drag over that of Eq. 2, and added mass above that without walls.

    Tanks of the given one's proportions, from far away (closeness 0) to close: the excesses are a
    polynomial in the closeness and in delta/a that goes through `physics.sphere_in_tank`.

    Parameters
    ----------
    tank
        Its proportions, and where the sphere hangs in it.
    surface
        ``"slip"`` (a level surface that is clean) or ``"film"`` (a lid, or a contaminated one).
    closeness
        (2 a/H)^3 with H the depth of the fluid.
    depth
        delta/a; broadcasts with the closeness.

    Returns
    -------
    drag, mass
        The drag's factor; the added mass less ``1/2 + 9 delta/(4 a)``, in the displaced fluid.
    """
    height = 0.5 if tank.height_m is None else tank.height_m / tank.depth_m
    shape = tank.length_m / tank.depth_m, tank.width_m / tank.depth_m, height
    rows = _powers(*np.broadcast_arrays(closeness, depth))
    drag, mass = (rows @ column for column in _table(surface, *shape).T)
    return 1.0 + drag, mass


def _powers(closeness: FloatArray, depth: FloatArray) -> FloatArray:
    """The polynomial's terms: every one has the closeness as a factor."""
    near = [closeness**power for power in range(1, len(CLOSENESS) + 1)]
    thick = [depth**power for power in range(len(DEPTHS))]
    return np.stack([one * other for one in near for other in thick], axis=-1)


@cache
def _table(surface: Surface, length: float, width: float, height: float) -> FloatArray:
    """Coefficients of the drag's and the added mass's excess; sizes in depths of the fluid."""
    near, depth = (each.ravel() for each in np.meshgrid(CLOSENESS, DEPTHS))
    found = []
    for close, delta in zip(near.tolist(), depth.tolist(), strict=True):
        deep = 2.0 * close ** (-1.0 / 3.0)  # in radii
        force = physics.sphere_in_tank(
            1.0,
            height * deep,
            delta,
            surface_m=(1.0 - height) * deep,
            length_m=length * deep,
            width_m=width * deep,
            surface=surface,
            order=_ORDER,
        )
        free = physics.POTENTIAL_FLOW_ADDED_MASS + 2.25 * delta
        found.append((force.drag_factor - 1.0, force.added_mass_coefficient - free))
    return np.asarray(np.linalg.solve(_powers(near, depth), np.array(found)))
