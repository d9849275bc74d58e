"""Large amplitudes first where a misfit is gross, then the whole record from there.

Contacts and Coulomb friction dominate the last cycles of a record that decays to rest, the
restoring torque and the fluid its first. While both are wrong, the end loses the phase, and every
Gauss-Newton step stops the pendulum too early. So the large amplitudes are searched alone, and
the rest is added progressively.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.progressive_window import progressive_start
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.state import State, first_noise, is_gross
from pendpipe.dynamics.any_law import NoMotionError

_LARGE_AMPLITUDE: Final = 0.2
"""Amplitudes above this part of the first are large."""
_FEWEST_CYCLES: Final = 8
_CUT: Final = 0.97
_MOST_CUTS: Final = 8


def large_first(beginning: Beginning, state: State, add_one: Callable[[State], bool]) -> None:
    """Search the large amplitudes of a gross misfit, and start the whole record from there.

    Parameters
    ----------
    beginning
        Readings, baseline and start values.
    state
        After the baseline's fit to the whole record; updated with what is found.
    add_one
        Adds the best effect to a state, and returns whether there was one.
    """
    count = _large_readings(beginning)
    if count is None or not is_gross(state.fit, state.data):
        return
    part = _first_part(beginning, state, count)
    if part is None:
        return
    while is_gross(part.fit, part.data) and add_one(part):
        pass
    found = _extended(part, state)
    if found is None:
        return
    fit, data, noise = found
    # Compare only the readings that it follows (the noise of a gross misfit is white, so that
    # each reading has its own residual).
    before = float(np.sum(state.fit.residual[: len(data)] ** 2))
    if not fit.model.effects or fit.chi2 >= before:
        return
    state.steps, state.first, state.held = part.steps, part.first, part.held
    # The gross misfit is explained: estimate the noise anew from this model.
    state.settle(fit, data, noise)


def _large_readings(beginning: Beginning) -> int | None:
    """Count the readings at large amplitudes; None if these are all or too few."""
    points, data = beginning.points, beginning.data
    amplitude = np.abs(points.amplitude_rad)
    inside = points.time_s <= data.time_s[-1]
    if np.count_nonzero(inside) < 4 * _FEWEST_CYCLES:
        return None
    large = np.flatnonzero(amplitude[inside] > _LARGE_AMPLITUDE * amplitude[inside].max())
    last = int(large[-1])
    if not 2 * _FEWEST_CYCLES < last < 0.9 * np.count_nonzero(inside):
        return None
    return int(np.searchsorted(data.time_s, points.time_s[last]))


def _first_part(beginning: Beginning, state: State, count: int) -> State | None:
    data = state.data.first(count)
    model = beginning.model.at_times(data.time_s)
    noise = first_noise(replace(beginning, data=data, model=model))
    try:
        fit = refine(model, data, noise, beginning.value, held=state.held)
    except NoMotionError:
        return None
    part = State(fit, data, noise, list(state.held), state.origin, fit.value)
    part.settle(fit)
    return part


def _extended(part: State, state: State) -> tuple[Fit, Data, Noise] | None:
    """Extend the model to the end of the record, or as far as it can be fitted."""
    whole = state.data
    for cut in range(_MOST_CUTS):
        data = whole.first(int(len(whole) * _CUT**cut))
        model = part.fit.model.at_times(data.time_s)
        noise = state.noise.first(len(data), data.weight)
        try:
            value = progressive_start(
                model,
                data,
                noise.white_rms,
                part.fit.value,
                held=part.held,
                first=len(part.data),
            )
            fit = refine(model, data, noise, value, held=part.held)
        except (NoMotionError, np.linalg.LinAlgError):
            continue
        return fit, data, noise
    return None
