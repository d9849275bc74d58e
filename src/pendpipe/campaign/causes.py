"""What each cause alone would do to the records in the fluid, beside what was measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendpipe.campaign.diagnose import CampaignSearch
from pendpipe.campaign.fit import candidates, predict

_STEP = 1e-3
"""Of a size, in what is expected of it: the patterns are those of small sizes."""


def causes(search: CampaignSearch) -> dict[str, Any]:
    """Patterns over the records in the fluid, as excesses of the viscous loss over Eq. 16.

    Inputs are taken as configured, the loss torque as fitted. Each cause is given the size that
    follows the measured excess best, whether that size is believable or not; its joint fit, which
    knows priors and frequencies, says whether it is in the class.

    Returns
    -------
    dict
        ``records`` (name, frequency, excess measured and its sd from b), and ``causes``: for each
        its size, what it predicts, rms of what it leaves, and by how much chi^2 of the joint fit
        exceeds the best one's (None where nothing was found).
    """
    fit = search.improved
    design, count = fit.design, len(fit.design.nuisances)
    free = np.where(design.has_prior, 0.0, fit.unknowns[:count])
    wet = np.flatnonzero(design.wet > 0.0)
    plain = predict(design, (), free)
    solid = np.exp(-design.inputs(free).log_coefficient) * np.pi / plain[:, 0]
    viscous = (plain[:, 1] - solid)[wet]
    measured = fit.data.values[wet, 1]
    excess = (measured - plain[wet, 1]) / viscous
    sd = 1.0 / np.linalg.norm(fit.data.whitening[wet, :, 1], axis=-1) / viscous
    members = [
        rival
        for found in search.found[:1]
        for rival in (found.leader, *(rival for rival, _ in found.rivals))
    ]
    best = min((rival.fit.chi2 for rival in members), default=0.0)
    above = search.excluded | {
        rival.candidate.effect.identifier: rival.fit.chi2 - best for rival in members
    }
    rows: dict[str, dict[str, Any]] = {}
    for one in candidates(design):
        moved = predict(design, (one,), np.append(free, _STEP))
        pattern = (moved - plain)[wet, 1] / viscous / _STEP
        square = float(pattern @ pattern)
        if not square > 0.0:
            continue
        units = float(pattern @ excess) / square
        left = float(np.sqrt(np.mean((excess - units * pattern) ** 2)))
        name = one.effect.identifier
        if name in rows and rows[name]["rms_left"] <= left:
            continue
        rows[name] = {
            "id": name,
            "name": one.effect.name,
            "size": units * one.effect.expected,
            "parameter": one.effect.parameter.name,
            "unit": one.effect.parameter.unit,
            "possible": one.bounds[0] <= units <= one.bounds[1],
            "excess": (units * pattern).tolist(),
            "rms_left": left,
            "chi2_above_best": above.get(name),
            "in_class": name in above and name not in search.excluded,
        }
    return {
        "records": [
            {
                "record": design.runs[number].record,
                "branch": design.runs[number].branch,
                "frequency_hz": float(fit.data.values[number, 0]),
                "excess": float(value),
                "sd": float(spread),
            }
            for number, value, spread in zip(wet, excess, sd, strict=True)
        ],
        "causes": sorted(rows.values(), key=lambda row: row["rms_left"]),
    }
