"""What a campaign's model lacks: tested over the catalogue, refitted, named as a class."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design
from pendpipe.campaign.fit import Candidate, JointFit, Measured, candidates, joint_fit
from pendpipe.estimate import chi_square_p_value

CLASS_CHI2: Final = 6.0
"""A rival whose likelihood is within exp(-3) of the best one's is in the class (contract)."""
MOST_EFFECTS: Final = 3
_DRAWS: Final = 10_000
_SEED: Final = 24
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
    p_value: float
    delta_chi2: float


@dataclass(frozen=True)
class CampaignSearch:
    """The answer, before it is put into words.

    Parameters
    ----------
    baseline, improved
        The joint fits without and with what was found.
    p_value
        Global: of the largest score over the catalogue, or of chi^2 as a whole.
    found
        In the order in which they were added; empty also where nothing named explains a misfit.
    missing
        Whether something is missing.
    excluded
        Rise of chi^2 above the best rival, by identifier, of those outside the first class.
    """

    baseline: JointFit
    improved: JointFit
    p_value: float
    found: tuple[Found, ...]
    missing: bool
    excluded: dict[str, float]


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
    values, vectors = np.linalg.eigh(correlations)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(scores))) @ root.T
    least = np.min(_local_p(drawn, tried), axis=-1)
    resolved = np.quantile(least, 0.01)
    if smallest >= resolved:
        return float(np.mean(least <= smallest))
    return float(-math.expm1(0.01 / resolved * math.log1p(-smallest)))


def search(
    design: Design, data: Measured, level: float = 0.01, base: JointFit | None = None
) -> CampaignSearch:
    """Look for what the model lacks.

    Half of the level goes to the catalogue's scan, half to chi^2 as a whole.

    Parameters
    ----------
    design, data
        As for `joint_fit`.
    level
        False-alarm probability for a campaign that lacks nothing.
    base
        The fit without effects, where it is there already.
    """
    baseline = base or joint_fit(design, data)
    everything = candidates(design)
    fit, found, first = baseline, [], 1.0
    excluded: dict[str, float] = {}
    for number in range(MOST_EFFECTS):
        taken = {one.effect.identifier for one in fit.added}
        tried = [one for one in everything if one.effect.identifier not in taken]
        scores, correlations = local_scores(fit, tried)
        scan = global_p_value(scores, correlations, tried)
        whole = chi_square_p_value(fit.chi2, fit.degrees_of_freedom)
        p_value = min(1.0, 2.0 * min(scan, whole))
        first = p_value if number == 0 else first
        if p_value >= level or (number and scan >= 0.5 * level):
            break
        rivals = refit(fit, tried, scores)
        members = class_of(rivals)
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
        found.append(
            Found(leader, tuple(members[1:]), probability, p_value, fit.chi2 - leader.chi2)
        )
        fit = leader
    return CampaignSearch(baseline, fit, first, tuple(found), first < level, excluded)


def refit(fit: JointFit, tried: Sequence[Candidate], scores: FloatArray) -> list[JointFit]:
    """Refit with each candidate whose linear gain is within reach of the best one's."""
    gains = np.where(_one_sided(tried), np.maximum(scores, 0.0), scores) ** 2
    reach = max(_REACH, 0.25 * float(gains.max()))
    near = [one for one, gain in zip(tried, gains, strict=True) if gain >= gains.max() - reach]
    return [joint_fit(fit.design, fit.data, (*fit.added, one), fit.unknowns) for one in near]


def class_of(rivals: Sequence[JointFit]) -> list[tuple[JointFit, float]]:
    """The rivals that the data cannot tell apart, the most probable first, with probabilities.

    One shape of an effect stands for it. What is left to 1 is "none of these": it is likely where
    even the best of them leaves more chi^2 than chance would.
    """
    best = min(rival.chi2 for rival in rivals)
    inside: dict[str, JointFit] = {}
    for rival in sorted(rivals, key=lambda rival: rival.chi2):
        if rival.chi2 <= best + CLASS_CHI2:
            inside.setdefault(rival.last.identifier, rival)
    members = sorted(inside.values(), key=lambda rival: -rival.log_evidence)
    weights = np.exp([rival.log_evidence - members[0].log_evidence for rival in members])
    left = chi_square_p_value(best, members[0].degrees_of_freedom)
    named = left / (left + 0.01)
    return list(zip(members, (named * weights / weights.sum()).tolist(), strict=True))


def held_out(fit: JointFit) -> tuple[FloatArray, FloatArray]:
    """Each record predicted from all the others: log densities and pulls, shape (records,).

    For a model that is linear about its optimum the fit without a record follows from the fit
    with it: of whitened residuals r_i with hat matrix H_i, the prediction's are
    ``(1 - H_i)^-1 r_i`` with covariance ``(1 - H_i)^-1``.
    """
    rows = fit.data.whitening.shape[1]
    densities, pulls = [], []
    for number, whitening in enumerate(fit.data.whitening):
        part = slice(number * rows, (number + 1) * rows)
        root, off = fit.jacobian[part] @ fit.root, fit.residuals[part]
        left = (1.0 + 1e-12) * np.eye(rows) - root @ root.T
        size = float(off @ np.linalg.solve(left, off))
        scale = np.linalg.slogdet(whitening @ whitening.T)[1]
        densities.append(
            0.5 * (np.linalg.slogdet(left)[1] - size - rows * math.log(2.0 * math.pi) + scale)
        )
        pulls.append(math.copysign(math.sqrt(size / rows), float(off[-1])))
    return np.array(densities), -np.array(pulls)
