"""Wrong held parameters or missing physics: the parameters are tried first.

If held parameters, released together, explain as much as the best effect or curve, nothing need
be missing. Of these parameters only those that are needed are reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from pendpipe.diagnosis.evidence import SIZE_CHARGE, Rival
from pendpipe.diagnosis.moves import FURTHER
from pendpipe.diagnosis.refine import Fit, best_fit
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.state import State


def prefer_parameters(state: State, rivals: Sequence[Rival]) -> list[Rival]:
    """Put a held parameter first if such parameters alone explain as much as any effect.

    Parameters
    ----------
    state
        The model to which the effects would be added.
    rivals
        Refitted effects, every held parameter among them; the best first.

    Returns
    -------
    list
        The same rivals; of the fewest held parameters needed, the one that gains most leads.
    """
    released = [rival for rival in rivals if isinstance(rival.lead.effect, ReleasedParameter)]
    if not released or (len(released) == 1 and rivals[0] is released[0]):
        return list(rivals)
    most = _together(state, released)
    if most is None or not _do_as_well(state, most, released[:1], rivals):
        return list(rivals)
    needed, fit = _fewest(state, released, most)
    if not _do_as_well(state, fit, needed, rivals):
        return list(rivals)
    first = max(needed, key=lambda rival: rival.gain)
    return [first, *(rival for rival in rivals if rival is not first)]


def _fewest(state: State, released: Sequence[Rival], most: Fit) -> tuple[Sequence[Rival], Fit]:
    """Return the fewest parameters to which no other adds more than chance, and their fit."""
    for number in range(1, len(released)):
        tried = [(some, _together(state, some)) for some in combinations(released, number)]
        fits = [(some, fit) for some, fit in tried if fit is not None]
        some, best = min(fits, key=lambda each: each[1].chi2, default=(released, most))
        if best.chi2 - most.chi2 < SIZE_CHARGE * _unit(released[0]) * (len(released) - number):
            return some, best
    return released, most


def _together(state: State, released: Sequence[Rival]) -> Fit | None:
    """Fit the model with some held parameters released."""
    if len(released) == 1:
        return released[0].fit
    model, held = state.fit.model, list(state.held)
    for rival in released:
        effect = rival.lead.effect
        assert isinstance(effect, ReleasedParameter)
        model, held = model.adding(effect), effect.without(held)
    best = min(released, key=lambda rival: rival.fit.chi2)
    return best_fit(model, state.data, state.noise, [best.fit.value], held=held)


def _do_as_well(state: State, fit: Fit, needed: Sequence[Rival], rivals: Sequence[Rival]) -> bool:
    """Whether wrong parameters explain as much as each effect and curve.

    A single wrong parameter has a high prior. Several must be better than one effect that does as
    well alone, by the margin that two effects need.
    """
    one, more = needed[0], len(needed) - 1
    worth = (
        (state.fit.chi2 - fit.chi2) / _unit(one) - SIZE_CHARGE * more + (0.0 if more else one.prior)
    )
    return all(
        worth >= rival.evidence + (FURTHER if more and not rival.drawn else 0.0)
        for rival in rivals
        if not isinstance(rival.lead.effect, ReleasedParameter)
    )


def _unit(rival: Rival) -> float:
    """Return the chi^2 that counts as 1."""
    return rival.gain / rival.worth if rival.worth > 0.0 else 1.0
