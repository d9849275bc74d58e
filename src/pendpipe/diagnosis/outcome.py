"""What a diagnosis ends with, as numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pendpipe.analysis.fit.result import FitResult
from pendpipe.diagnosis.found import (
    WANDERING_ZERO,
    FittedModel,
    FoundEffect,
    Verdict,
    verdict_of,
)
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.levels import FALSE_ALARM

if TYPE_CHECKING:
    from pendpipe.diagnosis.held_out import HeldOut
    from pendpipe.diagnosis.hypothesis import Hypothesis
    from pendpipe.diagnosis.refine import Remainder
    from pendpipe.diagnosis.seen import Seen


@dataclass(frozen=True, repr=False)
class Outcome:
    """Where model and recording differ, and what is missing.

    Parameters
    ----------
    baseline, improved
        The model that was asked for, and the one with the effects that were found.
    effects
        What the baseline has, and the missing in the order in which they were added.
    held_out
        None where nothing was added.
    seen, left
        What the readings show that the baseline does not, whatever its cause; and that the model
        with all that has a name does not.
    name
        Of the recording.
    search
        The fits and readings behind it; None where nothing could be fitted.
    alone, recordings
        Of several recordings: each one's own diagnosis, and what is said of it.
    drawn_by
        Imports what draws it (`pendpipe.api`): a result knows no figures.
    level
        The p-value from which chance explains a misfit.
    """

    baseline: FittedModel
    improved: FittedModel
    effects: tuple[FoundEffect, ...]
    held_out: HeldOut | None
    seen: tuple[Seen, ...] = ()
    left: tuple[Seen, ...] = ()
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    search: Hypothesis | None = field(default=None, repr=False, compare=False)
    alone: tuple[Outcome, ...] = field(default=(), repr=False, compare=False)
    recordings: tuple[dict[str, Any], ...] = ()
    level: float = FALSE_ALARM
    drawn_by: Callable[[], Any] | None = field(default=None, repr=False, compare=False)

    @property
    def p_value(self) -> float:
        """Global: of the largest score over the whole catalogue; of several, of all searches."""
        if self.search is None:
            return math.nan
        found = [self.search.p_value, *(each.p_value for each in self.alone)]
        return min(1.0, len(found) * min(found))

    @property
    def fit(self) -> FitResult | None:
        """The fit that the diagnosis began with."""
        return None if self.search is None else self.search.beginning.fit

    @property
    def drag_form(self) -> str:
        """That the readings prefer."""
        return "energy" if self.search is None else self.search.drag_form

    @property
    def missing(self) -> tuple[FoundEffect, ...]:
        """The effects that the baseline lacks."""
        return tuple(each for each in self.effects if not each.presumed)

    @property
    def verdict(self) -> Verdict:
        """Whether something is missing: the baseline is consistent where chance explains it."""
        return verdict_of(self.missing, self.p_value, self.level)

    @property
    def unexplained_p_value(self) -> float:
        """Of what the improved model leaves."""
        return math.nan if self.search is None else self.search.unexplained

    @property
    def remainder(self) -> Remainder | None:
        """What it leaves in parts: its size over the noise, and where it lies."""
        return None if self.search is None else self.search.remainder

    @property
    def restoring(self) -> Restoring:
        """The baseline's torque; of several recordings together that of the first."""
        return "linear" if self.search is None else self.search.baseline.model.restoring

    @property
    def scanned(self) -> tuple[tuple[str, float], ...]:
        """What was looked for, with its p-value on the baseline's residual."""
        first = None if self.search is None or self.alone else self.search.first
        return (
            tuple((lead.effect.identifier, lead.p_value) for lead in first.leads) if first else ()
        )

    @property
    def noise_rms_rad(self) -> float:
        """Of one reading, never below step/sqrt(12)."""
        return self.improved.noise_rms_rad

    @property
    def unit(self) -> str:
        """Of the motion."""
        return "rad" if self.search is None else self.search.data.unit

    @property
    def wanders(self) -> bool:
        """Whether most of what is left is a zero that wanders."""
        return self.search is not None and WANDERING_ZERO in self.search.notes
