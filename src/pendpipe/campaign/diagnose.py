"""The answer about a campaign: campaign_diagnosis.json and its paragraph.

With what is found goes what each cause alone would do to the records.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pendpipe.answer import Answer, percent, printed
from pendpipe.arrays import FloatArray
from pendpipe.campaign.effects import CATALOGUE, WRONG
from pendpipe.campaign.fit import (
    Candidate,
    JointFit,
    candidates,
    coefficient,
    joint_fit,
    loss_torques,
    named,
    predict,
)
from pendpipe.campaign.next_runs import NextRun, next_measurements
from pendpipe.campaign.search import NOTHING_MISSING, CampaignSearch, Found
from pendpipe.campaign.seen import (
    PULLED,
    Excess,
    Far,
    Groups,
    bump,
    groups,
    held_out,
    is_orderly,
    off,
    pulls_of_inputs,
    scatter,
    told_and_measured,
    told_by_frequency,
)
from pendpipe.campaign.values import campaign_values
from pendpipe.diagnosis.found import FoundEffect, Location, Mate
from pendpipe.estimate import LISTED, Estimate, averaged, named_together
from pendpipe.files import plain
from pendpipe.levels import FALSE_ALARM

BASELINE = "eq16"
"""Eq. 16 with the exact root, the priors of the configuration and the loss torque.

Where a tank is told, within its walls.
"""


def campaign_diagnosis(
    search: CampaignSearch, provenance: dict[str, Any], twins: dict[str, str] | None = None
) -> dict[str, Any]:
    """Return the content of campaign_diagnosis.json: the keys of diagnosis.json, and more.

    Added are ``baseline.chi2`` and ``improved.chi2``; for each effect ``rivals`` (values and chi^2
    of its class), ``next_measurements`` and ``probability_of_nothing``; for the campaign
    ``priors``, ``excluded``, ``records``, ``left_out`` (records that disagree with all others,
    with the numbers with and without them), ``patterns`` (`causes`), ``scatter`` (the factor by
    which the records' errors are too small, where that is found), ``described`` and ``seen`` (what
    the records show where the model does not describe them), ``quoted`` (k, and the loss torques),
    and of each fit ``pulls_of_inputs`` in stated errors.

    Parameters
    ----------
    search
        The answer.
    provenance
        As in diagnosis.json.
    twins
        Records that were not counted, and those whose recording they repeat.
    """
    copies = [f"{name} is the same recording as {first}" for name, first in (twins or {}).items()]
    ranked = [
        next_measurements(found.leader, [rival for rival, _ in found.rivals])
        for found in search.found
    ]
    effects = [
        _effect(search, found, runs) for found, runs in zip(search.found, ranked, strict=True)
    ]
    if search.scatter:
        effects.append(_errors(search, search.scatter))
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
        **_predicted(search),
        "unexplained": {"residual_rms_rad": None, "p_value": search.unexplained},
        "described": search.described,
        "scatter": search.scatter and search.scatter.as_json(),
        "seen": seen_in(search),
        "excluded": search.found[0].excluded if search.found else {},
        "patterns": causes(search),
        "left_out": [far._asdict() for far in search.left_out],
        "numbers": {name: _shown(fit) for name, fit in _with_and_without(search).items()},
        "quoted": {
            "hysteretic_coefficient": quoted_coefficient(search).as_json(),
            "loss_torque": {name: each.as_json() for name, each in quoted_torques(search).items()},
        },
        "priors": {
            "nothing_missing": NOTHING_MISSING,
            "expected_size": {name: each.expected for name, each in CATALOGUE.items()},
        },
        "statement": "\n".join(answer_of(search, ranked, copies).lines(width=math.inf)),
        "figures": [],
        "warnings": copies,
        "provenance": provenance,
    }


def _predicted(search: CampaignSearch) -> dict[str, Any]:
    """How well each record is predicted from the others, before and after."""
    before, _ = held_out(search.baseline)
    after, pulls = held_out(search.improved)
    gain, runs = after - before, search.improved.design.runs
    return {
        "held_out": {
            "log_density_before": float(before.sum()),
            "log_density_after": float(after.sum()),
            "gain": float(gain.sum()),
            "gain_sd": float(np.sqrt(len(gain) * gain.var())),
        },
        "records": [
            {"record": run.record, "pull_from_the_others": float(pull)}
            for run, pull in zip(runs, pulls, strict=True)
        ],
    }


def _with_and_without(search: CampaignSearch) -> dict[str, JointFit]:
    """Fits with a drag factor over Eq. 16, of all records and without those that are left out."""
    answers = {"all_records": search.whole}
    if search.left_out:
        answers["without"] = search.baseline
    return {
        name: joint_fit(
            replace(each.design, walls=False),
            each.data,
            named("uniform-drag-excess", "added-mass"),
        )
        for name, each in answers.items()
    }


def quoted_coefficient(search: CampaignSearch) -> Estimate:
    """Return k averaged over the causes that share the probability.

    Each is fitted; so is "nothing" in the place of the last one. What is left to 1 is "none of
    these": the fit with all that was found, its error widened by what it leaves.
    """
    improved = search.improved
    own = coefficient(improved)
    widened = math.sqrt(max(improved.chi2 / max(improved.degrees_of_freedom, 1), 1.0))
    described = list[tuple[float, Estimate]]()
    if search.found:
        last, before = (
            search.found[-1],
            [search.baseline, *(one.leader for one in search.found)][-2],
        )
        fits = [(last.probability, last.leader), (last.nothing, before)]
        fits += [(probability, rival) for rival, probability in last.rivals]
        described = [(probability, coefficient(fit)) for probability, fit in fits]
    rest = max(1.0 - sum(probability for probability, _ in described), 0.0)
    described.append((rest, Estimate(own.value, widened * own.sd, own.unit)))
    counted = [each for each in described if each[0] >= LISTED] or described
    return averaged([each for _, each in counted], [probability for probability, _ in counted])


def changes_drag_law(search: CampaignSearch) -> bool:
    """Whether the fluid's drag may follow another law of the frequency than the theory's."""
    likely = [
        fit.last.drag_law
        for one in search.found
        for fit, share in ((one.leader, one.probability), *one.rivals)
        if share >= LISTED
    ]
    return any(likely) or not search.described


def quoted_torques(search: CampaignSearch) -> dict[str, Estimate]:
    """Return kappa'' of each assembly.

    In a fluid it is what the law of the drag leaves over at low frequencies, where it is most of b.
    Beside another law these are the numbers of the campaign's table, in which the drag of every
    record is free; without a benchmark there are none.
    """
    if not changes_drag_law(search):
        return loss_torques(search.improved)
    values = campaign_values(search.improved.design, search.improved.data)
    return loss_torques(values.fit) if values else {}


def _shown(fit: JointFit) -> dict[str, Any]:
    return {
        "drag_factor": fit.size(0, about=1.0).as_json(),
        "hysteretic_coefficient": coefficient(fit).as_json(),
        "chi2": fit.chi2,
        "dof": fit.degrees_of_freedom,
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
        "pulls_of_inputs": pulls_of_inputs(fit),
        "residual_rms_rad": None,
        "residual_rms_of_b": float(np.sqrt(np.mean(off**2))),
        "chi2": fit.chi2,
        "chi2_per_dof": fit.chi2 / max(fit.degrees_of_freedom, 1),
    }


def _effect(search: CampaignSearch, found: Found, runs: Sequence[NextRun]) -> dict[str, Any]:
    """Return one cause in the form of diagnosis.json, with what only a campaign has of it."""
    effect = found.leader.last
    told = FoundEffect(
        effect.identifier,
        effect.name,
        "campaign",
        effect.equation,
        {},
        found.delta_chi2,
        found.p_value,
        found.probability,
        tuple(Mate(rival.last.identifier, share) for rival, share in found.rivals),
        _deciding(runs),
        _location(search),
    )
    rivals = [
        {
            "id": rival.last.identifier,
            "parameters": _parameters(rival),
            "chi2_above_best": rival.chi2 - found.leader.chi2,
        }
        for rival, _ in found.rivals
    ]
    return {
        **plain(told),
        "parameters": _parameters(found.leader),
        "probability_of_nothing": found.nothing,
        "rivals": rivals,
        "next_measurements": [
            {
                "measurement": run.what,
                "sigma": run.worst,
                "rivals": run.then,
                "now": run.now,
                "would_not_swing": list(run.lost),
                "predicted": {
                    record: {"frequency": f.as_json(), "b": b.as_json()}
                    for record, (f, b) in run.predicted.items()
                },
            }
            for run in runs
        ],
    }


def _parameters(fit: JointFit) -> dict[str, Any]:
    size, shape = fit.size().as_json(), fit.added[-1].shape
    if shape is not None:
        size["of"] = _of(shape)
    return {fit.last.parameter.name: size}


def _errors(search: CampaignSearch, factor: Estimate) -> dict[str, Any]:
    """The records' own errors as a cause: they are larger than is stated."""
    told = FoundEffect(
        "record-errors",
        "larger errors of the records than are stated",
        "campaign",
        r"\sigma \to s\, \sigma",
        {"factor": factor},
        search.baseline.chi2 - search.improved.chi2,
        search.p_value,
        search.scattered,
        (),
        "some records once more: their scatter is their error",
        _location(search),
    )
    return dict(plain(told))


def _of(shape: Any) -> str | float:
    """Print a shape: what it is of, or the frequency and damping ratio of a mode."""
    if isinstance(shape, tuple) and isinstance(shape[0], float):
        return f"{shape[0]:.3g} Hz, damping ratio {shape[1]:.2g}"
    return " ".join(shape) if isinstance(shape, tuple) else shape


def _unnamed(search: CampaignSearch) -> dict[str, Any]:
    """What no entry explains: the records that differ from the rest, in sigma."""
    whole = search.whole
    _, pulls = held_out(whole)
    names = (run.record for run in whole.design.runs)
    pairs = zip(names, pulls.tolist(), strict=True)
    far = search.left_out or sorted((Far(*pair) for pair in pairs), key=lambda one: -abs(one.sigma))
    summary = "; ".join(f"{one.record} by {one.sigma:+.1f} sigma" for one in far[:3])
    left = search.baseline if search.left_out else None
    told = FoundEffect(
        "unnamed-damping",
        "records that disagree, by nothing that the catalogue has",
        "unnamed",
        r"b \to b + \Delta b(\text{record})",
        {},
        whole.chi2 - (left.chi2 if left else whole.degrees_of_freedom),
        search.p_value,
        1.0,
        (),
        "take the records anew that the others predict worst",
        replace(_location(search), summary=f"worst predicted by the others: {summary}"),
    )
    return dict(plain(told))


def _location(search: CampaignSearch) -> Location:
    """The band of frequencies in which b changes most between the two fits."""
    moved = np.abs(search.improved.prediction / search.baseline.prediction - 1.0)[:, 1]
    frequency = search.baseline.data.values[:, 0]
    most = moved >= 0.5 * moved.max()
    band = float(frequency[most].min()), float(frequency[most].max())
    summary = f"the records between {band[0]:.3g} and {band[1]:.3g} Hz"
    return Location(frequency_hz=band, summary=summary)


def _deciding(runs: Sequence[NextRun]) -> str:
    if not runs:
        return "none is needed: no other effect of the catalogue fits as well"
    apart = ", ".join(f"{name} by {sigma:.1f} sigma" for name, sigma in runs[0].then.items())
    lost = f" ({', '.join(runs[0].lost)} would not swing in it)" if runs[0].lost else ""
    return f"{runs[0].what}{lost}: it would reject {apart}"


def answer_of(
    search: CampaignSearch, ranked: Sequence[Sequence[NextRun]], copies: Sequence[str] = ()
) -> Answer:
    """Make the answer: whether the records agree, who does not, and what causes explain it."""
    count = len(search.whole.design.runs)
    design = search.baseline.design
    theory = "Eq. 16 in the tank that is told" if design.tank and design.walls else "Eq. 16"
    agree = (
        f"do not agree with {theory}" if search.missing else f"agree with {theory}, the loss torque"
    )
    head = f"the {count} records {agree} and the stated errors of the apparatus"
    if not search.described:
        head = f"the model does not describe this campaign: {head}"
    rows = [
        *(_rows(search, ranked) if search.missing else ()),
        ("inputs moved", _pulled(search)),
        ("counted once", "; ".join(copies)),
    ]
    kept = tuple(row for row in rows if row[1])
    return Answer((f"{head} (global {printed(search.p_value)})",), kept)


def _rows(search: CampaignSearch, ranked: Sequence[Sequence[NextRun]]) -> list[tuple[str, str]]:
    """Return what disagrees, what may explain it, how sure that is, and what would decide."""
    known = {
        each.last.identifier: each.last
        for one in search.found
        for each in (one.leader, *(rival for rival, _ in one.rivals))
    }
    sizes = (f"{each.expected:g} ({_words(each.parameter.name)})" for each in known.values())
    beforehand = "beforehand nothing is as likely as all causes together"
    return [
        *(("seen", each["text"]) for each in seen_in(search)),
        ("off the others", ", ".join(map(off, search.left_out))),
        *(
            (
                _words(name),
                f"the drag is {fit.size(0, about=1.0)} times Eq. 16, k {coefficient(fit)}",
            )
            for name, fit in (_with_and_without(search) if search.left_out else {}).items()
        ),
        (
            "scatter",
            f"{search.scatter} times what the records' errors say ({percent(search.scattered)})"
            if search.scatter
            else "",
        ),
        ("most probable", ", beside ".join(filter(None, map(_likely, search.found)))),
        ("or", f"{off(search.suspect)}: take it anew first" if search.suspect else ""),
        *(("or else", _others(one)) for one in search.found),
        *(
            ("decide by", _deciding(runs) if one.rivals else "")
            for one, runs in zip(search.found, ranked, strict=True)
        ),
        ("shares", f"{beforehand}; sd expected: {', '.join(sizes)}" if known else ""),
        ("quote", f"k is {quoted_coefficient(search)}, averaged over causes" if known else ""),
    ]


def _pulled(search: CampaignSearch) -> str:
    """Print the inputs that the records move by more than twice their stated errors."""
    pulls = pulls_of_inputs(search.improved)
    far = sorted(
        (name for name in pulls if abs(pulls[name]) > PULLED), key=lambda n: -abs(pulls[n])
    )
    said = ", ".join(f"{name} {pulls[name]:+.1f}" for name in far[:_MOST_PULLED])
    more = f" and {len(far) - _MOST_PULLED} more" if len(far) > _MOST_PULLED else ""
    shown = said and search.described
    return f"{said}{more}, in their stated errors, of {len(pulls)}" if shown else ""


_MOST_PULLED: Final = 5
"""Inputs on one line."""


def seen_in(search: CampaignSearch) -> list[dict[str, Any]]:
    """Return what the records show beyond the model, whatever its cause."""
    if not search.missing:
        return []
    fit = search.baseline
    found: list[dict[str, Any]] = []
    if kinds := groups(fit):
        found.append({"kind": "two groups", **kinds._asdict(), "text": _kinds(fit, kinds)})
    if peak := bump(fit):
        text = (
            f"a bump in the loss near {peak.frequency_hz:.2g} Hz, {percent(peak.excess)} above what"
            f" is told (between {peak.beside[0]:.2g} and {peak.beside[1]:.2g} Hz)"
        )
        found.append({"kind": "bump", **peak._asdict(), "text": text})
    if not found:
        found.append(_where(search))
    return found


def _kinds(fit: JointFit, kinds: Groups) -> str:
    first, second = (", ".join(names) for names in kinds[:2])
    dry = all(run.fluid is None for run in fit.design.runs if run.record in kinds.first)
    if dry:  # there b is the loss torque, as 1/k
        low, high = (
            fit.design.coefficient_s2 * math.exp(fit.unknowns[0]) / (1 + e) for e in kinds.excess
        )
        return f"two groups: k is about {low:.4g} s² in {first}, and {high:.4g} s² in {second}"
    apart = percent(kinds.excess[1] - kinds.excess[0])
    return f"two groups: the loss in {second} is {apart} larger than in {first}"


def _where(search: CampaignSearch) -> dict[str, Any]:
    """Return the extent of what is left: the loss against frequency, or a scatter.

    A scatter beyond a digit is no error of records: inputs far from what is told hold it.
    """
    factor, _ = scatter(search.improved)
    if not (search.found or is_orderly(search.improved) or factor.value > WRONG):
        text = f"the records scatter {factor.value:.2g} times more than their errors say"
        return {"kind": "scatter", "factor": factor.as_json(), "text": text}
    told = told_by_frequency(search.baseline)
    parts = [told_and_measured(told, wet) for wet in (True, False)]
    # Where it stands out most beyond its errors.
    part = max((each for each in parts if len(each.records)), key=_stands_out)
    rows, frequency = part.records, part.frequency_hz
    excess = told.data.values[rows, 1] / told.prediction[rows, 1] - 1.0
    low, high = int(np.argmin(excess)), int(np.argmax(excess))
    least, most = (f"{100.0 * excess[at]:+.2g} % at {frequency[at]:.2g} Hz" for at in (low, high))
    where = "in the fluid" if part is parts[0] else "without a fluid"
    text = f"the loss {where} differs from what is told by {least}, {most}"
    return {"kind": "order", "excess": [excess[low], excess[high]], "text": text}


def _stands_out(part: Excess) -> float:
    return float(np.max(np.abs(part.excess / part.sd)))


def _words(name: str) -> str:
    return name.replace("_", " ")


def _split(one: Found) -> tuple[list[tuple[JointFit, float]], list[tuple[JointFit, float]]]:
    """Return those of a class that are named, and the rest: A, A or B, or none."""
    members = [(one.leader, one.probability), *one.rivals]
    count = named_together([share for _, share in members])
    return members[:count], members[count:]


def _likely(one: Found) -> str:
    """Print a cause, or the two or three that share the probability, and what they explain."""
    named, _ = _split(one)
    causes = " or ".join(f"{_sized(fit)} {percent(share)}" for fit, share in named)
    return f"{causes}, chi^2 falls by {one.delta_chi2:.0f}" if named else ""


def _sized(fit: JointFit) -> str:
    last, shape = fit.last, fit.added[-1].shape
    size = f"{_words(last.parameter.name)} {fit.size()}"
    size += f" at {_of(shape)}" if last.finer else ""
    size += f" in {shape}" if isinstance(shape, str) and shape not in last.name else ""
    return f"{last.name} ({size})"


def _others(one: Found) -> str:
    """Print the rest of its class, and nothing at all."""
    rivals = [(rival.last.name, share) for rival, share in _split(one)[1]]
    nothing = [("nothing at all", one.nothing)] if one.nothing >= FALSE_ALARM else []
    return ", ".join(f"{name} {percent(share)}" for name, share in (*rivals, *nothing))


_STEP = 1e-3
"""Of a size, in what is expected of it: the patterns are those of small sizes."""


def causes(search: CampaignSearch) -> dict[str, Any]:
    """Patterns over the records in the fluid, as excesses of the viscous loss over the theory.

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
    viscous = predict(replace(design, coefficient_s2=math.inf), (), free)[wet, 1]
    measured = fit.data.values[wet, 1]
    excess = (measured - plain[wet, 1]) / viscous
    sd = 1.0 / np.linalg.norm(fit.data.whitening[wet, :, 1], axis=-1) / viscous
    members = [
        rival
        for found in search.found[:1]
        for rival in (found.leader, *(rival for rival, _ in found.rivals))
    ]
    best = min((rival.chi2 for rival in members), default=0.0)
    excluded = search.found[0].excluded if search.found else {}
    above = excluded | {rival.last.identifier: rival.chi2 - best for rival in members}
    patterns = [
        (one, (predict(design, (one,), np.append(free, _STEP)) - plain)[wet, 1] / viscous / _STEP)
        for one in candidates(design)
    ]
    shapes = [_cause(one, each, excess) for one, each in patterns if float(each @ each) > 0.0]
    worst_first = sorted(shapes, key=lambda row: -row["rms_left"])
    # The best shape of an effect stands for it.
    by_name = {row["id"]: row for row in worst_first}
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
        "causes": [
            row
            | {
                "chi2_above_best": above.get(name),
                "in_class": name in above and name not in excluded,
            }
            for name, row in sorted(by_name.items(), key=lambda item: item[1]["rms_left"])
        ],
    }


def _cause(one: Candidate, pattern: FloatArray, excess: FloatArray) -> dict[str, Any]:
    """What a cause predicts at the size that follows the measured excess best."""
    units = float(pattern @ excess / (pattern @ pattern))
    return {
        "id": one.effect.identifier,
        "name": one.effect.name,
        "size": units * one.effect.expected,
        "parameter": one.effect.parameter.name,
        "unit": one.effect.parameter.unit,
        "possible": one.bounds[0] <= units <= one.bounds[1],
        "excess": (units * pattern).tolist(),
        "rms_left": float(np.sqrt(np.mean((excess - units * pattern) ** 2))),
    }
