"""Naming: the leaders are refitted, and weighed against each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.chance import Chance, Trials
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.detect import Detection, Lead
from pendpipe.diagnose.distributions import chi2_beyond, chi2_of_one
from pendpipe.diagnose.finer import finer_shape
from pendpipe.diagnose.freed import FreedParameter
from pendpipe.diagnose.growing import grown
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.curves import Curve

CLASS: Final = 6.0
"""Twice the logarithm of the likelihood within which effects are of one class."""
_MOST: Final = 9
_NEAR: Final = 16.0
_ALIKE: Final = 0.98
_LARGEST: Final = 0.5
"""Of the first amplitude: what an effect may add to the reading."""
_LOST: Final = 1.0
"""Phase in rad from which a model has lost the motion."""
_FROM_AFAR: Final = 4
"""How many leads are then followed from the first cycles on."""
_SHAPE: Final = 2.0
"""What a fitted shape takes off a gain: that much chance makes of it (Akaike)."""
_FORM: Final = 3.0
"""Standard deviation of a difference of evidence for what a law's own form is worth."""
_SIZE: Final = 6.0
"""What a further size takes off a gain too large for p-values."""
_MUCH: Final = 0.5
"""Part of the best gain that a name must explain to go before a curve."""
_SOME: Final = 0.25
"""The same of what every pendulum has."""


@dataclass(frozen=True)
class Rival:
    """An effect, refitted.

    Parameters
    ----------
    lead
        What it was found by.
    fit
        The extended model's.
    gain
        Delta chi^2 over the model before it.
    evidence
        chi^2 of one degree of freedom that is as improbable by chance, the effect's own
        scan counted.
    """

    lead: Lead
    fit: Fit
    gain: float
    evidence: float

    @property
    def identifier(self) -> str:
        """The effect's."""
        return self.lead.effect.identifier


def refit_leads(
    base: Fit, data: Data, noise: Noise, detection: Detection, *, held: Sequence[int],
    gross: bool, origin: FloatArray, most: int = _MOST,
) -> list[Rival]:  # fmt: skip
    """Refit the leading effects nonlinearly; the best first."""
    fits: list[tuple[Lead, Fit]] = []
    for lead in _worth_refitting(detection, gross, most):
        fit = _refitted(base, data, noise, lead, held)
        if base.slip_rad > _LOST and len(fits) < _FROM_AFAR:
            fit = _better(fit, _from_afar(base, data, noise, lead, held, origin))
        if fit is not None and _believable(base, fit, lead.effect):
            fits.append((lead, fit))
    if not fits:
        return []
    # What is still left makes differences of chi^2 mean less.
    left = max(min(fit.chi2 for _, fit in fits) / max(data.used, 1), 1.0)
    rivals = [
        Rival(lead, fit, base.chi2 - fit.chi2,
              evidence(lead, (base.chi2 - fit.chi2) / left, detection.chance))
        for lead, fit in fits
    ]  # fmt: skip
    rivals.sort(key=lambda rival: -rival.evidence)
    return _named_first(rivals) if gross else _names_before_curves(rivals)


def _names_before_curves(rivals: list[Rival]) -> list[Rival]:
    """Prefer a name to a curve that the record cannot tell from it: curves follow any law.

    And a curve of the motion or the sensor to one in time, which follows anything.
    """
    best = rivals[0].evidence
    near = [rival for rival in rivals if best - rival.evidence < CLASS]
    near.sort(key=lambda rival: _freedom(rival.lead.effect))
    return [*near, *(rival for rival in rivals if rival not in near)]


def _freedom(effect: Effect) -> int:
    """How much an effect could follow: names, curves, curves in time."""
    return int(effect.kind == "unnamed") + int(isinstance(effect, Curve) and effect.in_time)


def of_one_class(best: Rival, rival: Rival) -> bool:
    """Whether the record cannot tell two effects apart, or only what is known beforehand can.

    A value that one has more takes 2 off its gain (Akaike).
    """
    more = max(best.lead.effect.count - rival.lead.effect.count, 0)
    by_record = best.gain - rival.gain - _SHAPE * more < CLASS
    return by_record or best.evidence - rival.evidence < CLASS


def _named_first(rivals: list[Rival]) -> list[Rival]:
    """While the misfit is gross, prefer names that explain much of it to curves that bend."""
    best = max(rival.gain for rival in rivals)
    named = [
        rival for rival in rivals
        if rival.lead.effect.kind != "unnamed"
        and rival.gain > (_SOME if rival.lead.effect.expected else _MUCH) * best
    ]  # fmt: skip
    # What must be there anyway goes before what merely fits a trifle better.
    named.sort(key=lambda rival: -rival.lead.effect.prior if rival.gain > _ALIKE * best else 0.0)
    # Bearing and fluid are there in any case, and what else bends is judged with them.
    named.sort(key=lambda rival: not rival.lead.effect.expected)
    return [*named, *(rival for rival in rivals if rival not in named)]


def _worth_refitting(detection: Detection, gross: bool, most: int) -> list[Lead]:
    """The leads that may win, or be in the winner's class."""
    leads = sorted(detection.leads, key=lambda lead: -_rank(lead))
    if not leads:
        return []
    best = _rank(leads[0])
    near = [lead for lead in leads if _rank(lead) > best - _NEAR - (0.9 if gross else 0.3) * best]
    return near[: most + 2 if gross else most]


def _rank(lead: Lead) -> float:
    return equivalent(lead.p_value, lead.score) + lead.effect.prior


def equivalent(p_value: float, score: float) -> float:
    """chi^2 of one degree of freedom with that p-value; `score` where p underflows."""
    if p_value <= 1e-290:
        return score
    return chi2_of_one(p_value)


def evidence(lead: Lead, gain: float, chance: Chance) -> float:
    """What a gain is worth, beside effects with more or fewer free values and shapes."""
    if gain <= 0.0:
        return 0.0
    effect = lead.effect
    if effect.switch:
        # Its size is predicted: a free one would have had to be found.
        gain += max(math.log(gain) - 0.45, 0.0)
    local = float(chi2_beyond(gain, effect.sizes))
    trials = chance.own.get(effect.key, Trials(1.0, 0.0))
    if local > 1e-290:
        worth = equivalent(trials.global_p_value(local), gain)
    else:
        # Too large for p-values: what trials and further sizes take off a large gain.
        worth = gain - 2.0 * math.log(max(trials.first, 1.0)) - _SIZE * (effect.sizes - 1)
    fitted = len(effect.parameters) - effect.sizes if effect.parameters else 0
    return worth - _SHAPE * max(fitted, 0) + effect.prior


def _believable(base: Fit, fit: Fit, effect: Effect) -> bool:
    """Whether displacements that an effect adds are smaller than the motion itself.

    Two tones of nearly one frequency can take each other's place: a second that is as large
    as the first describes a change of phase, and no second mode.
    """
    if effect.kind == "unnamed":
        return True
    first = len(base.value) + effect.switch
    sizes = [
        float(fit.value[first + index])
        for index, parameter in enumerate(effect.parameters[: effect.sizes])
        if parameter.unit == "rad"
    ]
    return math.hypot(*sizes) < _LARGEST * base.at.span.first_amplitude


def _refitted(base: Fit, data: Data, noise: Noise, lead: Lead, held: Sequence[int]) -> Fit | None:
    effect = lead.effect
    if isinstance(effect, FreedParameter):
        held = [index for index in held if index != effect.index]
    sizes = np.ones(1) if effect.switch else np.zeros(min(effect.sizes, effect.count))
    shape = finer_shape(base, noise, lead)
    start = np.concatenate([base.value, sizes, np.asarray(shape, dtype=np.float64)])
    try:
        return refine(base.model.adding(effect), data, noise, start, held=held)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _from_afar(
    base: Fit, data: Data, noise: Noise, lead: Lead, held: Sequence[int], origin: FloatArray
) -> Fit | None:
    """Refit from the first cycles on, where the base has lost the phase."""
    effect = lead.effect
    if isinstance(effect, FreedParameter) or effect.kind == "unnamed":
        return None
    sizes = np.ones(1) if effect.switch else np.zeros(effect.sizes)
    known = base.value[len(origin) :]
    start = np.concatenate([origin, known, sizes, np.asarray(lead.shape, dtype=np.float64)])
    model = base.model.adding(effect)
    try:
        value = grown(model, data, noise.white_rms, start, held=held)
        return refine(model, data, noise, value, held=held)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _better(one: Fit | None, other: Fit | None) -> Fit | None:
    if one is None or other is None:
        return one or other
    return one if one.chi2 <= other.chi2 else other


def probabilities(rivals: Sequence[Rival], none: float) -> FloatArray:
    """Probability of each rival, with `none` the evidence that it is none of these.

    Real laws differ a little from the catalogue's forms, so that differences of evidence
    between names are uncertain by `_FORM`; log odds are averaged over that (MacKay's
    approximation).
    """
    shrunk = 1.0 / math.sqrt(1.0 + math.pi / 8.0 * (0.5 * _FORM) ** 2)
    evidence = np.array([rival.evidence for rival in rivals])
    best = float(evidence.max())
    logs = np.append(0.5 * shrunk * (evidence - best), 0.5 * (none - best))
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())
