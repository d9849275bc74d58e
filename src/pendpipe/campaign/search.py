"""What a campaign's model lacks: its catalogue is scanned and refitted; records far off go."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri_exp

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.fit import Candidate, JointFit, Measured, candidates, joint_fit, only
from pendpipe.estimate import chi_square_p_value
from pendpipe.levels import FALSE_ALARM
from pendpipe.score import CLASS, trials_of, unit_rows

MOST_EFFECTS: Final = 3
"""Effects that are added: of three dozen records more are not told apart."""
MOST_LEFT_OUT: Final = 3
"""Records that are left out: of three dozen more are no exceptions."""
FAR_SIGMA: Final = 4.0
"""A record that lies farther from what all others predict is named."""
NOTHING_MISSING: Final = 0.5
"""Probability beforehand that nothing is missing; the effects share the rest alike."""
_DRAWS: Final = 10_000
"""Campaigns drawn for the null, of which the number of trials is known to a per cent."""
_SEED: Final = 24
"""Of the draws, so that one campaign has one answer."""
_VISIBLE: Final = 1e-6
"""Part of a pattern that must remain beside what the unknowns follow, above its rounding."""
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


def off(far: Far) -> str:
    """Say how far a record lies from what all others predict."""
    return f"{far.record} {far.sigma:+.1f} sigma"


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
    rows = np.stack([fit.derivative(one) for one in tried])
    units, _ = unit_rows(rows, basis, _VISIBLE)
    return -(units @ fit.residuals), units @ units.T


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

    The trials are counted on drawn, correlated scores.
    """
    drawn = np.random.default_rng(_SEED).multivariate_normal(
        np.zeros(len(scores)), correlations, _DRAWS, check_valid="ignore", method="eigh"
    )
    trials = trials_of(np.min(_local_p(drawn, tried), axis=-1), growth=0.0)
    return trials.global_p_value(float(np.min(_local_p(scores, tried))))


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
        if unexplained is None and better < CLASS:
            answer = replace(answer, suspect=suspect if better > -CLASS else None)
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
        if rival.chi2 <= best + CLASS:
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
