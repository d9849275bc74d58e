"""Several recordings of one pendulum as one measurement: physics shared, start and noise their own.

Each recording is diagnosed alone first: that gives its noise, its start, and what happened in it
alone. Then all readings are one problem (`effects.stack`), which the search of a single diagnosis
solves: by the same score, the same moves, the same check on cycles left out. The answer says what
the recordings share, settle, and predict of each other.
"""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from pendpipe.analysis.fit.fitted import Baseline, units
from pendpipe.analysis.readings import motion_of
from pendpipe.analysis.torque import TOP, swing_phase
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis import Progress, silent
from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.found import FittedModel, FoundEffect, Location
from pendpipe.diagnosis.held_out import held_out
from pendpipe.diagnosis.hypothesis import (
    MOST_EFFECTS,
    Hypothesis,
    Step,
    Task,
    catalogue_beside,
    price,
)
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.quoted import Description, averages, descriptions_of
from pendpipe.diagnosis.refine import Fit, best_fit, loses_phase, remainder_of, with_errors
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.rivals import Scale
from pendpipe.diagnosis.run import presumed
from pendpipe.diagnosis.search import LESS_FRICTION, run_search
from pendpipe.diagnosis.summary import DOUBTFUL
from pendpipe.diagnosis.values import constants_of
from pendpipe.diagnosis.weighing import effect_named
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import BASELINE, C, Restoring
from pendpipe.effects import Effect
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.model import Model
from pendpipe.effects.stack import MAY_DIFFER, Differs, Stack
from pendpipe.errors import InputError, NotAnalysableError
from pendpipe.estimate import Z95, Estimate
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import listed
from pendpipe.recording import Recording


@dataclass(frozen=True)
class StackedData(Data):
    """Readings of several recordings.

    Parameters
    ----------
    alone
        Of each recording; the weights of all stand before theirs.
    """

    alone: tuple[Data, ...] = ()

    @classmethod
    def of(cls, alone: Sequence[Data]) -> StackedData:
        """Put them one after the other."""
        series = ("time_s", "values", "weight")
        joined = (np.concatenate([getattr(each, name) for each in alone]) for name in series)
        time_s, values, weight = joined
        return cls(
            time_s,
            values,
            alone[0].interval_s,
            uniform=False,
            weight=weight,
            unit=alone[0].unit,
            alone=tuple(alone),
        )

    def each(self) -> list[Data]:
        """Return each recording's readings, with the present weights."""
        pairs = zip(self.alone, split(self.weight, self.alone), strict=True)
        return [replace(data, weight=weight) for data, weight in pairs]

    def residual(self, reading: FloatArray) -> FloatArray:
        """Return readings minus model, with the mean rounding error of the model."""
        pairs = zip(self.alone, split(reading, self.alone), strict=True)
        return np.concatenate([data.residual(part) for data, part in pairs])


@dataclass(frozen=True)
class StackedNoise(Noise):
    """Noise of several recordings; it is known from each of them alone.

    Parameters
    ----------
    alone
        Of each recording; the weights of all stand before theirs.
    """

    known: ClassVar[bool] = True
    alone: tuple[Noise, ...] = ()

    @classmethod
    def of(cls, alone: Sequence[Noise]) -> StackedNoise:
        """Put them one after the other."""
        return cls(
            np.concatenate([each.variance for each in alone]),
            np.concatenate([each.weight for each in alone]),
            alone=tuple(alone),
        )

    def _each(self) -> list[Noise]:
        pairs = zip(self.alone, split(self.weight, self.alone), strict=True)
        return [replace(noise, weight=weight) for noise, weight in pairs]

    def _with(self, columns: FloatArray) -> Iterator[tuple[Noise, FloatArray]]:
        return zip(self._each(), split(columns, self.alone), strict=True)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Turn readings (or columns of them) into numbers of unit variance, shape kept."""
        return np.concatenate([noise.whiten(part) for noise, part in self._with(columns)])

    def adjoint(self, columns: FloatArray) -> FloatArray:
        """Apply the transpose of `whiten`."""
        return np.concatenate([noise.adjoint(part) for noise, part in self._with(columns)])

    @property
    def scale(self) -> FloatArray:
        """What each reading is multiplied by before its cosines are taken."""
        return np.concatenate([noise.scale for noise in self._each()])

    @property
    def coloured(self) -> bool:
        """Whether any of them is."""
        return any(noise.coloured for noise in self.alone)

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of each reading."""
        return np.concatenate([noise.sd for noise in self.alone])

    def log_scale_variance(
        self,
        rows: FloatArray,
        chosen: IntArray | None = None,  # noqa: ARG002
    ) -> FloatArray:
        """Return the variance of the logarithm of the noise that unit columns meet."""
        parts = split(rows[:, : len(self.variance)].T, self.alone)
        pairs = zip(self.alone, parts, strict=True)
        found = [noise.log_scale_variance(part.T) for noise, part in pairs]
        return np.asarray(np.sum(found, axis=0))


def split(columns: FloatArray, alone: Sequence[Data] | Sequence[Noise]) -> list[FloatArray]:
    """Return what belongs to each recording."""
    counts = [len(each.weight) for each in alone]
    return np.split(columns, np.cumsum(counts)[:-1])


_HEAD: Final = 0.25
"""Part of a predicted recording to which its own values (its start) are fitted."""


@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def diagnose_several(
    recordings: Sequence[Recording],
    names: Sequence[str],
    *,
    diagnose: Callable[..., Diagnosis],
    baseline: Baseline = "eq8",
    level: float = FALSE_ALARM,
    seed: int = 0,
    restoring: Restoring | None = None,
    same_sensor: bool = False,
    own: Sequence[str] = (),
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose several recordings of one pendulum as one measurement.

    Parameters
    ----------
    recordings, names
        At least two, and what to call them.
    diagnose
        Diagnoses each of them alone (`diagnose_recording`).
    baseline, level, seed, restoring, provenance, progress
        As for `diagnose_recording`.
    same_sensor
        Whether the sensor's errors are the same in all.
    own
        What is known to differ between them: ``"a"``, ``"b"``, ``"c"``, ``"frequency"``.

    Raises
    ------
    InputError
        If there is one recording only, a name is unknown, or one can't be analysed.
    """
    if len(recordings) < 2:
        raise InputError("diagnose", "only one recording is given", "give at least two")
    if unknown := [name for name in own if name not in MAY_DIFFER]:
        remedy = f"known are {', '.join(MAY_DIFFER)}"
        raise InputError("--own", f"'{unknown[0]}' is not a parameter that can be shared", remedy)
    if "frequency" not in own:
        _check_one_pendulum(recordings, names)
    outcomes = []
    for recording, name in zip(recordings, names, strict=True):
        progress(f"{name} alone")
        outcomes.append(
            diagnose(
                recording,
                baseline=baseline,
                level=level,
                seed=seed,
                restoring=restoring,
                place=name,
                progress=progress,
            )
        )
    if len({_search(outcome).data.unit for outcome in outcomes}) > 1:
        raise InputError("diagnose", "angles and displacements are mixed", "give one kind")
    progress("all together")
    try:
        found = search_together(
            outcomes,
            baseline=baseline,
            level=level,
            seed=seed,
            restoring=restoring,
            same_sensor=same_sensor,
            own=own,
            progress=progress,
        )
    except NoMotionError as error:
        remedy = "diagnose them one by one"
        raise NotAnalysableError("diagnose", f"no model follows all ({error})", remedy) from error
    after = _Together(found, found.fit, descriptions_of(found), outcomes, names, own, level)
    bare = with_errors(found.baseline, found.data, found.noise)
    before = replace(after, improved=found.baseline, described=[Description(1.0, bare)])
    named, differing = after.effects()
    events = after.events()
    effects = (*presumed(found), *named, *differing, *events)
    held = (
        held_out(found.baseline, found.fit, found.data, found.noise, found.held, found.held)
        if named
        else None
    )
    return Diagnosis(
        before.model(),
        after.model(),
        effects,
        held,
        warnings=tuple(
            f"{name}: {line}"
            for name, outcome in zip(names, outcomes, strict=True)
            for line in outcome.warnings
        ),
        provenance=dict(provenance or {}),
        name=f"{listed(names)} together",
        search=found,
        alone=tuple(outcomes),
        recordings=tuple(after.recording(number) for number in range(len(names))),
        level=level,
    )


def search_together(
    outcomes: Sequence[Diagnosis],
    *,
    baseline: str,
    level: float,
    seed: int,
    restoring: Restoring | None = None,
    same_sensor: bool,
    own: Sequence[str],
    progress: Progress,
) -> Hypothesis:
    """Hypothesis for what all recordings lack, or do not share, and weigh it.

    Parameters
    ----------
    outcomes
        Of each recording alone.
    baseline, level, seed, restoring, progress
        As in a single diagnosis.
    same_sensor
        Whether the sensor's errors have the same sizes in all.
    own
        Names (`MAY_DIFFER`) of what the recordings are known not to share.

    Raises
    ------
    NoMotionError
        If the recordings have no motion in common.
    """
    searches = [_search(outcome) for outcome in outcomes]
    data = StackedData.of([found.data for found in searches])
    misfits = [_misfit(found) for found in searches]
    # A recording counts less by as much as it follows its own law worse than the best does.
    noise = StackedNoise.of(
        [
            replace(found.noise, variance=(misfit / min(misfits)) ** 2 * found.noise.variance)
            for found, misfit in zip(searches, misfits, strict=True)
        ]
    )
    members = [_member(outcome) for outcome in outcomes]
    model = Stack.of(members, own, same_sensor=same_sensor)
    held = model.held_of([_of_baseline(found) for found in searches])
    fit = _fitted(model, data, noise, searches, held)
    if fit is None:
        raise NoMotionError("the recordings have no motion in common")
    beginning = Beginning(data, model, fit.value, tuple(held))
    differing = [
        Differs(name, number)
        for name in MAY_DIFFER
        if name not in own
        for number in range(len(searches) == 2, len(searches))
    ]
    task = Task(catalogue_beside(restoring), differing, baseline, level, seed, progress)
    state = Hypothesis(beginning, fit, data, noise, tuple(held), fit).settle(fit)
    return run_search(_known_first(state, task, searches), task)


def _member(outcome: Diagnosis) -> Model:
    """Return a recording's baseline, with what happened in it alone.

    What may as well be a law of the pendulum did not.
    """
    found = _search(outcome)
    laws = {each.identifier for each in CATALOGUE if not happened(each)}
    doubted = {
        e.identifier for e in outcome.missing if laws.intersection(dict(e.indistinguishable))
    }
    model = found.baseline.model.bare().at_times(found.data.time_s)
    for effect in found.fit.model.effects:
        if happened(effect) and effect.identifier not in doubted:
            model = model.adding(effect)
    return model


def _search(diagnosis: Diagnosis) -> Hypothesis:
    """Return what a diagnosis of one recording has fitted."""
    assert diagnosis.search is not None
    return diagnosis.search


def happened(effect: Effect) -> bool:
    """Whether an effect belongs to one recording: an instant, a tone, a wandering offset."""
    wanders = effect.in_time and effect.identifier == "unnamed-measurement"
    return effect.local or effect.spectral or wanders


def _of_baseline(found: Hypothesis) -> list[int]:
    return [index for index in found.held if index < len(BASELINE)]


def _misfit(found: Hypothesis) -> float:
    """Return the factor by which the misfit that a recording's own law leaves widens its errors.

    A curve of the motion against the time is no law: what it describes is a misfit too.
    """
    drawn = [effect for effect in found.fit.model.effects if effect.in_time]
    law = found.fit if all(map(happened, drawn)) else found.without_curve or found.fit
    return remainder_of(law, found.data, found.noise).error_scale


def _fitted(
    model: Stack,
    data: Data,
    noise: Noise,
    searches: Sequence[Hypothesis],
    held: Sequence[int],
) -> Fit | None:
    """Fit each recording by itself, then all from there."""
    sizes = [
        {effect.key: fit.value[place] for effect, place in fit.model.places()}
        for fit in (found.fit for found in searches)
    ]
    fits = []
    of_each = zip(model.members, model.mixings(), searches, sizes, strict=True)
    for member, mixing, found, own in of_each:
        known = ChainMap(own, *sizes)
        starts = [
            np.concatenate([base.value[: len(BASELINE)], *(known[e.key] for e in member.effects)])
            for base in (found.fit, found.baseline)
        ]
        # What another recording shows may stop the motion in this one.
        starts.append(starts[1].copy())
        for effect, place in member.places():
            starts[2][place][: 0 if effect.parameter_free else effect.sizes] = 0.0
        fit = best_fit(member, found.data, found.noise, starts, held=_of_baseline(found))
        if fit is None:
            return None
        fits.append((mixing, fit))
    # The shared values of one recording after the other, the best first.
    values = []
    for last in fits:
        values.append(np.zeros(model.size))
        for mixing, fit in sorted(fits, key=lambda pair: pair is last):
            values[-1][np.argmax(mixing, axis=1)] = fit.value
    friction = np.arange(model.size) == C
    starts = [
        np.where(friction, share * value, value) for value in values for share in LESS_FRICTION
    ]
    return best_fit(model, data, noise, starts, held=held)


def _known_first(state: Hypothesis, task: Task, searches: Sequence[Hypothesis]) -> Hypothesis:
    """Begin with the names that the recordings have alone, where Eq. 8 loses the motion."""
    named: dict[str, list[Step]] = {}
    for found in searches:
        for step in found.steps:
            named.setdefault(step.winner.effect.key, []).append(step)
    if loses_phase(state.fit):
        state = task.scanned(state)
    order = sorted(named.values(), key=lambda steps: -sum(step.winner.gain for step in steps))
    for steps in order:
        if not loses_phase(state.fit) or len(state.steps) == MOST_EFFECTS:
            return state
        model, before = state.fit.model, state.fit
        assert isinstance(model, Stack)
        step = max(steps, key=lambda each: each.winner.gain)
        common = model.admitted([step.winner.effect])
        if step.winner.drawn or not common:
            continue
        fit = _fitted(model.adding(common[0]), state.data, state.noise, searches, state.held)
        if fit is None:
            continue
        scale = Scale.of(fit, state.data, state.noise)
        winner = replace(step.winner, effect=common[0]).again(fit, before.chi2, scale)
        # Rivals are refitted when they are weighed, each from its values in one recording.
        rivals = [
            rival
            for rival in step.rivals[1:]
            if not rival.drawn and model.admitted([rival.effect]) == [rival.effect]
        ]
        added = Step((winner, *rivals), step.p_value, before)
        if winner.worth < price([*state.steps, added]) - price(state.steps):
            continue
        task.progress(f"beginning with {winner.name}")
        state = replace(state, steps=(*state.steps, added)).settle(fit)
    return state


@dataclass(frozen=True)
class _Together:
    """What a fit of all recordings says of each."""

    found: Hypothesis
    improved: Fit
    described: Sequence[Description]
    outcomes: Sequence[Diagnosis]
    names: Sequence[str]
    own: Sequence[str]
    level: float

    def averaged(self, of: Callable[[Fit], Mapping[str, Estimate]]) -> dict[str, Estimate]:
        """Average numbers over the descriptions that share the probability."""
        bare = with_errors(self.found.baseline, self.found.data, self.found.noise)
        return averages(self.found, self.described, of, of(bare), self.level).constants

    @property
    def differing(self) -> set[str]:
        """What the recordings contradict each other in."""
        effects = self.improved.model.effects
        return {each.parameter for each in effects if isinstance(each, Differs)}

    def model(self) -> FittedModel:
        """Return the shared values, and what the model leaves."""
        data, fit = self.found.data, self.improved
        alone = [_search(outcome).data for outcome in self.outcomes]
        size = np.array([float(each.used * each.fold) for each in alone])
        left = np.array([self._residual_rms(number) for number in range(len(alone))])
        within = sum(each.used * (each.fold - 1) for each in alone)
        shared = {
            name: value
            for name, value in self.averaged(lambda fit: constants_of(fit, data.unit)).items()
            if name in MAY_DIFFER and name not in {*self.own, *self.differing}
        }
        return FittedModel(
            self.outcomes[0].baseline.name,
            shared,
            float(np.sqrt(size @ left**2 / size.sum())),
            (fit.chi2 + within) / max(float(size.sum()) - len(fit.free), 1.0),
            _rms([outcome.noise_rms_rad for outcome in self.outcomes]),
        )

    def _residual_rms(self, number: int) -> float:
        """Return what the model leaves of one recording's readings."""
        used = self._of(number) & (self.found.data.weight > 0.0)
        left = _rms(self.found.data.residual(self.improved.at.reading)[used])
        return _search(self.outcomes[number]).data.rms_of_reading(left)

    def of_recording(self, name: str, number: int) -> Estimate:
        """Return one recording's value of a parameter."""
        scale = 0.5 / math.pi if name == "frequency" else 1.0
        unit = units(self.found.data.unit)[name]

        def of(fit: Fit) -> dict[str, Estimate]:
            row = fit.at.parts[number].mixing[MAY_DIFFER[name]]
            sd = math.sqrt(max(float(row @ fit.covariance() @ row), 0.0))
            return {name: Estimate(scale * float(row @ fit.value), scale * sd, unit)}

        return of(self.improved)[name] if name in self.differing else self.averaged(of)[name]

    def effects(self) -> tuple[list[FoundEffect], list[FoundEffect]]:
        """Return what all recordings lack, and what they contradict each other in."""
        named, differing = [], []
        for step in self.found.steps:
            effect, one = step.winner.effect, effect_named(self.found, step)
            if isinstance(effect, Differs):
                differing.append(self.contradiction(effect, one))
                continue
            sizes = [one.parameters[each.name] for each in effect.parameters[: effect.sizes]]
            known = effect.parameter_free or effect.kind == "unnamed"
            if not known and all(abs(e.value) < Z95 * e.sd for e in sizes):
                one = replace(one, probability=min(one.probability, DOUBTFUL))
            everywhere = Location(summary="in all recordings together")
            named.append(replace(one, location=everywhere))
        return named, differing

    def events(self) -> list[FoundEffect]:
        """Return what happened in one recording alone."""
        return [
            replace(
                each, location=replace(each.location, summary=f"in {name} alone", recording=name)
            )
            for name, outcome, part in zip(
                self.names, self.outcomes, self.improved.at.parts, strict=True
            )
            for each in outcome.missing
            if each.kind not in ("unnamed", "parameter")
            and (
                each.identifier
                in {one.identifier for one in part.at.model.effects if happened(one)}
                or not by_identifier(each.identifier).has_signature
            )
        ]

    def contradiction(self, effect: Differs, found: FoundEffect) -> FoundEffect:
        """Return what the recordings contradict each other in, with each one's value."""
        values = {
            name: self.of_recording(effect.parameter, number)
            for number, name in enumerate(self.names)
        }
        where = self.names[effect.recording]
        name = f"{where} contradicts the others in {effect.parameter}"
        if len(self.names) == 2:
            name = f"The recordings contradict each other in {effect.parameter}"
        return replace(
            found,
            name=name,
            parameters=values,
            location=Location(summary=f"in {where}", recording=where),
        )

    def recording(self, number: int) -> dict[str, Any]:
        """Return what is to be said of one recording."""
        diagnosis, part = self.outcomes[number], self.improved.at.parts[number]
        white = self.improved.residual[:-1][self._of(number)]
        return {
            "name": self.names[number],
            "alone": {
                "verdict": diagnosis.verdict,
                "effects": [each.identifier for each in diagnosis.missing],
                "classes": [
                    sorted({each.identifier, *(name for name, _ in each.indistinguishable)})
                    for each in diagnosis.missing
                ],
            },
            "amplitude_rad": float(part.at.span.first_amplitude),
            "parameters": {
                name: self.of_recording(name, number).as_json()
                for name in MAY_DIFFER
                if name in {*self.own, *self.differing}
            },
            "residual_rms_rad": self._residual_rms(number),
            "chi2_per_dof": _search(self.outcomes[number]).data.chi2_per_dof(
                float(white @ white), len(part.at.value)
            ),
            "prediction": self._prediction(number),
        }

    def _of(self, number: int) -> BoolArray:
        """Return which readings are a recording's."""
        counts = [len(_search(outcome).data) for outcome in self.outcomes]
        return np.asarray(np.repeat(np.arange(len(counts)), counts) == number)

    def _prediction(self, number: int) -> dict[str, float] | None:
        """Predict a recording from the others; what is its own is fitted to its first quarter.

        The rest is compared with the band of all values' errors, its noise, and the misfit that
        the law leaves in the others.
        """
        data, fit = self.found.data, self.improved
        used = np.flatnonzero(self._of(number) & (data.weight > 0.0))
        tail = used[int(_HEAD * len(used)) :]
        hidden = np.isin(np.arange(len(data)), tail)
        known = data.masked(hidden | (data.weight == 0.0))
        noise = replace(self.found.noise, weight=known.weight)
        assert isinstance(fit.model, Stack)
        model = fit.model.guessing(fit.at)
        there = best_fit(model, known, noise, [fit.value], held=self.found.held)
        if there is None:
            return None
        there = with_errors(there, known, noise)
        noise_sd = np.concatenate([_search(outcome).noise.sd for outcome in self.outcomes])
        off = data.residual(there.at.reading) / noise_sd
        others = ~self._of(number) & (data.weight > 0.0)
        sd = max(_rms(off[others]), 1.0) * noise_sd[tail]
        columns = there.at.jacobian[tail]
        band = np.einsum("ij,jk,ik->i", columns, there.covariance(), columns) + sd**2
        off = (off * noise_sd)[tail]
        return {
            "fitted_readings": len(used) - len(tail),
            "predicted_readings": len(tail),
            "rms_rad": _rms(off),
            "expected_rms_rad": float(np.sqrt(band.mean())),
            "within_95": float(np.mean(np.abs(off) < Z95 * np.sqrt(band))),
        }


_MARGIN: Final = 0.03
"""Part of the frequency by which releases of one pendulum may differ beyond what sin x allows."""


def _check_one_pendulum(recordings: Sequence[Recording], names: Sequence[str]) -> None:
    """Refuse frequencies that no amplitude explains.

    Raises
    ------
    InputError
        If the slowest swings slower than the fastest by more than sin x makes of its amplitude.
    """
    from pendpipe.analysis.free_decay import measure_recording

    found = []
    for recording, name in zip(recordings, names, strict=True):
        points, _ = measure_recording(motion_of(recording, place=name), name)
        largest = min(float(np.max(points.amplitude_rad)), TOP) if points.unit == "rad" else 0.0
        half_swing = float(swing_phase(np.full(2, largest), "sine")[0])
        found.append((points.apparent_frequency_hz, half_swing / math.pi, name))
    slow, fast = min(found), max(found)
    if fast[0] > slow[0] * slow[1] * (1.0 + _MARGIN):
        raise InputError(
            "--together",
            f"{slow[2]} swings at {slow[0]:.4g} Hz and {fast[2]} at {fast[0]:.4g} Hz: no amplitude"
            " of one pendulum explains that",
            "diagnose them one by one, or say --own frequency where you changed it",
        )


def _rms(values: FloatArray | Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
