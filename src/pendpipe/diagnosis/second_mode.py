"""Where two modes beat, the second is fitted first: alone the first has no phase."""

from dataclasses import replace

import numpy as np

from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.detect import CATALOGUE_SHARE, Lead
from pendpipe.diagnosis.evidence import NO_SCAN, Rival, Scale
from pendpipe.diagnosis.hypothesis import Hypothesis, Step
from pendpipe.diagnosis.refine import Fit, fitted_from
from pendpipe.diagnosis.task import Task
from pendpipe.effects.catalogue.in_time import BEATING_MODE


def second_mode_first(beginning: Beginning, state: Hypothesis, task: Task) -> Hypothesis:
    """Fit it from its own start, and take it as the first effect if it leaves less.

    Parameters
    ----------
    beginning
        Its `second_mode` is the start.
    state
        After the baseline's fit.
    task
        What the search is to do.
    """
    if beginning.second_mode is None:
        return state
    task.progress(f"the turning points beat: fitting {BEATING_MODE.name} first")
    before, data, noise = state.fit, state.data, state.noise
    start = np.concatenate([beginning.value, beginning.second_mode])
    fit = fitted_from(before.model.adding(BEATING_MODE), data, noise, start, held=state.held)
    # Without its phase a model's chi^2 says less than the squares of what it leaves.
    if fit is None or not _square(fit, state) < _square(before, state):
        return state
    state = task.scanned(state)
    lead = Lead(BEATING_MODE, (), before.chi2 - fit.chi2, 0.0)
    rival = Rival.of(lead, fit, before.chi2, Scale.of(fit, data, noise), NO_SCAN)
    step = Step((rival,), state.scan.p_value / CATALOGUE_SHARE, before)
    return replace(state, steps=(step,)).settle(fit)


def _square(fit: Fit, state: Hypothesis) -> float:
    return float(np.sum((state.data.residual(fit.at.reading) * state.data.weight) ** 2))
