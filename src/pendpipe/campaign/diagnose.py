"""What a campaign's model lacks: tested over the catalogue, refitted, named as a class.

The answer is campaign_diagnosis.json and its paragraph. With it goes what each cause alone would do
to the records, and which further runs would tell the rivals of a class apart.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri_exp

from pendpipe.answer import Answer, percent, printed
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design, Run
from pendpipe.campaign.effects import CATALOGUE
from pendpipe.campaign.fit import (
    STEP,
    Candidate,
    JointFit,
    Measured,
    candidates,
    chi2_near,
    coefficient,
    joint_fit,
    named,
    only,
    predict,
)
from pendpipe.estimate import LISTED, Estimate, averaged, chi_square_p_value
from pendpipe.levels import FALSE_ALARM

CLASS_CHI2: Final = 6.0
"""A rival whose likelihood is within exp(-3) of the best one's is in the class (contract)."""
MOST_EFFECTS: Final = 3
"""Effects that are added: of three dozen records more are not told apart."""
MOST_LEFT_OUT: Final = 3
"""Records that are left out: of three dozen more are no exceptions."""
FAR_SIGMA: Final = 4.0
"""A record that lies farther from what all others predict is named."""
NOTHING_MISSING: Final = 0.5
"""Probability beforehand that nothing is missing; the effects share the rest alike."""
_DRAWS: Final = 10_000
"""Campaigns drawn for the null: a hundredth of them, the level, is known to a tenth."""
_SEED: Final = 24
"""Of the draws, so that one campaign has one answer."""
_REACH: Final = 30.0
"""Candidates whose linear gain in chi^2 is this far behind the best are not refitted: the
effects change the records by a fifth at most, where the linear gain is good to a fifth."""


@dataclass(frozen=True)
class Found:
    """One effect that the model lacks, with the rivals that the data cannot tell from it."""

    leader: JointFit
    """The campaign's fit with it."""
    rivals: tuple[tuple[JointFit, float], ...]
    """The fits with each of the rest of the class in its place, and their probabilities."""
    probability: float
    nothing: float
    """Probability that no effect is missing."""
    p_value: float
    delta_chi2: float


class Far(NamedTuple):
    """A record that disagrees with the others, by how many sigma."""

    record: str
    sigma: float


@dataclass(frozen=True)
class CampaignSearch:
    """The answer, before it is put into words.

    Parameters
    ----------
    baseline, improved
        The joint fits without and with what was found, of the records that were kept.
    p_value
        Global: of the largest score over the catalogue, or of chi^2 as a whole.
    found
        In the order in which they were added; empty also where nothing named explains a misfit.
    missing
        Whether something is missing.
    excluded
        Rise of chi^2 above the best rival, by identifier, of those outside the first class.
    left_out
        Records that disagree with all others, and explain a misfit better than any effect.
    suspect
        A record that would explain it about as well as what was found.
    whole
        The answer with all records, where some were left out.
    """

    baseline: JointFit
    improved: JointFit
    p_value: float
    found: tuple[Found, ...]
    missing: bool
    excluded: dict[str, float]
    left_out: tuple[Far, ...] = ()
    suspect: Far | None = None
    whole: "CampaignSearch | None" = None


def local_scores(fit: JointFit, tried: Sequence[Candidate]) -> tuple[FloatArray, FloatArray]:
    """Score of each candidate on a fit's residuals, and the correlations of the scores.

    Each score is the residual's part along the candidate's pattern, after what the fit's own
    unknowns can follow; standard normal where nothing is missing. Candidates that the fit
    follows wholly score 0.

    Returns
    -------
    scores, correlations
        Shapes (n,) and (n, n).
    """
    basis, _ = np.linalg.qr(fit.jacobian)
    patterns = np.stack([fit.derivative(one) for one in tried], axis=-1)
    whole = np.linalg.norm(patterns, axis=0)
    patterns = patterns - basis @ (basis.T @ patterns)
    size = np.linalg.norm(patterns, axis=0)
    seen = size > 1e-6 * np.maximum(whole, 1e-300)
    patterns = np.where(seen, patterns / np.where(seen, size, 1.0), 0.0)
    return -(patterns.T @ fit.residuals), patterns.T @ patterns


def _one_sided(tried: Sequence[Candidate]) -> BoolArray:
    """Which candidates' sizes can only be positive."""
    return np.array([one.effect.parameter.low >= 0.0 for one in tried])


def _local_p(scores: FloatArray, tried: Sequence[Candidate]) -> FloatArray:
    """Probability of each score by chance; only positive scores count where the size must be."""
    return np.where(_one_sided(tried), ndtr(-scores), 2.0 * ndtr(-np.abs(scores)))


def global_p_value(
    scores: FloatArray, correlations: FloatArray, tried: Sequence[Candidate]
) -> float:
    """Probability that chance has so small a local p-value anywhere in the catalogue.

    Correlated normal scores are drawn; beyond what the draws resolve, the number of independent
    trials that they showed is kept.
    """
    smallest = float(np.min(_local_p(scores, tried)))
    drawn = np.random.default_rng(_SEED).multivariate_normal(
        np.zeros(len(scores)), correlations, _DRAWS, check_valid="ignore", method="eigh"
    )
    least = np.min(_local_p(drawn, tried), axis=-1)
    resolved = np.quantile(least, FALSE_ALARM)
    if smallest >= resolved:
        return float(np.mean(least <= smallest))
    return float(-math.expm1(FALSE_ALARM / resolved * math.log1p(-smallest)))


def search(
    design: Any, data: Measured, level: float = FALSE_ALARM, base: JointFit | None = None
) -> CampaignSearch:
    """Look for what the model lacks, and for records that disagree with all others.

    A record that lies beyond `FAR_SIGMA` whatever was found, or explains the misfit better than
    what was found, is left out, and the search is made again.

    Parameters
    ----------
    design, data
        As for `joint_fit`.
    level
        False-alarm probability for a campaign that lacks nothing: half of it goes to the
        catalogue's scan, half to chi^2 as a whole.
    base
        The fit without effects, where it is there already.
    """
    whole = answer = _search(base or joint_fit(design, data), level)
    left_out: list[Far] = []
    while answer.missing and len(answer.baseline.design.runs) > MOST_LEFT_OUT:
        unexplained = farthest(answer.improved)
        suspect = unexplained or farthest(answer.baseline)
        if suspect is None:
            break
        fewer = _without(answer.baseline, suspect.record)
        better = answer.improved.chi2 - fewer.chi2
        if unexplained is None and better < CLASS_CHI2:
            answer = replace(answer, suspect=suspect if better > -CLASS_CHI2 else None)
            break
        if len(left_out) == MOST_LEFT_OUT:
            break
        left_out.append(suspect)
        answer = _search(fewer, level)
    if not left_out:
        return answer
    return replace(
        answer, p_value=whole.p_value, missing=True, left_out=tuple(left_out), whole=whole
    )


def farthest(fit: JointFit) -> Far | None:
    """The record that differs most from what all others predict, if it is far.

    The model without it is fitted, so that by its sigma chi^2 does fall: the linear model of
    `held_out` says the same but where a pendulum is near its balance.
    """
    _, pulls = held_out(fit)
    for number in np.argsort(-np.abs(pulls)):
        if abs(pulls[number]) <= FAR_SIGMA:
            break
        record = fit.design.runs[number].record
        fall = fit.chi2 - _without(fit, record, fit.added).chi2
        sigma = float(_sigma(fall, fit.data.values.shape[-1]))
        if sigma > FAR_SIGMA:
            return Far(record, math.copysign(sigma, pulls[number]))
    return None


def _without(fit: JointFit, record: str, added: Sequence[Candidate] = ()) -> JointFit:
    """The model fitted to all records but one."""
    keep = np.array([run.record != record for run in fit.design.runs])
    return joint_fit(*only(fit.design, fit.data, keep), added)


def _sigma(fall: FloatArray | float, readings: int) -> FloatArray:
    """The sigma of a fall of chi^2 by frequency and b, two degrees of freedom, or by n, one."""
    if readings == 1:
        return np.sqrt(np.maximum(fall, 0.0))
    return np.asarray(-ndtri_exp(-0.5 * np.maximum(fall, 0.0) - math.log(2.0)))


def _search(baseline: JointFit, level: float) -> CampaignSearch:
    """Add effects as long as the scan of the catalogue alarms."""
    everything = candidates(baseline.design)
    fit, found, first = baseline, [], 1.0
    excluded: dict[str, float] = {}
    for number in range(MOST_EFFECTS):
        taken = {one.effect.identifier for one in fit.added}
        tried = [one for one in everything if one.effect.identifier not in taken]
        scores, correlations = local_scores(fit, tried)
        scan = global_p_value(scores, correlations, tried)
        if not number:
            whole = chi_square_p_value(fit.chi2, fit.degrees_of_freedom)
            first = min(1.0, 2.0 * min(scan, whole))
        if scan >= 0.5 * level:
            break
        rivals = refit(fit, tried, scores)
        members, nothing = class_of(rivals, fit, len({one.effect.identifier for one in tried}))
        if members[0][0].chi2 > fit.chi2 - 1.0:
            break
        leader, probability = members[0]
        best = min(rival.chi2 for rival in rivals)
        if not number:
            inside = {rival.last.identifier for rival, _ in members}
            above = [
                (one.effect.identifier, float(fit.chi2 - score**2 - best))
                for one, score in zip(tried, scores, strict=True)
            ]
            above += [(rival.last.identifier, rival.chi2 - best) for rival in rivals]
            excluded = {name: rise for name, rise in above if name not in inside}
        gain = fit.chi2 - leader.chi2
        chance = min(1.0, 2.0 * scan)
        found.append(Found(leader, tuple(members[1:]), probability, nothing, chance, gain))
        fit = leader
    return CampaignSearch(baseline, fit, first, tuple(found), first < level, excluded)


def refit(fit: JointFit, tried: Sequence[Candidate], scores: FloatArray) -> list[JointFit]:
    """Refit with each candidate whose linear gain is within reach of the best one's."""
    gains = np.where(_one_sided(tried), np.maximum(scores, 0.0), scores) ** 2
    reach = max(_REACH, 0.25 * float(gains.max()))
    near = [one for one, gain in zip(tried, gains, strict=True) if gain >= gains.max() - reach]
    return [joint_fit(fit.design, fit.data, (*fit.added, one), fit.unknowns) for one in near]


def class_of(
    rivals: Sequence[JointFit], without: JointFit, effects: int
) -> tuple[list[tuple[JointFit, float]], float]:
    """The rivals that the data cannot tell apart, and the probability that nothing is missing.

    The most probable first, with probabilities. One shape of an effect stands for it. Nothing is a
    rival too (`NOTHING_MISSING`, the rest shared by all `effects` that were tried). What is left
    to 1 is "none of these": it is likely where even the best of them leaves more chi^2 than chance
    would.
    """
    best = min(rival.chi2 for rival in rivals)
    inside: dict[str, JointFit] = {}
    for rival in sorted(rivals, key=lambda rival: rival.chi2):
        if rival.chi2 <= best + CLASS_CHI2:
            inside.setdefault(rival.last.identifier, rival)
    members = sorted(inside.values(), key=lambda rival: -rival.log_evidence)
    each = math.log((1.0 - NOTHING_MISSING) / effects)
    logs = [rival.log_evidence + each for rival in members]
    logs.append(math.log(NOTHING_MISSING) - 0.5 * without.chi2)
    weights = np.exp(np.array(logs) - max(logs))
    left = chi_square_p_value(best, members[0].degrees_of_freedom)
    *named_ones, nothing = (left / (left + FALSE_ALARM) * weights / weights.sum()).tolist()
    return list(zip(members, named_ones, strict=True)), nothing


def held_out(fit: JointFit) -> tuple[FloatArray, FloatArray]:
    """Each record predicted from all the others: log densities and pulls, shape (records,).

    A pull is the sigma of frequency and b together, with the sign of b's excess.

    For a model that is linear about its optimum the fit without a record follows from the fit
    with it. Let the orthonormal columns of N span the residuals that no free unknown can follow,
    and ``z = N^T r`` be the part of the whitened residuals r that lies there. With the record's
    rows ``N_i = U S V^T`` the prediction has the covariance ``(U S^2 U^T)^-1``, and without the
    record chi^2 falls by ``|V^T z|^2``, which is the square that the pull is made of: no rounding
    and no unfinished fit makes it larger than chi^2.
    """
    whitening = fit.data.whitening
    records, rows, _ = whitening.shape
    basis, sizes, _ = np.linalg.svd(fit.jacobian[:, fit.free])
    rounding = np.finfo(np.float64).eps * float(sizes.max())
    unfollowed = basis[:, np.count_nonzero(sizes > rounding) :]
    own = unfollowed[: records * rows].reshape(records, rows, -1)
    rest = unfollowed.T @ fit.residuals
    _, left, directions = np.linalg.svd(own, full_matrices=False)
    predicted = left > rounding  # nothing is said of what no other record knows
    fall = np.sum((predicted * (directions @ rest)) ** 2, axis=-1)
    volume = 2.0 * np.sum(np.log(left, where=predicted, out=np.zeros_like(left)), axis=-1)
    volume += np.linalg.slogdet(whitening @ whitening.mT)[1]
    densities = 0.5 * (volume - fall - rows * math.log(2.0 * math.pi))
    return densities, -np.copysign(_sigma(fall, rows), (own @ rest)[:, -1])


_CLAMPED_ANEW_M: Final = 1e-9
"""A place this far away is the same place with an error of its own."""
_GLYCEROL: Final = {"viscosity_pa_s": 5.6e-3, "density_kg_per_m3": 1122.0}
"""Half glycerol, half water by mass at 20 C: about 5 mm^2/s."""


def _fluid(run: Run, changes: dict[str, float]) -> Run:
    return replace(run, fluid=run.fluid.model_copy(update=changes) if run.fluid else None)


RUNS: Final[dict[str, Callable[[Run], Run]]] = {
    "a large and deep tank": lambda run: replace(run, tank=False),
    "half glycerol, half water": lambda run: _fluid(run, _GLYCEROL),
    "half glycerol, half water in a large and deep tank": lambda run: replace(
        _fluid(run, _GLYCEROL), tank=False
    ),
    "the bare screw in the water": lambda run: replace(run, sphere=False),
    "the same settings without water": lambda run: replace(run, fluid=None),
    "releases at 10 mrad": lambda run: replace(run, release_rad=0.010),
    "a lid on the water": lambda run: replace(run, open_surface=False),
    "the reversed order": lambda run: replace(run, order=-run.order),
    "water at 35 °C": lambda run: replace(run, temperature_c=35.0),
    "the same records once more": lambda run: run,
}
"""Candidates: what each does to every record in the fluid."""


class NextRun(NamedTuple):
    """One candidate: the sigma at which it would reject each rival, before and with it."""

    what: str
    now: dict[str, float]
    then: dict[str, float]
    lost: tuple[str, ...]
    """Records whose pendulum would turn over."""
    predicted: Mapping[str, tuple[Estimate, Estimate]]
    """Frequency and b of each new record that swings, with what the campaign leaves open."""

    @property
    def worst(self) -> float:
        """The sigma of the rival that is rejected least."""
        return min(self.then.values())


def next_measurements(fit: JointFit, rivals: Sequence[JointFit]) -> list[NextRun]:
    """Rank the candidates by the sigma at which they would reject every rival.

    The campaign with the runs added, as the leader predicts it, is fitted with each rival instead:
    the root of its chi^2 is that sigma. A new record is as good, relative to its b and its
    frequency, as the one whose weights it has; the weights are clamped anew for it.

    Parameters
    ----------
    fit
        With the leader.
    rivals
        The fits with each of the others in its place.
    """
    if not rivals:
        return []
    with np.errstate(invalid="ignore", divide="ignore"):  # without the sphere some turn over
        now, _ = _sigmas(fit, rivals, None)
        found = [
            NextRun(what, now, *_sigmas(fit, rivals, change), _expected(fit, change))
            for what, change in RUNS.items()
        ]
    return sorted(found, key=lambda run: -run.worst)


def _expected(fit: JointFit, change: Callable[[Run], Run]) -> dict[str, tuple[Estimate, Estimate]]:
    """What new records would show, with the errors of the campaign's unknowns and own clamping."""
    design, again = _extended(fit.design, change)
    at, there = _carried(fit, fit, design), fit.design.index
    steps = STEP * np.eye(len(at))
    slopes = (predict(design, fit.added, at + steps) - predict(design, fit.added, at - steps)) / (
        2.0 * STEP
    )
    rows = [there.get(each.name) for each in design.nuisances]
    rows += range(len(fit.unknowns) - len(fit.added), len(fit.unknowns))
    known = [number for number, row in enumerate(rows) if row is not None]
    covariance = np.eye(len(at))
    covariance[np.ix_(known, known)] = fit.covariance[np.ix_(*2 * [[rows[k] for k in known]])]
    variance = np.einsum("irj,ik,krj->rj", slopes, covariance, slopes)
    values, found = predict(design, fit.added, at), {}
    for number in range(len(fit.design.runs), len(again)):
        if np.isfinite(values[number]).all():
            pairs = zip(values[number], np.sqrt(variance[number]), ("Hz", "1/s"), strict=True)
            frequency, b = (Estimate(float(y), float(sd), unit) for y, sd, unit in pairs)
            found[design.runs[number].record] = frequency, b
    return found


def _sigmas(
    fit: JointFit, rivals: Sequence[JointFit], change: Callable[[Run], Run] | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """How many sigma each rival would be away, and which records would not swing."""
    design, again = _extended(fit.design, change)
    expected = predict(design, fit.added, _carried(fit, fit, design))
    usable = np.asarray(np.isfinite(expected).all(axis=-1))
    # The same relative errors at other values.
    whitening = fit.data.whitening[again] * (fit.data.values[again] / expected)[:, None, :]
    runs = tuple(run for run, good in zip(design.runs, usable.tolist(), strict=True) if good)
    kept, data = replace(design, runs=runs), Measured(expected[usable], whitening[usable])
    sigma = {
        rival.last.identifier: math.sqrt(
            chi2_near(kept, data, rival.added, _carried(rival, fit, kept))
        )
        for rival in rivals
    }
    swings = zip(design.runs, usable.tolist(), strict=True)
    return sigma, tuple(run.record for run, good in swings if not good)


def _extended(design: Design, change: Callable[[Run], Run] | None) -> tuple[Design, list[int]]:
    """The design with changed copies of its records in the fluid, and what each run repeats."""
    every = list(range(len(design.runs)))
    if change is None:
        return design, every
    wet = [number for number in every if design.runs[number].fluid is not None]
    more = [
        replace(
            design.runs[number],
            weights_m={
                name: place + _CLAMPED_ANEW_M
                for name, place in design.runs[number].weights_m.items()
            },
        )
        for number in wet
    ]
    return replace(design, runs=(*design.runs, *map(change, more))), [*every, *wet]


def _carried(fit: JointFit, truth: JointFit, design: Design) -> FloatArray:
    """Unknowns of a fit for another design, where the truth has its inputs as configured."""
    there, count = fit.design.index, len(fit.design.nuisances)
    moved = fit.unknowns[:count] - truth.design.has_prior * truth.unknowns[:count]
    found = [moved[there[each.name]] if each.name in there else 0.0 for each in design.nuisances]
    return np.array([*found, *fit.unknowns[count:]])


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
    with the numbers with and without them) and ``patterns`` (`causes`).

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
        **_predicted(search),
        "unexplained": {"residual_rms_rad": None, "p_value": left},
        "excluded": search.excluded,
        "patterns": causes(search),
        "left_out": [far._asdict() for far in search.left_out],
        "numbers": {name: _shown(fit) for name, fit in _with_and_without(search).items()},
        "quoted": {"hysteretic_coefficient": quoted_coefficient(search).as_json()},
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
    answers = {"all_records": search.whole or search}
    if search.whole:
        answers["without"] = search
    return {
        name: joint_fit(
            replace(each.baseline.design, walls=False),
            each.baseline.data,
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
        "residual_rms_rad": None,
        "residual_rms_of_b": float(np.sqrt(np.mean(off**2))),
        "chi2": fit.chi2,
        "chi2_per_dof": fit.chi2 / max(fit.degrees_of_freedom, 1),
    }


def _effect(search: CampaignSearch, found: Found, runs: Sequence[NextRun]) -> dict[str, Any]:
    effect = found.leader.last
    return {
        "id": effect.identifier,
        "name": effect.name,
        "kind": "campaign",
        "equation": effect.equation,
        "parameters": _parameters(found.leader),
        "delta_chi2": found.delta_chi2,
        "p_value_global": found.p_value,
        "probability": found.probability,
        "probability_of_nothing": found.nothing,
        "indistinguishable_from": [
            {"id": rival.last.identifier, "probability": probability}
            for rival, probability in found.rivals
        ],
        "rivals": [
            {
                "id": rival.last.identifier,
                "parameters": _parameters(rival),
                "chi2_above_best": rival.chi2 - found.leader.chi2,
            }
            for rival, _ in found.rivals
        ],
        "deciding_measurement": _deciding(runs),
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
        "location": _location(search),
    }


def _parameters(fit: JointFit) -> dict[str, Any]:
    size, shape = fit.size().as_json(), fit.added[-1].shape
    if shape is not None:
        size["of"] = " ".join(shape) if isinstance(shape, tuple) else shape
    return {fit.last.parameter.name: size}


def _unnamed(search: CampaignSearch) -> dict[str, Any]:
    """What no entry explains: the records that differ from the rest, in sigma."""
    whole = search.whole or search
    _, pulls = held_out(whole.baseline)
    names = (run.record for run in whole.baseline.design.runs)
    pairs = zip(names, pulls.tolist(), strict=True)
    far = search.left_out or sorted((Far(*pair) for pair in pairs), key=lambda one: -abs(one.sigma))
    summary = "; ".join(f"{one.record} by {one.sigma:+.1f} sigma" for one in far[:3])
    return {
        "id": "unnamed-damping",
        "name": "records that disagree, by nothing that the catalogue has",
        "kind": "unnamed",
        "equation": r"b \to b + \Delta b(\text{record})",
        "parameters": {},
        "delta_chi2": whole.baseline.chi2 - search.baseline.chi2
        if search.whole
        else whole.baseline.chi2 - whole.baseline.degrees_of_freedom,
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
    apart = ", ".join(f"{name} by {sigma:.1f} sigma" for name, sigma in runs[0].then.items())
    lost = f" ({', '.join(runs[0].lost)} would not swing in it)" if runs[0].lost else ""
    return f"{runs[0].what}{lost}: it would reject {apart}"


def answer_of(
    search: CampaignSearch, ranked: Sequence[Sequence[NextRun]], copies: Sequence[str] = ()
) -> Answer:
    """Make the answer: whether the records agree, who does not, and what causes explain it."""
    count = len((search.whole or search).baseline.design.runs)
    theory = _theory(search.baseline.design)
    agree = (
        f"do not agree with {theory}" if search.missing else f"agree with {theory}, the loss torque"
    )
    head = f"the {count} records {agree} and the stated errors of the apparatus"
    rows = [*(_rows(search, ranked) if search.missing else ()), ("counted once", "; ".join(copies))]
    kept = tuple(row for row in rows if row[1])
    return Answer((f"{head} (global {printed(search.p_value)})",), kept)


def _rows(search: CampaignSearch, ranked: Sequence[Sequence[NextRun]]) -> list[tuple[str, str]]:
    """Return what disagrees, what may explain it, how sure that is, and what would decide."""
    left = chi_square_p_value(search.improved.chi2, search.improved.degrees_of_freedom)
    known = {
        each.last.identifier: each.last
        for one in search.found
        for each in (one.leader, *(rival for rival, _ in one.rivals))
    }
    sizes = (f"{each.expected:g} ({_words(each.parameter.name)})" for each in known.values())
    silent = not search.found and not search.left_out
    beforehand = f"beforehand nothing is as likely as all {len(CATALOGUE)} causes together"
    return [
        ("off the others", ", ".join(map(off, search.left_out))),
        *(
            (
                _words(name),
                f"the drag is {fit.size(0, about=1.0)} times Eq. 16, k {coefficient(fit)}",
            )
            for name, fit in (_with_and_without(search) if search.whole else {}).items()
        ),
        ("causes", "no effect of the catalogue stands out, nor any record" if silent else ""),
        ("most probable", ", beside ".join(map(_likely, search.found))),
        ("or", f"{off(search.suspect)}: take it anew first" if search.suspect else ""),
        *(("beside it", _others(one)) for one in search.found),
        *(
            ("decide by", _deciding(runs) if one.rivals else "")
            for one, runs in zip(search.found, ranked, strict=True)
        ),
        ("shares", f"{beforehand}; sd expected: {', '.join(sizes)}" if known else ""),
        ("quote", f"k is {quoted_coefficient(search)}, averaged over causes" if known else ""),
        ("left", f"more than these explain ({printed(left)})" if left < FALSE_ALARM else ""),
    ]


def _theory(design: Design) -> str:
    return "Eq. 16 in the tank that is told" if design.tank and design.walls else "Eq. 16"


def _words(name: str) -> str:
    return name.replace("_", " ")


def off(far: Far) -> str:
    """Say how far a record lies from what all others predict."""
    return f"{far.record} {far.sigma:+.1f} sigma"


def _likely(one: Found) -> str:
    """Print a cause with its size, its probability and what it explains."""
    last = one.leader.last
    size = f"{_words(last.parameter.name)} {one.leader.size()}"
    return f"{last.name} ({size}) {percent(one.probability)}, chi^2 falls by {one.delta_chi2:.0f}"


def _others(one: Found) -> str:
    """Print the rest of its class, and nothing at all."""
    rivals = [(rival.last.name, share) for rival, share in one.rivals]
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
    above = search.excluded | {rival.last.identifier: rival.chi2 - best for rival in members}
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
                "in_class": name in above and name not in search.excluded,
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
