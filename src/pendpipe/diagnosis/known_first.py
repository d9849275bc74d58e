"""What the half swings ask for is fitted first: sin x, or a second mode that beats with the first.

Over a long record at large amplitude the linear law loses the phase by many turns, and where two
modes beat one alone has no phase; what is fitted to them there means little. The half swings, which
are counted, tell sin x and its start; the slow amplitude tells the modes. Where the linear law
keeps the phase, an effect with more values, a second plane say, would take what sin x changes
together with the rest.
"""

from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.begin import LARGE_PHASE_ERROR, Beginning
from pendpipe.diagnosis.detect import CATALOGUE_SHARE, Lead
from pendpipe.diagnosis.evidence import NO_SCAN, Rival, Scale
from pendpipe.diagnosis.refine import Fit, best_fit, better, fit_in_growing_window
from pendpipe.diagnosis.refits import LOST_PHASE_RAD
from pendpipe.diagnosis.scores import Candidate, build_bank, whitened
from pendpipe.diagnosis.state import State, Step
from pendpipe.diagnosis.task import Task, applicable
from pendpipe.effects import Effect
from pendpipe.effects.model import Model

_IMITATORS: Final = 3
"""Effects that are refitted in its place."""


def known_law_first(beginning: Beginning, state: State, task: Task) -> None:
    """Fit it from its own start, and take it as the first effect if it lowers chi^2.

    Parameters
    ----------
    beginning
        Its `known` is the effect and the start; None where the half swings don't ask for it by
        themselves and the linear law keeps the phase: the scan finds sin x as it finds others.
    state
        After the baseline's fit; updated.
    task
        Its catalogue holds what might imitate it.
    """
    if beginning.known is None:
        return
    effect, start = beginning.known
    task.progress(f"the half swings ask for {effect.name}: fitting it first")
    before = state.fit
    fit = fitted_from(before.model, state, effect, start)
    if fit is None or not _leads(fit, before, effect, state):
        return
    task.scanned(state)
    assert state.now is not None
    task.progress("refitting what may imitate it")
    known = Lead(effect, (), before.chi2 - fit.chi2, 0.0), fit
    fits = [known, *_imitated(fit, effect, state, task)]
    best = min((fit for _, fit in fits), key=lambda fit: fit.chi2)
    scale = Scale.of(best, state.data, state.noise)
    rivals = [Rival.of(lead, fit, before.chi2, scale, NO_SCAN) for lead, fit in fits]
    state.steps.append(Step(tuple(rivals), state.now.p_value / CATALOGUE_SHARE, before))
    state.settle(fit)


def _leads(fit: Fit, before: Fit, effect: Effect, state: State) -> bool:
    """Whether it leaves less than without, or what it loses is worth less than that it is known.

    Where a model has lost the phase its chi^2 is taken along the motion, and says less than the
    squares of the readings less the model.
    """
    data = state.data
    left, right = (np.sum((data.residual(f.at.reading) * data.weight) ** 2) for f in (fit, before))
    if left < right or max(fit.max_phase_error_rad, before.max_phase_error_rad) > LOST_PHASE_RAD:
        return bool(left < right)
    best = min((fit, before), key=lambda each: each.chi2)
    worth = Scale.of(best, data, state.noise).worth(before.chi2, fit, effect)
    return worth + effect.prior > 0.0


def _imitated(fit: Fit, effect: Effect, state: State, task: Task) -> list[tuple[Lead, Fit]]:
    """Refit what changes the readings as it does, each from the values that imitate it."""
    noise = state.noise
    own = fit.value[len(fit.value) - effect.count :]
    shape = tuple(own[effect.sizes :].tolist())
    change = own[: effect.sizes] @ whitened(fit, noise, effect, [shape])
    others = applicable(task.catalogue, fit, task.baseline, state.data.unit)
    names = [each for each in others if each.kind != "unnamed" and each.sizes == effect.sizes]
    bank = build_bank(fit, noise, names)
    scores = bank.scores(change - bank.basis @ (bank.basis.T @ change))
    found: dict[str, tuple[float, Candidate]] = {}
    for candidate, score in zip(bank.candidates, scores.tolist(), strict=True):
        if score > found.get(candidate.effect.key, (0.0, candidate))[0]:
            found[candidate.effect.key] = score, candidate
    near = sorted(found.values(), key=lambda pair: -pair[0])[:_IMITATORS]
    fits = []
    for score, (other, shape, _, _) in near:
        model, start = fit.model.dropping(effect, fit.value)
        free = [k for k in fit.free if k < len(start)]
        columns = np.column_stack([fit.jacobian[:, free], *whitened(fit, noise, other, [shape])])
        moved = np.linalg.lstsq(columns, change, rcond=1e-11)[0]
        start[free] += moved[: len(free)]
        start = np.concatenate([start, moved[len(free) :], shape])
        imitated = fitted_from(model, state, other, start)
        if imitated is not None:
            fits.append((Lead(other, shape, score, 0.0), imitated))
    return fits


def fitted_from(base: Model, state: State, effect: Effect, start: FloatArray) -> Fit | None:
    """Fit at once, and in a growing window where that loses the phase; return the better one."""
    model, data, noise = base.adding(effect), state.data, state.noise
    fit = best_fit(model, data, noise, [start], held=state.held)
    if fit and fit.converged and fit.max_phase_error_rad < LARGE_PHASE_ERROR:
        return fit
    return better(fit, fit_in_growing_window(model, data, noise, start, held=state.held))
