"""The campaign's numbers from all its records at once, beside those of the paper's route."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design
from pendpipe.campaign.fit import JointFit, Measured, joint_fit, named
from pendpipe.campaign.prediction import terms_of
from pendpipe.estimate import Estimate, chi_square_p_value
from pendpipe.physics import POTENTIAL_FLOW_ADDED_MASS


def only(design: Design, data: Measured, keep: BoolArray) -> tuple[Design, Measured]:
    """The chosen records; shape of `keep` (records,), boolean."""
    chosen = np.flatnonzero(keep)
    runs = tuple(design.runs[number] for number in chosen)
    return replace(design, runs=runs), Measured(data.values[chosen], data.whitening[chosen])


def joint_values(design: Design, data: Measured) -> dict[str, Any]:
    """k, loss torques, drag factor, C_H and added mass, with and without the benchmark.

    Returns
    -------
    dict
        ``with_benchmark`` and ``without_benchmark`` (None where it cannot be fitted), each with
        estimates and the chi^2 of its fits; the form of campaign.json.
    """
    wet = design.wet > 0.0
    alone = _values(*only(design, data, wet)) if not wet.all() and wet.sum() > 1 else None
    return {"with_benchmark": _values(design, data), "without_benchmark": alone}


def _values(design: Design, data: Measured) -> dict[str, Any]:
    plain = joint_fit(design, data)
    factor, history, both = (
        joint_fit(design, data, named(*added), plain.unknowns)
        for added in (
            ("uniform-drag-excess",),
            ("history-term",),
            ("uniform-drag-excess", "added-mass"),
        )
    )
    return {
        "hysteretic_coefficient": coefficient(factor).as_json(),
        "loss_torque": {name: each.as_json() for name, each in loss_torques(factor).items()},
        "drag_factor": _above(factor.size(0), 1.0).as_json(),
        "history_coefficient": _above(history.size(0), 1.0).as_json(),
        "added_mass_coefficient": _above(both.size(1), POTENTIAL_FLOW_ADDED_MASS).as_json(),
        "fits": {
            name: {
                "chi2": fit.chi2,
                "dof": fit.degrees_of_freedom,
                "p_value": chi_square_p_value(fit.chi2, fit.degrees_of_freedom),
            }
            for name, fit in (("eq16", plain), ("drag_factor", factor), ("history", history))
        },
    }


def _above(size: Estimate, about: float) -> Estimate:
    return Estimate(about + size.value, size.sd, "")


def coefficient(fit: JointFit) -> Estimate:
    """Return k of ``Q_hys = k f^2`` at the reference inertia, of the first assembly."""
    value = fit.design.coefficient_s2 * float(np.exp(fit.unknowns[0]))
    return Estimate(value, value * float(np.sqrt(fit.covariance[0, 0])), "s^2")


def loss_torques(fit: JointFit) -> dict[str, Estimate]:
    """Return kappa'' of each assembly at the reference inertia, ``4 pi^2 I_0/k``."""
    design = fit.design
    index = {each.name: number for number, each in enumerate(design.nuisances)}
    found = {}
    for name in design.assemblies:
        slope = np.zeros(len(fit.unknowns))
        slope[0] = -1.0
        if f"loss torque in {name}" in index:
            number = index[f"loss torque in {name}"]
            slope[number] = design.sds[number]
        log = float(slope @ fit.unknowns) - np.log(design.coefficient_s2)
        value = 4.0 * np.pi**2 * design.reference_inertia * float(np.exp(log))
        sd = value * float(np.sqrt(slope @ fit.covariance @ slope))
        found[name] = Estimate(value, sd, "N m/rad")
    return found


def inertia_errors(design: Design) -> tuple[FloatArray, FloatArray]:
    """Standard deviations of I from what is measured of the apparatus, correlated over records.

    Returns
    -------
    from_distances, from_frequency
        Changes of I (with its added mass), relative, for one sd of each nuisance, shape
        (nuisances, records): from distances and masses, and as ``K/omega^2`` of a measured
        frequency. The covariance over the records is ``x.T @ x``.
    """
    steps = 0.01 * np.eye(len(design.nuisances))
    ends = [terms_of(design, design.inputs(sign * steps)) for sign in (1.0, -1.0)]
    torques = [np.log(end.torque) for end in ends]
    inertias = [np.log(end.torque / end.angular_frequency**2) for end in ends]
    known = design.has_prior[:, None]
    return (
        known * (inertias[0] - inertias[1]) / 0.02,
        known * (torques[0] - torques[1]) / 0.02,
    )


class InertiaSds(NamedTuple):
    """Relative standard deviations of one record's moment of inertia.

    Parameters
    ----------
    own, common
        From distances and masses: what its own clamps add, and what all records share.
    from_frequency
        As ``K/omega^2`` of an exact frequency.
    """

    own: float
    common: float
    from_frequency: float


def inertia_sds(design: Design) -> dict[str, InertiaSds]:
    """Return the errors of `inertia_errors` by record."""
    distances, frequency = inertia_errors(design)
    clamp = np.array([each.name.startswith("distance of") for each in design.nuisances])
    columns = (distances[clamp], distances[~clamp], frequency)
    sds = np.array([np.sqrt(np.sum(each**2, axis=0)) for each in columns]).T.tolist()
    return {run.record: InertiaSds(*each) for run, each in zip(design.runs, sds, strict=True)}
