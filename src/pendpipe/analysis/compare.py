"""What theory says of one pendulum in its fluid, and how well a decay's shape is told.

Inertia, Eq. 16 and the period's lengthening; Eq. 14 beside a pure exponential, and the trap of
tails.
"""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from pendpipe import physics
from pendpipe.analysis.fit.by_points import fit_envelope, fit_points
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError


def theory_curve(
    parts: Sequence[physics.Part],
    fluid: physics.Fluid,
    gravity_m_per_s2: float,
    *,
    plain_added_mass: bool = False,
) -> dict[str, FloatArray] | None:
    """Theory of a pendulum, or of many: the parts' positions may be arrays.

    Parameters
    ----------
    parts
        The pendulum's parts; one of them a submerged sphere, or there is no theory.
    fluid, gravity_m_per_s2, plain_added_mass
        As in `pendpipe.physics.swing`.

    Returns
    -------
    dict
        Columns of shape (n,) under the names of comparison.json, with Eq. 16's Q_v (C_H = 1) and
        the steady Stokes law's (C_H = 0); ``None`` where nothing is submerged.
    """
    sphere = next((part for part in parts if part.wet_radius_m is not None), None)
    if sphere is None:
        return None
    moving = physics.swing(parts, fluid, gravity_m_per_s2, plain_added_mass=plain_added_mass)
    density, viscosity = fluid
    oscillating, steady = (
        physics.viscous_quality_factor(
            moving.moment_of_inertia_kg_m2,
            moving.angular_frequency_per_s,
            sphere.wet_radius_m,
            sphere.position_m,
            viscosity,
            density,
            history,
        )
        for history in (1.0, 0.0)
    )
    depth = physics.penetration_depth(moving.angular_frequency_per_s, viscosity, density)
    longer = physics.period_lengthening(
        parts, fluid, gravity_m_per_s2, plain_added_mass=plain_added_mass
    )
    columns = {
        "frequency_hz": moving.frequency_hz,
        "moment_of_inertia_kg_m2": moving.moment_of_inertia_kg_m2,
        "quality_factor_viscous_theory": oscillating,
        "quality_factor_viscous_steady": steady,
        "a_over_delta": np.asarray(sphere.wet_radius_m) / depth,
        "lengthening_buoyancy": longer.buoyancy,
        "lengthening_added_mass": longer.added_mass,
        "lengthening_both": longer.both,
    }
    return {name: np.atleast_1d(column) for name, column in columns.items()}


FEWEST_IN_A_TAIL, TAILS = 8, 12


def amplitude_misfit(points: TurningPoints) -> dict[str, float]:
    """Fit the amplitudes with and without a and c; the same points, the same weights.

    Returns
    -------
    dict
        As in comparison.json: what Eq. 14 leaves of the amplitudes (a, b and c together), and
        what an exponential does (b alone, the textbook's linear damping), rms in rad (m).
    """

    def left_by(held: dict[str, float]) -> float:
        return float(np.sqrt(np.mean(fit_envelope(points, held).residual ** 2)))

    return {
        "amplitude_rms_rad": left_by({}),
        "linear_damping_rms_rad": left_by({"a": 0.0, "c": 0.0}),
        "half_cycles": len(points),
    }


def tail_fits(points: TurningPoints) -> list[dict[str, Any]]:
    """Fit ever later parts of a record: the first is the whole of it. As in comparison.json.

    The starts are even in the turning points; the last tail keeps eight. A fit to the tail alone
    depends on where it begins, which the paper warns of: its a is hardly told, and what it takes
    from a it gives to b and c.
    """
    last = len(points) - FEWEST_IN_A_TAIL
    if last < 1:
        return []
    tails = []
    for start in np.unique(np.linspace(0, last, TAILS).astype(np.int64)).tolist():
        part = points.chosen(slice(start, None))
        with suppress(InputError):  # too little is left of it
            found = fit_points(part).parameters
            tails.append(
                {
                    "start_s": float(part.time_s[0] - points.time_s[0]),
                    "amplitude_rad": float(abs(part.angle_rad[0])),
                    **{letter: found[letter].as_json() for letter in "abc"},
                }
            )
    return tails
