"""The answer about a campaign: campaign_diagnosis.json and its paragraph."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pendpipe.campaign.causes import causes
from pendpipe.campaign.diagnose import CampaignSearch, Found, Rival, held_out
from pendpipe.campaign.fit import JointFit
from pendpipe.campaign.next_measurement import NextRun, next_measurements
from pendpipe.estimate import chi_square_p_value
from pendpipe.quantities import with_error

BASELINE = "eq16"
"""Eq. 16 with the exact root, the priors of the configuration and the loss torque."""


def campaign_diagnosis(search: CampaignSearch, provenance: dict[str, Any]) -> dict[str, Any]:
    """Return the content of campaign_diagnosis.json: the keys of diagnosis.json, and more.

    Added are ``baseline.chi2`` and ``improved.chi2``; for each effect ``rivals`` (values and chi^2
    of its class) and ``next_measurements``; for the campaign ``excluded``, ``records`` and
    ``patterns`` (`causes`).
    """
    ranked = [
        next_measurements(
            found.leader.fit,
            {rival.candidate.effect.identifier: rival.fit for rival, _ in found.rivals},
        )
        for found in search.found
    ]
    before, _ = held_out(search.baseline)
    after, pulls = held_out(search.improved)
    gain = after - before
    left = chi_square_p_value(search.improved.chi2, search.improved.degrees_of_freedom)
    effects = [
        _effect(search, found, runs) for found, runs in zip(search.found, ranked, strict=True)
    ]
    if search.missing and not effects:
        effects = [_unnamed(search)]
    return {
        "schema_version": 1,
        "baseline": {"name": BASELINE, **_fit(search.baseline)},
        "noise_rms_rad": None,
        "verdict": "missing-physics" if search.missing else "consistent",
        "p_value": search.p_value,
        "effects": effects,
        "improved": _fit(search.improved),
        "held_out": {
            "log_density_before": float(before.sum()),
            "log_density_after": float(after.sum()),
            "gain": float(gain.sum()),
            "gain_sd": float(np.sqrt(len(gain) * gain.var())),
        },
        "unexplained": {"residual_rms_rad": None, "p_value": left},
        "excluded": search.excluded,
        "patterns": causes(search),
        "records": [
            {"record": run.record, "pull_from_the_others": float(pull)}
            for run, pull in zip(search.improved.design.runs, pulls, strict=True)
        ],
        "statement": statement(search, ranked),
        "figures": [],
        "warnings": [],
        "provenance": provenance,
    }


def _fit(fit: JointFit) -> dict[str, Any]:
    """A joint fit in the form of diagnosis.json: parameters, chi^2."""
    parameters = {
        each.name: fit.estimate(number, each.unit, float(fit.design.sds[number])).as_json()
        for number, each in enumerate(fit.design.nuisances)
    }
    parameters |= {
        one.effect.identifier: fit.size(position).as_json()
        for position, one in enumerate(fit.added)
    }
    off = (fit.prediction / fit.data.values - 1.0)[:, 1]
    return {
        "parameters": parameters,
        "residual_rms_rad": None,
        "residual_rms_of_b": float(np.sqrt(np.mean(off**2))),
        "chi2": fit.chi2,
        "chi2_per_dof": fit.chi2 / max(fit.degrees_of_freedom, 1),
    }


def _effect(search: CampaignSearch, found: Found, runs: Sequence[NextRun]) -> dict[str, Any]:
    effect = found.leader.candidate.effect
    return {
        "id": effect.identifier,
        "name": effect.name,
        "kind": "campaign",
        "equation": effect.equation,
        "parameters": _parameters(found.leader),
        "delta_chi2": found.delta_chi2,
        "p_value_global": found.p_value,
        "probability": found.probability,
        "indistinguishable_from": [
            {"id": rival.candidate.effect.identifier, "probability": probability}
            for rival, probability in found.rivals
        ],
        "rivals": [
            {
                "id": rival.candidate.effect.identifier,
                "parameters": _parameters(rival),
                "chi2_above_best": rival.fit.chi2 - found.leader.fit.chi2,
            }
            for rival, _ in found.rivals
        ],
        "deciding_measurement": _deciding(runs),
        "next_measurements": [
            {"measurement": run.what, "sigma": run.worst, "rivals": run.then, "now": run.now}
            for run in runs
        ],
        "location": _location(search),
    }


def _parameters(rival: Rival) -> dict[str, Any]:
    name = rival.candidate.effect.parameter.name
    found = {name: rival.fit.size(rival.position).as_json()}
    if rival.candidate.shape is not None:
        shape = rival.candidate.shape
        found[name]["of"] = " ".join(shape) if isinstance(shape, tuple) else shape
    return found


def _unnamed(search: CampaignSearch) -> dict[str, Any]:
    """What no entry explains: the records that differ from the rest, in sigma."""
    _, pulls = held_out(search.baseline)
    far = sorted(
        zip(pulls.tolist(), (run.record for run in search.baseline.design.runs), strict=True),
        key=lambda pair: -abs(pair[0]),
    )[:3]
    summary = "; ".join(f"{name} by {pull:+.1f} sigma" for pull, name in far)
    return {
        "id": "unnamed-damping",
        "name": "records that disagree, by nothing that the catalogue has",
        "kind": "unnamed",
        "equation": r"b \to b + \Delta b(\text{record})",
        "parameters": {},
        "delta_chi2": search.baseline.chi2 - search.baseline.degrees_of_freedom,
        "p_value_global": search.p_value,
        "probability": 1.0,
        "indistinguishable_from": [],
        "deciding_measurement": "take the records anew that the others predict worst",
        "location": _location(search) | {"summary": f"worst predicted by the others: {summary}"},
    }


def _location(search: CampaignSearch) -> dict[str, Any]:
    """The band of frequencies in which b changes most between the two fits."""
    moved = np.abs(search.improved.prediction / search.baseline.prediction - 1.0)[:, 1]
    frequency = search.baseline.data.values[:, 0]
    most = moved >= 0.5 * moved.max()
    low, high = float(frequency[most].min()), float(frequency[most].max())
    return {
        "summary": f"the records between {low:.3g} and {high:.3g} Hz",
        "time_s": None,
        "amplitude_rad": None,
        "phase_rad": None,
        "frequency_hz": [low, high],
        "harmonics": [],
        "adc_codes": [],
    }


def _deciding(runs: Sequence[NextRun]) -> str:
    if not runs:
        return "none is needed: no other effect of the catalogue fits as well"
    best = runs[0]
    apart = ", ".join(f"{name} by {sigma:.1f} sigma" for name, sigma in best.then.items())
    return f"{best.what}: it would reject {apart}"


def _share(probability: float) -> str:
    return f"{probability:.0%}" if probability >= 0.01 else "below 1%"


def _chance(p_value: float) -> str:
    return f"p = {p_value:.2g}" if p_value >= 1e-12 else "p < 1e-12"


def statement(search: CampaignSearch, ranked: Sequence[Sequence[NextRun]]) -> str:
    """One paragraph of plain English."""
    count = len(search.baseline.design.runs)
    chance = _chance(search.p_value)
    if not search.missing:
        return (
            f"The {count} records agree with Eq. 16, the loss torque and the stated errors of the"
            f" apparatus (global {chance})."
        )
    if not search.found:
        return (
            f"The {count} records do not agree with Eq. 16 and the stated errors of the apparatus"
            f" (global {chance}), and no effect of the catalogue explains how they differ."
        )
    words = [
        f"The {count} records do not agree with Eq. 16 and the stated errors of the apparatus"
        f" (global {chance})."
    ]
    for found, runs in zip(search.found, ranked, strict=True):
        effect = found.leader.candidate.effect
        size = found.leader.fit.size(found.leader.position)
        words.append(
            f"Most probable is {effect.name} ({effect.parameter.name.replace('_', ' ')}"
            f" {with_error(size.value, size.sd, size.unit)});"
            f" chi^2 falls by {found.delta_chi2:.0f}."
        )
        if found.rivals:
            names = ", ".join(
                f"{rival.candidate.effect.name} ({_share(probability)})"
                for rival, probability in found.rivals
            )
            words.append(f"These records cannot tell it from {names}.")
            words.append(f"What would decide is {_deciding(runs)}.")
    left = chi_square_p_value(search.improved.chi2, search.improved.degrees_of_freedom)
    if left < 0.01:
        words.append(f"Something is left that this does not explain ({_chance(left)}).")
    return " ".join(words)
