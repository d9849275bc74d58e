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
    from pendpipe.diagnosis.cycles import SmallSwings
    from pendpipe.diagnosis.held_out import HeldOut
    from pendpipe.diagnosis.hypothesis import Hypothesis
    from pendpipe.diagnosis.remainder import Remainder


@dataclass(frozen=True, repr=False)
class Outcome:
    """Where model and recording differ, and what is missing.

    Parameters
    ----------
    baseline_name, baseline, improved
        The model that was asked for, and the one with the effects that were found.
    p_value
        Global: of the largest score over the whole catalogue.
    effects
        What the baseline has, and the missing in the order in which they were added.
    held_out
        None where nothing was added.
    small_swings
        How the frequency differs from the improved model's at the smallest amplitudes, if it does.
    name
        Of the recording.
    fit
        The fit that the diagnosis began with.
    search
        The fits and readings behind it; None where nothing could be fitted.
    alone, recordings
        Of several recordings: each one's own diagnosis, and what is said of it.
    drawn_by
        Imports what draws it (`pendpipe.api`): a result knows no figures.
    drag_form
        That the readings prefer.
    level
        The p-value from which chance explains a misfit.
    """

    baseline_name: str
    baseline: FittedModel
    improved: FittedModel
    p_value: float
    effects: tuple[FoundEffect, ...]
    held_out: HeldOut | None
    warnings: tuple[str, ...] = ()
    small_swings: SmallSwings | None = None
    drag_form: str = "energy"
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    fit: FitResult | None = field(default=None, repr=False, compare=False)
    search: Hypothesis | None = field(default=None, repr=False, compare=False)
    alone: tuple[Outcome, ...] = field(default=(), repr=False, compare=False)
    recordings: tuple[dict[str, Any], ...] = ()
    level: float = FALSE_ALARM
    drawn_by: Callable[[], Any] | None = field(default=None, repr=False, compare=False)

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
        if self.alone:
            return self.alone[0].restoring
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
        if self.search is not None:
            return self.search.data.unit
        amplitude = self.baseline.parameters.get("amplitude")
        return "rad" if amplitude is None else amplitude.unit

    @property
    def wanders(self) -> bool:
        """Whether most of what is left is a zero that wanders."""
        return self.search is not None and WANDERING_ZERO in self.search.notes
