"""A law outside the catalogue is one curve, and not two effects at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import diagnose_recording, silent
from pendpipe.diagnosis.evidence import Rival
from pendpipe.diagnosis.one_curve import prefer_one_curve
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.state import State, Step
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects import Effect
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import Parameter, Pendulum
from pendpipe.effects.model import Model

from .records import INTERVAL_S, TIME_S, TRUTH, diagnosed, null_fit, prepared, recording, white


class Magnet(Effect):
    """A pull to the centre that reaches 40 mrad: the torque -m x/(1 + (x/w)^2)^2."""

    identifier = "magnet"
    name = "a magnet under the pendulum"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{-}= m x/(1 + (x/w)^2)^2"
    parameters = (Parameter("m", "1/s^2", -10.0, 10.0), Parameter("w", "rad", 1e-3, 1.0))
    discriminating_test = "take it away"

    def acceleration(
        self,
        motion: Motion,
        pendulum: Pendulum,  # noqa: ARG002
        values: FloatArray,
    ) -> FloatArray:
        """Return the torque over the moment of inertia."""
        pull, width = values
        return np.asarray(-pull * motion.angle / (1.0 + (motion.angle / width) ** 2) ** 2)


def pulled() -> FloatArray:
    model = Model(TIME_S, INTERVAL_S, (Magnet(),))
    return model.reading(np.append(TRUTH, [0.02, 0.04]))


def test_a_magnet_may_be_a_restoring_torque_without_a_name() -> None:
    """Friction of some other form leaves only noise as well: no name is sure."""
    found = diagnose_recording(recording(pulled(), 5)).diagnosis
    (effect,) = found.effects
    assert "unnamed-restoring" in {effect.identifier, *dict(effect.indistinguishable)}
    assert effect.probability < 0.9
    assert found.improved.chi2_per_dof == pytest.approx(1.0, abs=0.15)


def state_with(readings: FloatArray, *names: str) -> State:
    """A search that has added several effects."""
    data, noise = prepared(readings)
    effects = tuple(by_identifier(name) for name in names)
    bare = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    model = Model(TIME_S, INTERVAL_S, effects)
    shapes = [np.append(np.zeros(each.sizes), each.shapes(bare.at.span)[0]) for each in effects]
    fit = refine(model, data, noise, np.concatenate([bare.value, *shapes]))
    state = State(fit, data, noise, [], TRUTH, bare.value)
    state.steps = [Step((_rival(effect, fit),), 1e-9, bare) for effect in effects]
    return state


def _rival(effect: Effect, fit: Fit) -> Rival:
    from pendpipe.diagnosis.detect import Lead

    return Rival(Lead(effect, (), 100.0, 1e-9), fit, 100.0, 100.0)


def test_two_names_for_one_law_give_way_to_a_curve() -> None:
    state = state_with(pulled() + white(6), "frequency-drift", "cubic-stiffness")
    before = state.fit.chi2
    prefer_one_curve(state, silent)
    assert [step.winner.identifier for step in state.steps] == ["unnamed-restoring"]
    assert state.fit.chi2 < before + 40.0


def test_two_real_effects_keep_their_names() -> None:
    assert len(diagnosed("two").search.steps) == 2
    assert all(step.winner.lead.effect.kind != "unnamed" for step in diagnosed("two").search.steps)


def test_a_single_effect_stays() -> None:
    fit, data, noise = null_fit()
    state = State(fit, data, noise, [], TRUTH, fit.value)
    state.steps = [Step((_rival(by_identifier("cubic-stiffness"), fit),), 1e-9, fit)]
    prefer_one_curve(state, silent)
    assert state.fit is fit
    assert replace(state.steps[0]) == state.steps[0]
