"""What can be hidden: an effect, the law by which it acts here, and its strength's scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeAlias

import numpy as np

from pendpipe_challenge.scenario import Scenario

Build: TypeAlias = Callable[[Scenario, float], Scenario]


@dataclass(frozen=True)
class Hidden:
    """One effect with its details drawn; only its strength is open.

    Parameters
    ----------
    effect
        Identifier of the contract, or ``unnamed-...`` for what is outside the catalogue.
    law
        The law by which it acts.
    build
        The scenario with the effect at a strength.
    scale
        A strength to begin the sizing with; its sign is the effect's.
    own_form
        Whether the law is the one that the catalogue itself writes.
    base
        The scenario without the effect at a strength, where it depends on it.
    prepared
        The scenario that the effect needs (released from rest, say), before its strength.
    sized
        ``shape``: by the square of the changed reading; ``variance``, ``codes``,
        ``process``: by expected log likelihood; ``fixed``: it has no strength.
    growth
        How Delta chi^2 grows with the strength: its exponent.
    details
        Truth that does not change with the strength, by name.
    parameter
        Name under which the strength itself is given.
    also
        Other names that would be right for this law.
    """

    effect: str
    law: str
    build: Build
    scale: float
    own_form: bool
    prepared: Scenario
    base: Build = lambda scenario, _: scenario
    sized: str = "shape"
    growth: float = 2.0
    largest: float = np.inf
    details: dict[str, float] = field(default_factory=dict)
    parameter: str = "strength"
    also: tuple[str, ...] = ()

    def at(self, strength: float) -> Scenario:
        """The scenario with the effect."""
        return self.build(self.prepared, strength)

    def without(self, strength: float = 0.0) -> Scenario:
        """The scenario without it."""
        return self.base(self.prepared, strength)

    @property
    def moves(self) -> bool:
        """Whether the scenario without the effect depends on its strength."""
        return self.base(self.prepared, 2.0) is not self.prepared

    def truth(self, strength: float) -> dict[str, float]:
        """The effect's numbers."""
        return {self.parameter: strength, **self.details}


Maker: TypeAlias = Callable[[np.random.Generator, Scenario], Hidden]
CATALOGUE: Final[dict[str, list[Maker]]] = {}
OUTSIDE: Final[dict[str, list[Maker]]] = {}


def law(effect: str) -> Callable[[Maker], Maker]:
    """Register a maker of a catalogue's effect."""

    def keep(maker: Maker) -> Maker:
        CATALOGUE.setdefault(effect, []).append(maker)
        return maker

    return keep


def outside(name: str) -> Callable[[Maker], Maker]:
    """Register a maker of something that no catalogue entry describes."""

    def keep(maker: Maker) -> Maker:
        OUTSIDE.setdefault(name, []).append(maker)
        return maker

    return keep


Draw: TypeAlias = Callable[[np.random.Generator, Scenario], tuple[float, dict[str, float]]]
"""A strength to begin with, and what else is set."""


def enter(
    effect: str,
    law: str,
    parameter: str,
    draw: Draw,
    *,
    chain: bool = False,
    own: bool = True,
    prepare: Callable[[Scenario], Scenario] | None = None,
    outside: str = "",
    **more: Any,
) -> None:
    """Register an effect whose strength is one number of the motion, or of the chain.

    Parameters
    ----------
    outside
        Its name where no catalogue's entry describes it.
    more
        Of `Hidden`, or what gives it for a scenario and the details.
    """

    def maker(random: np.random.Generator, scenario: Scenario) -> Hidden:
        scale, details = draw(random, scenario)

        def build(prepared: Scenario, strength: float) -> Scenario:
            changed = prepared.with_chain if chain else prepared.with_motion
            return changed(**{parameter: strength}, **details)

        prepared = prepare(scenario) if prepare else scenario
        hidden = Hidden(
            effect, law, build, scale, own, prepared, details=dict(details), parameter=parameter
        )
        own_more = {k: v(scenario, details) if callable(v) else v for k, v in more.items()}
        return replace(hidden, **own_more)

    (OUTSIDE if outside else CATALOGUE).setdefault(outside or effect, []).append(maker)


def amplitude(scenario: Scenario) -> float:
    """Amplitude at the first sample, rad."""
    motion = scenario.motion
    return float(np.hypot(motion.angle_rad, motion.rate_rad_s / scenario.omega))


def from_rest(scenario: Scenario) -> Scenario:
    """The same pendulum, let go at the first sample."""
    start = replace(scenario.motion, angle_rad=amplitude(scenario), rate_rad_s=0.0)
    return replace(scenario, motion=start)


def either_sign(random: np.random.Generator) -> float:
    """+1 or -1."""
    return float(random.choice([-1.0, 1.0]))


def moment(random: np.random.Generator, scenario: Scenario, low: float, high: float) -> float:
    """A moment within the judged part of the record, s."""
    from pendpipe_challenge.scenario import stop_s

    end = min(scenario.span_s, stop_s(scenario, scenario.motion.run(scenario.time_s)))
    return float(random.uniform(low, high) * end)
