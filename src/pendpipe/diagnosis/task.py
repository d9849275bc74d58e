"""What a search is to do, and the effects that it may choose from."""

import operator
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.detect import CATALOGUE_SHARE, detect, prepare
from pendpipe.diagnosis.hypothesis import Hypothesis
from pendpipe.diagnosis.refine import Fit
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.reading import SoftClipping
from pendpipe.effects.catalogue.restoring import CIRCULAR_ERROR_IN, circular_error
from pendpipe.effects.curves import CURVES, Curve


def applicable(
    catalogue: Sequence[Effect], fit: Fit, baseline: str, unit: str, *, rare: bool = False
) -> list[Effect]:
    """Return the effects that a baseline may lack, and curves for what has no name.

    Or, with `rare`, those that are asked where a curve would be added: rare effects, and what every
    pendulum has.

    What happens at an instant may happen twice: a second one is a copy, so that the model can
    tell their values apart.
    """
    value = fit.value
    present = {"a": value[0] > 0.0, "b": value[1] > 0.0, "c": value[2] > 0.0}
    used = {effect.identifier for effect in fit.model.effects}
    named = [
        copy(effect) if effect.identifier in used else effect
        for effect in catalogue
        if effect.has_signature
        and (effect.rare or (rare and effect.expected)) == rare
        and baseline not in effect.inside
        and (unit in ("rad", "rad/s") or not effect.angular)
        and not (effect.form and fit.at.span.pendulum.has(effect.form))
        and all(present[name] for name in effect.needs)
        and (effect.identifier not in used or effect.local)
    ]
    if rare:
        return list(fit.model.admitted(named))
    keys = {effect.key for effect in fit.model.effects}
    forms: list[Effect | None] = [SoftClipping()]
    if any(effect.identifier == circular_error.identifier for effect in catalogue):
        forms.append(CIRCULAR_ERROR_IN.get(unit))
    named += [form for form in forms if form and form.key not in keys]
    return [*fit.model.admitted(named), *undrawn(CURVES, fit)]


def undrawn(curves: Sequence[type[Curve]], fit: Fit) -> list[Effect]:
    """Return the curves along a fitted motion, without those in its model."""
    present = {effect.key for effect in fit.model.effects}
    made = fit.model.admitted([curve(fit.at.span) for curve in curves])
    return [curve for curve in made if curve.key not in present]


@dataclass(frozen=True)
class Task:
    """What a search is to do.

    Parameters
    ----------
    catalogue, released
        The effects that may be missing, and the held parameters that may be wrong.
    baseline, level, seed
        As in `search`.
    progress
        Receives one line for each step.
    samples
        The readings as they were recorded; None where the measurement is not tested.
    """

    catalogue: Sequence[Effect]
    released: Sequence[Effect]
    baseline: str
    level: float
    seed: int
    progress: Progress
    samples: Samples | None = None

    @property
    def threshold(self) -> float:
        """The catalogue's part of the significance level."""
        return self.level * CATALOGUE_SHARE

    def rare(self, state: Hypothesis) -> list[Effect]:
        """Return the names that are asked where a curve would be added."""
        return applicable(self.catalogue, state.fit, self.baseline, state.data.unit, rare=True)

    def scanned(self, state: Hypothesis) -> Hypothesis:
        """Score all that may be missing on a hypothesis's residual (into `now`), once."""
        asked = state.fit, state.data, state.noise
        if state.scanned is not None and all(map(operator.is_, asked, state.scanned)):
            return state
        effects = [
            *applicable(self.catalogue, state.fit, self.baseline, state.data.unit),
            *(entry for entry in self.released if entry not in state.fit.model.effects),
        ]
        self.progress(f"scanning {len(effects)} effects")
        scanner = prepare(state.fit, state.data, state.noise, effects)
        now = detect(scanner, state.fit, seed=self.seed, known=state.now)
        return replace(state, now=now, first=state.first or now, scanned=(*asked, effects))
