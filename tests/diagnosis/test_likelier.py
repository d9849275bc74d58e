"""The reported effect is the likelier one in the end, whichever was added first."""

import functools
from dataclasses import replace

import pytest

from pendpipe.diagnosis import weighing
from pendpipe.diagnosis.hypothesis import Hypothesis, Step
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.diagnosis.weighing import Weighed, with_likelier
from pendpipe.effects.baseline import B

from .records import TRUTH, diagnosed, other_engine, recording, scanned


@functools.cache
def wrong_loss() -> Diagnosis:
    """A prediction with a wrong b: nothing is missing."""
    given = {"b": 1.1 * float(TRUTH[B])}
    return diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)


def having_taken(outcome: Diagnosis, name: str) -> Hypothesis:
    """The same search as if it had added another of the refitted effects."""
    found = outcome.search
    (step,) = found.steps
    first = next(rival for rival in step.rivals if rival.identifier == name)
    rest = tuple(rival for rival in step.rivals if rival is not first)
    held = found.held
    if step.winner.lead.effect.kind == "parameter":
        held = (*held, B)
    # Its refit was judged by the noise of that moment.
    fit = refine(first.fit.model, found.data, found.noise, first.fit.value, held=held)
    return replace(
        found,
        fit=fit,
        steps=(replace(step, rivals=(first, *rest)),),
        held=held,
        without_curve=None,
    )


def exchanged(found: Hypothesis) -> tuple[Hypothesis, tuple[Weighed, ...]]:
    """Put likelier rivals in, until there is none."""
    seen = set()
    while True:
        seen.add(found.key)
        weighed = tuple(weighing.weigh(found, step) for step in found.steps)
        after = with_likelier(found, weighed, seen)
        if after is None:
            return found, weighed
        found = after


def led(outcome: Diagnosis, name: str) -> tuple[Step, float, dict[str, float], Hypothesis]:
    """Return the final leader if another was added first, and all probabilities."""
    found, (weighed,) = exchanged(having_taken(outcome, name))
    (step,) = found.steps
    own, *others = weighed.weights[:-1].tolist()
    mates = {mate.identifier: each for mate, each in zip(weighed.mates, others, strict=True)}
    return step, own, mates, found


@pytest.mark.parametrize("taken", ["cubic-stiffness", "clock-drift", "unnamed-restoring"])
def test_a_likelier_effect_replaces_the_one_that_was_added(taken: str) -> None:
    """All fit a pendulum whose torque is sin x; the prior knows that it is."""
    step, own, mates, found = led(scanned("circular-error"), taken)
    assert step.winner.identifier == "circular-error"
    assert own > max(mates.values())
    assert taken in mates
    assert [effect.identifier for effect in found.fit.model.effects] == ["circular-error"]
    assert found.fit.chi2 == pytest.approx(scanned("circular-error").search.fit.chi2)


@pytest.mark.parametrize(
    ("name", "taken"),
    [
        ("frequency-drift", "cubic-stiffness"),
        ("frequency-drift", "clock-drift"),
        ("sensor-cubic", "sensor-cubic"),
    ],
)
def test_a_name_as_likely_as_its_rivals_stays(name: str, taken: str) -> None:
    step, own, mates, _ = led(diagnosed(name), taken)
    assert step.winner.identifier == taken
    assert 1.5 * own >= max(mates.values())


def test_a_wrong_parameter_replaces_missing_physics() -> None:
    """It is fitted then, and comes out right."""
    taken = next(
        rival.identifier
        for rival in wrong_loss().search.steps[0].rivals
        if rival.lead.effect.kind != "parameter"
    )
    step, _, _, found = led(wrong_loss(), taken)
    assert step.winner.identifier == "parameter-b"
    assert B not in found.held
    sd = float(found.fit.covariance()[B, B]) ** 0.5
    assert abs(found.fit.value[B] - TRUTH[B]) < 4.0 * sd
