"""What a campaign's records show by themselves, whatever its cause.

Who is off what all others predict, by how much they scatter beyond their errors, whether they are
of two kinds, and where the loss exceeds what is told of it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import ndtri_exp

from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design
from pendpipe.campaign.fit import Candidate, JointFit, Measured, joint_fit, only, predict
from pendpipe.estimate import Estimate
from pendpipe.levels import FALSE_ALARM

FAR_SIGMA: Final = 4.0
"""A record that lies farther from what all others predict is named."""


class Far(NamedTuple):
    """A record that disagrees with the others, by how many sigma."""

    record: str
    sigma: float


def off(far: Far) -> str:
    """Say how far a record lies from what all others predict."""
    return f"{far.record} {far.sigma:+.1f} sigma"


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
        fall = fit.chi2 - without(fit, record, fit.added).chi2
        sigma = float(sigma_of(fall, fit.data.values.shape[-1]))
        if sigma > FAR_SIGMA:
            return Far(record, math.copysign(sigma, pulls[number]))
    return None


def without(fit: JointFit, record: str, added: Sequence[Candidate] = ()) -> JointFit:
    """The model fitted to all records but one."""
    keep = np.array([run.record != record for run in fit.design.runs])
    return joint_fit(*only(fit.design, fit.data, keep), added)


def sigma_of(fall: FloatArray | float, readings: int) -> FloatArray:
    """The sigma of a fall of chi^2 by frequency and b, two degrees of freedom, or by n, one."""
    if readings == 1:
        return np.sqrt(np.maximum(fall, 0.0))
    return np.asarray(-ndtri_exp(-0.5 * np.maximum(fall, 0.0) - math.log(2.0)))


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
    return densities, -np.copysign(sigma_of(fall, rows), (own @ rest)[:, -1])


PULLED: Final = 2.0
"""Stated errors from which on the pull of an input is told: one in twenty by chance."""


def pulls_of_inputs(fit: JointFit) -> dict[str, float]:
    """Return by how many of its stated errors the records move each input that has one."""
    known = zip(fit.design.nuisances, fit.design.has_prior, fit.unknowns, strict=False)
    return {each.name: float(moved) for each, prior, moved in known if prior}


_SCALES: Final = np.geomspace(1.0, 1e4, 921)
"""Errors over those that are stated, a per cent apart."""


def scatter(fit: JointFit) -> tuple[Estimate, float]:
    """By what factor the records scatter beyond their errors, and what of -2 ln L it takes.

    For a model that is linear about its optimum the whitened readings have the covariance
    ``C(s) = s^2 + D D^T``, D being their derivatives by what has a prior. Between the columns of
    what is free, with eigenvalues ``l_i`` of ``D D^T`` and the residual's parts ``z_i``,
    ``-2 ln L = sum z_i^2/(s^2 + l_i) + ln(s^2 + l_i)``.
    """
    readings = fit.data.values.size
    columns, known = fit.jacobian[:readings], fit.jacobian[readings:].any(axis=0)
    residual = fit.residuals[:readings] - columns[:, known] @ fit.residuals[readings:]
    basis, _ = np.linalg.qr(columns[:, ~known & fit.free], mode="complete")
    between = basis[:, np.count_nonzero(~known & fit.free) :]
    own, sizes, _ = np.linalg.svd(between.T @ columns[:, known])
    variance = np.zeros(len(own))
    variance[: len(sizes)] = sizes**2
    squares = (own.T @ (between.T @ residual)) ** 2
    whole = _SCALES[:, None] ** 2 + variance
    taken = np.sum(squares / whole + np.log(whole), axis=-1)
    best = int(np.argmin(taken))
    # Fisher's information about ln s.
    share = _SCALES[best] ** 2 / whole[best]
    sd = _SCALES[best] / math.sqrt(2.0 * float(share @ share))
    return Estimate(float(_SCALES[best]), sd, ""), float(taken[0] - taken[best])


def wider(data: Measured, factor: float) -> Measured:
    """The same readings with larger errors."""
    return data._replace(whitening=data.whitening / factor)


_SHUFFLES: Final = 10_000
"""Orders that are drawn: a level of a hundredth is known to a tenth."""


def is_orderly(fit: JointFit) -> bool:
    """Whether neighbours in frequency differ from their prediction alike, or in turn.

    Judged by what chance does: the products of neighbours' pulls, shuffled.
    """
    _, pulls = held_out(fit)
    groups = [rows for rows in _by_frequency(fit) if len(rows) > 1]

    def together(of: FloatArray) -> FloatArray:
        return np.asarray(np.sum(of[..., 1:] * of[..., :-1], axis=-1))

    random = np.random.default_rng(_SHUFFLES)
    drawn, found = np.zeros(_SHUFFLES), 0.0
    for rows in groups:
        found += float(together(pulls[rows]))
        drawn += together(random.permuted(np.tile(pulls[rows], (_SHUFFLES, 1)), axis=1))
    beyond = min(np.mean(drawn >= found), np.mean(drawn <= found))
    return bool(2.0 * beyond < FALSE_ALARM)


def _by_frequency(fit: JointFit) -> list[Any]:
    """The records in the fluid, and those without one, each by frequency."""
    wet = fit.design.wet > 0.0 if isinstance(fit.design, Design) else np.zeros(len(fit.data.values))
    order = np.argsort(fit.data.values[:, 0])
    return [order[wet[order] == each] for each in (True, False)]


class Excess(NamedTuple):
    """B beyond what is told, over its viscous part, or over b where there is no fluid."""

    records: Any
    frequency_hz: FloatArray
    excess: FloatArray
    sd: FloatArray


_HARDLY: Final = 1e-3
"""Weight of b where inputs follow the frequencies: a tenth of b moves no input by its error."""


def told_by_frequency(fit: JointFit) -> JointFit:
    """Fit the inputs to the frequencies, so that b can be compared; of b they follow k alone."""
    whitening = fit.data.whitening.copy()
    whitening[:, -1] *= _HARDLY
    data = fit.data._replace(whitening=whitening)
    return joint_fit(fit.design, data, (), fit.unknowns)


def told_and_measured(told: JointFit, wet: bool) -> Excess:
    """Return what the records with or without a fluid have in excess, by frequency."""
    design, values = told.design, told.data.values
    rows = _by_frequency(told)[0 if wet else 1]
    plain, whole = told.prediction[rows, 1], told.prediction[rows, 1]
    if wet:
        no_torque = replace(design, coefficient_s2=math.inf)
        whole = predict(no_torque, told.added, told.unknowns)[rows, 1]
    own = 1.0 / np.linalg.norm(told.data.whitening[rows, :, 1], axis=-1)
    return Excess(rows, values[rows, 0], (values[rows, 1] - plain) / whole, _HARDLY * own / whole)


class Groups(NamedTuple):
    """Records of two kinds: names, and the mean excess of their b."""

    first: tuple[str, ...]
    second: tuple[str, ...]
    excess: tuple[float, float]


_TWO_KINDS: Final = 0.04
"""Variance that is left within two groups: of twelve normal numbers, beside a line, a quarter as a
rule, and so little by chance once in 2,000."""


def groups(fit: JointFit) -> Groups | None:
    """Return the two kinds of records without a fluid, or of all in it, if there are two.

    Beside a power of the frequency their b has two levels, each far narrower than what lies
    between, and they are not the low and the high frequencies: that would be a law.
    """
    told = told_by_frequency(fit)
    for wet in (False, True):
        rows, frequency, excess, _ = told_and_measured(told, wet)
        if len(rows) < 2 * _FEWEST_OF_A_KIND:
            continue
        line = np.stack([np.ones(len(rows)), np.log(frequency)], axis=-1)
        left = _beside(line, excess)
        order = np.argsort(left)
        cuts = range(_FEWEST_OF_A_KIND, len(rows) - _FEWEST_OF_A_KIND + 1)
        levels = [np.where(np.isin(np.arange(len(rows)), order[:cut]), -0.5, 0.5) for cut in cuts]
        within = [_beside(np.column_stack([line, each]), excess) for each in levels]
        best = min(range(len(cuts)), key=lambda at: float(within[at] @ within[at]))
        low, high = np.split(order, [cuts[best]])
        apart = max(low.min(), high.min()) < min(low.max(), high.max())
        if apart and within[best] @ within[best] < _TWO_KINDS * left @ left:
            first, second = (
                tuple(fit.design.runs[number].record for number in np.sort(rows[part]))
                for part in (low, high)
            )
            return Groups(first, second, (float(excess[low].mean()), float(excess[high].mean())))
    return None


def _beside(columns: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values)[0])


_FEWEST_OF_A_KIND: Final = 3
"""Fewer are records that are far."""


class Bump(NamedTuple):
    """Where the fluid's loss exceeds what is told of it most, with less on both sides.

    `beside` are the records below half of its height, on both sides: it is between them.
    """

    frequency_hz: float
    excess: float
    beside: tuple[float, float]


def bump(fit: JointFit) -> Bump | None:
    """Return the bump of the loss against frequency, if there is one between the records.

    It stands out from what is least below and above it by more than half of its height, and by
    more than records scatter, as the steps from one to the next show it.
    """
    rows, frequency, excess, sd = told_and_measured(told_by_frequency(fit), wet=True)
    if len(rows) < 2 * _FEWEST_OF_A_KIND:
        return None
    top = int(np.argmax(excess))
    below, above = excess[: top + 1].min(), excess[top:].min()
    over = float(excess[top] - max(below, above))
    steps = np.median(np.abs(np.diff(excess)) / np.hypot(sd[1:], sd[:-1])) / _MEDIAN
    if over < max(0.5 * float(np.ptp(excess)), FAR_SIGMA * float(sd[top]) * max(steps, 1.0)):
        return None
    high = np.flatnonzero(excess > excess[top] - 0.5 * over)
    beside = frequency[[max(high[0] - 1, 0), min(high[-1] + 1, len(rows) - 1)]].tolist()
    return Bump(float(frequency[top]), float(excess[top]), (beside[0], beside[1]))


_MEDIAN: Final = 0.6745
"""Of the size of a normal number, in its standard deviations."""


def has_shape(fit: JointFit) -> bool:
    """Whether the records differ from the model by more than a scatter: by an order, or kinds."""
    kinds = isinstance(fit.design, Design) and bool(groups(fit) or bump(fit))
    return kinds or is_orderly(fit)
