"""What a search is asked, and which effects it may choose from."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

from pendpipe.diagnose import Progress
from pendpipe.diagnose.chance import CATALOGUE_SHARE
from pendpipe.diagnose.detect import detect, prepare
from pendpipe.diagnose.faults import Forensics
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.state import State
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.sensor import SoftClipping
from pendpipe.effects.curves import CURVES, Curve


def applicable(catalogue: Sequence[Effect], fit: Fit, baseline: str, unit: str) -> list[Effect]:
    """Choose the effects that a baseline may lack, and curves for what has no name.

    What happens at an instant may happen again: a second one is an object of its own, by which
    its values are found in the model.
    """
    value = fit.value
    present = {"a": value[0] > 0.0, "b": value[1] > 0.0, "c": value[2] > 0.0}
    used = {effect.identifier for effect in fit.model.effects}
    named = [
        copy(effect) if effect.identifier in used else effect
        for effect in catalogue
        if effect.has_signature
        and baseline not in effect.inside
        and (unit == "rad" or not effect.angular)
        and all(present[name] for name in effect.needs)
        and (effect.identifier not in used or effect.local)
    ]
    bent = SoftClipping()
    drawn = any(effect.key == bent.key for effect in fit.model.effects)
    return [*named, *([] if drawn else [bent]), *undrawn(CURVES, fit)]


def undrawn(curves: Sequence[type[Curve]], fit: Fit) -> list[Curve]:
    """Curves along a fitted motion, without those that are in its model."""
    drawn = {effect.key for effect in fit.model.effects}
    made = [curve(fit.at.span) for curve in curves]
    return [curve for curve in made if curve.key not in drawn]


@dataclass(frozen=True)
class Task:
    """What a search is asked, and what it asks with.

    Parameters
    ----------
    catalogue, freed
        The effects that may be missing, and the held parameters that may be wrong.
    baseline, level, seed
        As in `search`.
    forensics
        The tests of the measurement.
    progress
        Is told each step.
    """

    catalogue: Sequence[Effect]
    freed: Sequence[ReleasedParameter]
    baseline: str
    level: float
    seed: int
    forensics: Forensics
    progress: Progress

    @property
    def threshold(self) -> float:
        """The catalogue's part of the level."""
        return self.level * CATALOGUE_SHARE

    def scanned(self, state: State) -> list[Effect]:
        """Score all that may be missing on what a state leaves (`state.now`)."""
        effects = [
            *applicable(self.catalogue, state.fit, self.baseline, state.data.unit),
            *(entry for entry in self.freed if entry not in state.fit.model.effects),
        ]
        self.progress(f"scanning {len(effects)} effects")
        scanner = prepare(state.fit, state.data, state.noise, effects)
        state.now = detect(scanner, state.fit, seed=self.seed, known=state.now)
        state.first = state.first or state.now
        return effects
