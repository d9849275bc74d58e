"""A curve may follow parts of two effects: what one leaves, a second explains."""

from __future__ import annotations

import numpy as np

from pendpipe.analysis.turning_points.samples import prepare as prepare_samples
from pendpipe.diagnosis import silent
from pendpipe.diagnosis.detect import detect, prepare
from pendpipe.diagnosis.evidence import Rival
from pendpipe.diagnosis.faults import Forensics
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.state import State, first_noise
from pendpipe.diagnosis.task import Task, applicable
from pendpipe.diagnosis.two_names import prefer_two_names
from pendpipe.effects.catalogue import CATALOGUE

from .records import beginning_of, recording, with_effects
from .test_one_curve import pulled


def rivals_after(readings: np.ndarray, seed: int) -> list[Rival]:
    """A curve of the torque leads; return what leads after two effects are tried."""
    record = recording(readings, seed)
    begun = beginning_of(record)
    noise = first_noise(begun)
    fit = refine(begun.model, begun.data, noise, begun.value)
    state = State(fit, begun.data, noise, [], begun.value, fit.value)
    task = Task(
        CATALOGUE, (), "eq8", 0.01, 1, Forensics(prepare_samples(record, "the test"), 0.01), silent
    )
    effects = applicable(CATALOGUE, fit, "eq8", "rad")
    state.now = detect(prepare(fit, begun.data, noise, effects), fit, seed=1)
    lead = next(each for each in state.now.leads if each.effect.identifier == "unnamed-restoring")
    start = np.append(fit.value, np.zeros(lead.effect.count))
    drawn = refine(begun.model.adding(lead.effect), begun.data, noise, start)
    gain = fit.chi2 - drawn.chi2
    return prefer_two_names(state, [Rival(lead, drawn, gain, gain)], task)


def test_a_step_and_a_tone_go_before_a_curve() -> None:
    found = rivals_after(with_effects("equilibrium-step", "tone-pickup"), 3)
    assert found[0].identifier in ("equilibrium-step", "tone-pickup")
    assert found[1].identifier == "unnamed-restoring"


def test_a_law_outside_the_catalogue_stays_a_curve() -> None:
    found = rivals_after(pulled(), 3)
    assert [each.identifier for each in found] == ["unnamed-restoring"]
