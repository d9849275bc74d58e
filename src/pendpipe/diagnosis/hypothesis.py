"""A set of effects with its fit, its noise and its faults; and what a search is to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.analysis.fit.by_waveform import ODDS
from pendpipe.analysis.fit.fitted import DragForm
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.data import Data, with_lattice
from pendpipe.diagnosis.detect import CATALOGUE_SHARE, Detection, detect, prepare
from pendpipe.diagnosis.found import COLOURED_NOISE, Finding
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import Noise, estimate_noise, noise_of_counts, white_noise
from pendpipe.diagnosis.refine import (
    GROSS,
    INCOMPLETE,
    Fit,
    Remainder,
    best_fit,
    is_gross,
    loses_phase,
    refine,
    remainder_of,
)
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.dynamics.eq8 import OMEGA, A, Restoring
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.in_time import (
    damping_modulation,
    resonant_drive,
    slow_modulation,
    viscous_step,
)
from pendpipe.effects.catalogue.losses import drag_form
from pendpipe.effects.catalogue.reading import (
    PERSPECTIVE,
    WIDE_RAD,
    SoftClipping,
    camera_geometry,
    camera_seen_wide,
    gain_modulation,
    hum_near_the_motion,
    tone_pickup,
    tone_with_harmonics,
)
from pendpipe.effects.catalogue.restoring import CIRCULAR_ERROR_IN, circular_error
from pendpipe.effects.curves import CURVES, Curve
from pendpipe.score import price_of_another

if TYPE_CHECKING:
    from pendpipe.diagnosis.rivals import Rival

MOST_EFFECTS: Final = 4
"""That are added: a choice, of time."""
RANDOM: Final = ("jitter", "broadband-drive")
"""Faults that count as names: a random cause can take what a wrong name leaves."""
_ESTIMATE_AGAIN: Final = 0.95
"""Ratio of noise estimates below which the noise is estimated again."""
_ROUNDS: Final = 3
"""Times that noise and fit follow each other: each time the noise falls by 5 %, or it ends."""
_LEAST_STEP: Final = 0.1
"""Smallest plausible noise of a rounded reading, over the step."""


@dataclass(frozen=True)
class Step:
    """One added effect, with its rivals.

    Parameters
    ----------
    rivals
        All refitted effects, the winner first.
    p_value
        Global, when it was found.
    before
        The model to which it was added; once weighed, that of all other effects.
    predicted_worse
        Twice the log density that it costs in the prediction of cycles left out.
    mates
        The effects that the recording cannot distinguish from it, the best of each identifier.
    weights
        Probabilities of the effect, of its mates, and of none of them; empty until it is weighed.
    """

    rivals: tuple[Rival, ...]
    p_value: float
    before: Fit
    predicted_worse: float = 0.0
    mates: tuple[Rival, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def winner(self) -> Rival:
        """The effect that was added."""
        return self.rivals[0]


def price(steps: Sequence[Step]) -> float:
    """Return the charges of a set of effects, with the prices of names and of predictions."""
    names = sum(map(price_of_another, range(sum(map(is_further, steps)))))
    return names + sum(step.winner.charge + step.predicted_worse for step in steps)


def is_further(step: Step) -> bool:
    """Whether it is a name with a price: no curve, and nothing that is there anyway."""
    effect = step.winner.effect
    known = effect.expected or effect.parameter_free or isinstance(effect, ReleasedParameter)
    return not (known or effect.kind == "unnamed")


@dataclass(frozen=True)
class Hypothesis:
    """What may be true of a recording; a search goes from one to the next.

    Parameters
    ----------
    beginning
        The readings as they were chosen, and the baseline's start values.
    fit, data, noise
        The model, the readings (masked, with corrected times), and their noise.
    held
        Indices of values that are not fitted.
    baseline
        The baseline fitted alone; once the search is over, with the final noise.
    samples
        The readings as recorded, less what was corrected; None where they are not tested.
    steps
        One for each effect.
    faults
        Of the measurement, found by their own tests; their p-values are global.
    quiet
        By name, the p-values of the tests that found nothing.
    notes
        What the tests of the measurement say that is no fault, a clause each, by test.
    first, now
        The scans of the baseline's residual and of the present one.
    without_curve
        The fit without the curve at the end: probabilities of names refer to it. None where there
        is no such curve, or no name beside it.
    lower, words
        By how much its score is lower than that of the hypothesis it was made from, and what was
        done to that one.
    """

    beginning: Beginning
    fit: Fit
    data: Data
    noise: Noise
    held: tuple[int, ...]
    baseline: Fit
    samples: Samples | None = None
    steps: tuple[Step, ...] = ()
    faults: tuple[Finding, ...] = ()
    quiet: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    first: Detection | None = None
    now: Detection | None = None
    without_curve: Fit | None = None
    lower: float = 0.0
    words: str = ""

    def settle(self, fit: Fit, data: Data | None = None, noise: Noise | None = None) -> Hypothesis:
        """Return the hypothesis with a new fit, and the noise estimated from it."""
        data, noise = data or self.data, noise or self.noise
        fit = with_better_instants(fit, data, noise, self.held)
        fit, data, noise = settled(fit, data, noise, self.held)
        baseline = self.baseline if fit.model.effects else fit
        return replace(self, fit=fit, data=data, noise=noise, baseline=baseline)

    @property
    def key(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Its drag, effects and faults: where a search has been it does not return."""
        effects = [effect.key for effect in self.fit.model.effects]
        released = [str(index) for index in self.beginning.held if index not in self.held]
        faults = sorted(each.identifier for each in self.faults)
        # What happens at an instant may happen twice.
        return (self.fit.model.drag, *sorted([*effects, *released])), tuple(faults)

    def other_drag(self, *gone: Step) -> Fit | None:
        """Fit the model with the other form of the drag, and without the effects of some steps.

        None where they are one, without a drag that is fitted.
        """
        model, value = self.fit.model, self.fit.value
        if A in self.held or not value[A] > 0.0:
            return None
        model = replace(model, drag="energy" if model.drag == "speed" else "speed")
        for step in gone:
            model, value = model.dropping(step.winner.effect, value)
        return best_fit(model, self.data, self.noise, [value], held=self.held)

    @cached_property
    def drag_form(self) -> DragForm:
        """That the readings prefer; told by the fit, unless the search has taken the other."""
        fit, drag = self.beginning.fit, self.baseline.model.drag
        if fit is not None and fit.light == "red":
            return drag
        if fit is not None and fit.form.drag == drag:
            return fit.drag_form
        other = self.other_drag()
        return drag if other is None or other.chi2 - self.fit.chi2 > 2.0 * ODDS else "undecided"

    @property
    def scan(self) -> Detection:
        """The last scan."""
        assert self.now is not None
        return self.now

    def without(self, *steps: Step) -> Fit | None:
        """Fit the model again without the effects of some of its steps, once for all who ask.

        A parameter that a step released is held again.
        None where it has no such motion: they are needed.
        """
        key = tuple(map(id, steps))
        if key not in self._without:
            model, value, held = self.fit.model, self.fit.value.copy(), list(self.held)
            for effect in (step.winner.effect for step in steps):
                model, value = model.dropping(effect, value)
                if isinstance(effect, ReleasedParameter) and effect.index is not None:
                    held.append(effect.index)
                    value[effect.index] = self.beginning.value[effect.index]
            bare = np.concatenate([self.baseline.value, value[self.baseline.model.size :]])
            starts = [value, bare, *(step.before.value for step in steps)]
            self._without[key] = best_fit(model, self.data, self.noise, starts, held=held)
        return self._without[key]

    @cached_property
    def _without(self) -> dict[tuple[int, ...], Fit | None]:
        return {}

    @cached_property
    def remainder(self) -> Remainder:
        """Misfit of the model beyond the noise."""
        return remainder_of(self.fit, self.data, self.noise)

    @property
    def p_value(self) -> float:
        """Global, on the baseline: of the catalogue's largest score, and of the tests.

        Where nothing was added the last scan counts, with the noise as it is known at last.
        Properties of the record that do no harm (a coarse step at large amplitude) don't count,
        nor does the colour of its noise.
        """
        first = self.first if self.steps or self.now is None else self.now
        assert first is not None
        faults = [each.p_value for each in self.faults if each.identifier != COLOURED_NOISE]
        return min(first.p_value / CATALOGUE_SHARE, *self.quiet.values(), *faults, 1.0)

    @property
    def unexplained(self) -> float:
        """Global p-value of the residual."""
        return min(self.scan.p_value / CATALOGUE_SHARE, 1.0)


def first_noise(beginning: Beginning) -> Noise:
    """Return white noise, estimated from differences without the motion."""
    data = beginning.data
    if not data.time_noise:
        return white_noise(data, data.noise_rms)
    at = beginning.model.evaluate(beginning.value)
    return white_noise(data, 1.0, noise_of_counts(data.residual(at.reading), at.sampled.velocity))


def noise_of_residual(fit: Fit, data: Data, *, red: bool = True) -> Noise:
    """Estimate the noise from a fit's residual."""
    frequency = fit.value[OMEGA] / (2.0 * np.pi)
    residual = data.residual(fit.at.reading)
    level = noise_of_counts(residual, fit.at.sampled.velocity) if data.time_noise else None
    floor = _LEAST_STEP * data.step
    power = fit.at.sampled.amplitude**2
    seen = float(np.mean(power) ** 2 / np.mean(power**2))
    cycles = frequency * float(np.ptp(data.time_s)) * seen
    return estimate_noise(data, residual, frequency, floor, cycles=cycles, red=red, level=level)


def settled(
    fit: Fit, data: Data, noise: Noise, held: Sequence[int], *, red: bool = True
) -> tuple[Fit, Data, Noise]:
    """Estimate the noise again if the model is good enough, and refit with it."""
    if noise.known:
        return refine(fit.model, data, noise, fit.value, held=held), data, noise
    if data.time_noise and is_gross(fit, data):
        # Rows that come with counts sweep the harmonics: a misfit can't be kept from the noise.
        return fit, data, noise
    finer = with_lattice(data, fit.at.reading)
    left = noise_of_residual(fit, finer, red=red)
    # Differences of phase within the noise at the motion's frequency are none.
    turns = fit.value[OMEGA] / (2.0 * np.pi) * float(data.time_s[-1] - data.time_s[0])
    finer = replace(finer, noise_rms=left.rms_at(turns / (len(data) - 1)))
    if is_gross(fit, data) and fit.model.effects:
        # Beside named effects it is noise if it is steady, and by the harmonics as between them.
        whitened = left.whiten(finer.residual(fit.at.reading))
        changes = left.level is not None
        if loses_phase(fit) or changes or left.misfit(whitened) > INCOMPLETE**2:
            return fit, data, noise
    better = refine(fit.model, finer, left, fit.value, held=held)
    # A misfit that is gross for the first estimate of the noise may itself be noise.
    gross = is_gross(better, finer) or left.misfit(better.residual) > GROSS
    if is_gross(fit, data) and gross:
        return fit, data, noise
    for _ in range(_ROUNDS):
        # The rounding of a better model, too.
        finer = replace(with_lattice(finer, better.at.reading), noise_rms=finer.noise_rms)
        again = noise_of_residual(better, finer, red=red)
        if again.rms > _ESTIMATE_AGAIN * left.rms:
            break
        left, better = again, refine(fit.model, finer, again, better.value, held=held)
    return better, finer, left


def catalogue_beside(restoring: Restoring | None) -> list[Effect]:
    """Return the catalogue; without sin x where the torque is known."""
    from pendpipe.effects.catalogue import CATALOGUE

    return [each for each in CATALOGUE if not (restoring and each is circular_error)]


def applicable(
    catalogue: Sequence[Effect], fit: Fit, baseline: str, unit: str, *, rare: bool = False
) -> list[Effect]:
    """Return the effects that a baseline may lack, and curves for what has no name.

    Or, with `rare`, those that are asked where a curve would be added: rare effects, and what every
    pendulum has.

    The form of the drag is none: without a size it is no lead but a neighbour (`other_drag`).

    What happens at an instant may happen twice: a second one is a copy, so that the model can
    tell their values apart.
    """
    used = {effect.identifier for effect in fit.model.effects}
    named = [
        copy(effect) if effect.identifier in used else effect
        for effect in catalogue
        if effect.has_signature
        and (effect.rare or (rare and effect.expected)) == rare
        and baseline not in effect.inside
        and (unit in ("rad", "rad/s") or not effect.angular)
        and not (effect.form and fit.at.span.pendulum.has(effect.form))
        and effect is not drag_form
        and (effect.identifier not in used or effect.local)
    ]
    if rare:
        if fit.at.span.first_amplitude > WIDE_RAD:
            named = [camera_seen_wide if e is camera_geometry else e for e in named]
        return list(fit.model.admitted(named))
    keys = {effect.key for effect in fit.model.effects}
    modulations = slow_modulation, gain_modulation, damping_modulation
    forms: list[Effect | None] = [SoftClipping(), resonant_drive, viscous_step, *modulations]
    if any(effect.identifier == circular_error.identifier for effect in catalogue):
        forms.append(CIRCULAR_ERROR_IN.get(unit))
    if tone_pickup.identifier not in used:
        forms += (tone_with_harmonics, hum_near_the_motion)
    if unit in ("m", "pixels") and camera_geometry.identifier not in used:
        forms += PERSPECTIVE
    named += [form for form in forms if form and form.key not in keys]
    return [*fit.model.admitted(named), *undrawn(CURVES, fit)]


def undrawn(curves: Sequence[type[Curve]], fit: Fit) -> list[Effect]:
    """Return the curves along a fitted motion, but for what its model has a curve of."""
    present = {(e.identifier, e.argument) for e in fit.model.effects if isinstance(e, Curve)}
    absent = [each for each in curves if (each.identifier, each.argument) not in present]
    return list(fit.model.admitted([curve(fit.at.span) for curve in absent]))


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

    def asked(self, fit: Fit, unit: str) -> list[Effect]:
        """Return all that a model may lack: effects of the catalogue, and what is held."""
        released = [each for each in self.released if each not in fit.model.effects]
        return [*applicable(self.catalogue, fit, self.baseline, unit), *released]

    def scanned(self, state: Hypothesis) -> Hypothesis:
        """Score all that may be missing on a hypothesis's residual (into `now`)."""
        effects = self.asked(state.fit, state.data.unit)
        self.progress(f"scanning {len(effects)} effects")
        scanner = prepare(state.fit, state.data, state.noise, effects)
        now = detect(scanner, state.fit, seed=self.seed, known=state.now)
        return replace(state, now=now, first=state.first or now)
