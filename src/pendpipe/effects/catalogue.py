"""The catalogue: every effect that is known, each once."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Final

from pendpipe.effects import forensic
from pendpipe.effects.backlash import Backlash
from pendpipe.effects.baseline_friction import CoulombFriction, QuadraticDrag
from pendpipe.effects.circular_error import CircularError
from pendpipe.effects.cubic_damping import CubicDamping
from pendpipe.effects.cubic_stiffness import CubicStiffness
from pendpipe.effects.drag_form import DragForm
from pendpipe.effects.drifts import DampingDrift, EquilibriumCreep, FrequencyDrift
from pendpipe.effects.effect import Effect
from pendpipe.effects.history_force import HistoryForce
from pendpipe.effects.power_law_damping import PowerLawDamping
from pendpipe.effects.presliding_friction import PreslidingFriction
from pendpipe.effects.quadratic_stiffness import QuadraticStiffness
from pendpipe.effects.release_transient import ReleaseTransient
from pendpipe.effects.sensor_backlash import SensorBacklash
from pendpipe.effects.sensor_curvature import SensorCubic, SensorQuadratic
from pendpipe.effects.sensor_drifts import AcCoupling, GainDrift, OffsetDrift
from pendpipe.effects.stribeck_friction import StribeckFriction
from pendpipe.effects.sudden import (
    AmplitudeStep,
    DampingStep,
    EquilibriumStep,
    FrequencyStep,
    Impulse,
)
from pendpipe.effects.time_base import ClockDrift, DroppedSamples
from pendpipe.effects.tones import PeriodicDrive, PlaneCoupling, SecondMode, TonePickup
from pendpipe.effects.vortex_shedding import VortexShedding
from pendpipe.errors import InputError

CATALOGUE: Final[tuple[Effect, ...]] = (
    CircularError(),
    CubicStiffness(),
    QuadraticStiffness(),
    CoulombFriction(),
    QuadraticDrag(),
    DragForm(),
    PowerLawDamping(),
    CubicDamping(),
    StribeckFriction(),
    PreslidingFriction(),
    Backlash(),
    HistoryForce(),
    VortexShedding(),
    SecondMode(),
    PlaneCoupling(),
    PeriodicDrive(),
    forensic.BroadbandDrive(),
    FrequencyDrift(),
    DampingDrift(),
    EquilibriumCreep(),
    EquilibriumStep(),
    AmplitudeStep(),
    FrequencyStep(),
    DampingStep(),
    Impulse(),
    ReleaseTransient(),
    SensorQuadratic(),
    SensorCubic(),
    SensorBacklash(),
    OffsetDrift(),
    GainDrift(),
    AcCoupling(),
    TonePickup(),
    forensic.Clipping(),
    forensic.MissingCodes(),
    forensic.CoarseQuantisation(),
    ClockDrift(),
    forensic.Jitter(),
    DroppedSamples(),
    forensic.Glitches(),
    forensic.ColouredNoise(),
)
"""In the order of the manual: dynamics, then measurement."""

_BY_IDENTIFIER: Final = {effect.identifier: effect for effect in CATALOGUE}


def by_identifier(name: str, place: str | Path = "effect") -> Effect:
    """Return the effect of an identifier.

    Parameters
    ----------
    name
        Its identifier.
    place
        Where the name stands, for the message.

    Raises
    ------
    InputError
        If there is none; the nearest name is said.
    """
    found = _BY_IDENTIFIER.get(name)
    if found is None:
        close = difflib.get_close_matches(name, _BY_IDENTIFIER, n=1, cutoff=0.5)
        nearest = f"did you mean '{close[0]}'?" if close else "see docs/effects.md for all names"
        raise InputError(place, f"there is no effect '{name}'", nearest)
    return found


__all__ = ["CATALOGUE", "by_identifier"]
