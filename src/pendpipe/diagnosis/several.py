"""The answer of several recordings of one pendulum: what they share, settle, and predict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.special import chdtrc

from pendpipe.analysis.fit.result import Baseline
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import Progress, silent
from pendpipe.diagnosis.chance import printed
from pendpipe.diagnosis.joint import Joint, Named, Released, Together, may_be_common
from pendpipe.diagnosis.result import BASELINES, COLOURED_NOISE, FILE_NAME, FoundEffect, Location
from pendpipe.diagnosis.run import LEVEL, Outcome, diagnose_recording
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import BASELINE, OMEGA
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.derivatives import jacobian
from pendpipe.errors import InputError, NotAnalysableError
from pendpipe.estimate import Estimate
from pendpipe.quantities import compact
from pendpipe.recording import Recording

PARAMETERS: Final = {"a": "a", "b": "b", "c": "c", "frequency": "omega"}
"""What may be shared, and its name in the vector of values."""
_UNITS: Final = {"a": "1/(rad s)", "b": "1/s", "c": "rad/s", "frequency": "Hz"}
_HEAD: Final = 0.25
"""Part of a predicted recording to which its own values (its start) are fitted."""
_Z95: Final = 1.959963984540054


@dataclass(frozen=True, repr=False)
class JointOutcome:
    """The diagnosis of several recordings of one pendulum. It prints as one paragraph.

    Parameters
    ----------
    content
        What ``diagnosis.json`` holds.
    effects
        What is missing, and what the recordings do not share.
    outcomes
        Each recording's own diagnosis.
    """

    content: dict[str, Any]
    effects: tuple[FoundEffect, ...]
    outcomes: tuple[Outcome, ...]

    @property
    def verdict(self) -> str:
        """``"consistent"`` or ``"missing-physics"``."""
        return str(self.content["verdict"])

    def __str__(self) -> str:
        return str(self.content["statement"])

    __repr__ = __str__

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``diagnosis.json``."""
        return self.content

    def save(self, folder: str | Path) -> dict[str, Any]:
        """Write ``diagnosis.json`` into a folder, which is made if it is not there."""
        from pendpipe.files import make_folder, write_json

        make_folder(Path(folder))
        write_json(Path(folder) / FILE_NAME, self.content)
        return self.content


@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def diagnose_several(
    recordings: Sequence[Recording],
    names: Sequence[str],
    *,
    baseline: Baseline = "eq8",
    level: float = LEVEL,
    seed: int = 0,
    same_sensor: bool = False,
    own: Sequence[str] = (),
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> JointOutcome:
    """Diagnose several recordings of one pendulum as one measurement.

    Parameters
    ----------
    recordings, names
        At least two, and what to call them.
    baseline, level, seed, provenance, progress
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
        raise InputError("diagnose", "one recording is not several", "give at least two")
    if unknown := [name for name in own if name not in PARAMETERS]:
        remedy = f"known are {', '.join(PARAMETERS)}"
        raise InputError("--own", f"'{unknown[0]}' is no parameter that can be shared", remedy)
    outcomes = []
    for recording, name in zip(recordings, names, strict=True):
        progress(f"{name} alone")
        outcomes.append(
            diagnose_recording(
                recording, baseline=baseline, level=level, seed=seed, place=name, progress=progress
            )
        )
    units = {outcome.search.data.unit for outcome in outcomes}
    if len(units) > 1:
        raise InputError("diagnose", "angles and displacements are mixed", "give one kind")
    joint = Joint(
        [outcome.search for outcome in outcomes],
        baseline=baseline,
        level=level,
        same_sensor=same_sensor,
        own=[PARAMETERS[name] for name in own],
        progress=progress,
    )
    progress("all together")
    try:
        together, named = joint.settled()
        bare = joint.fitted((), joint.own)
    except NoMotionError as error:
        remedy = "diagnose them one by one"
        raise NotAnalysableError("diagnose", f"no model follows all ({error})", remedy) from error
    answer = _Answer(joint, outcomes, names, together, named, bare, level, baseline)
    return JointOutcome(answer.content(dict(provenance or {})), answer.effects, tuple(outcomes))


class _Answer:
    """Turns the fit of all recordings into ``diagnosis.json``."""

    def __init__(
        self,
        joint: Joint,
        outcomes: Sequence[Outcome],
        names: Sequence[str],
        together: Together,
        named: Sequence[Named],
        bare: Together | None,
        level: float,
        baseline: str,
    ) -> None:
        self.joint, self.outcomes, self.names = joint, outcomes, names
        self.together, self.named, self.bare = together, named, bare
        self.level, self.baseline = level, baseline
        self.unit = outcomes[0].search.data.unit
        self.released = [each for each in together.released if each not in joint.own]
        self.events = [
            (name, each)
            for name, outcome in zip(names, outcomes, strict=True)
            for each in outcome.effects
            if each.kind != "unnamed" and not may_be_common(by_identifier(each.identifier))
        ]
        self.effects = (
            *map(self._effect, named),
            *map(self._contradiction, self.released),
            *(
                replace(each, location=replace(each.location, summary=f"in {name} alone"))
                for name, each in self.events
            ),
        )

    def content(self, provenance: dict[str, Any]) -> dict[str, Any]:
        """Return the whole answer."""
        before = self._p_value(self.bare) if self.bare else 0.0
        alone = min(outcome.diagnosis.p_value for outcome in self.outcomes)
        p_value = min(1.0, (len(self.outcomes) + 1) * min(before, alone))
        recordings = [self._recording(number) for number in range(len(self.outcomes))]
        after = self._model(self.together)
        unexplained = self._p_value(self.together)
        missing = any(each.identifier != COLOURED_NOISE for each in self.effects)
        return {
            "schema_version": 1,
            "baseline": {"name": self.baseline, **self._model(self.bare)},
            "noise_rms_rad": _rms([outcome.diagnosis.noise_rms_rad for outcome in self.outcomes]),
            "verdict": "missing-physics" if missing else "consistent",
            "p_value": p_value,
            "effects": [each.as_json() for each in self.effects],
            "improved": after,
            "held_out": dict.fromkeys(
                ("log_density_before", "log_density_after", "gain", "gain_sd")
            ),
            "unexplained": {"residual_rms_rad": after["residual_rms_rad"], "p_value": unexplained},
            "recordings": recordings,
            "statement": self._statement(recordings, p_value, unexplained),
            "figures": [],
            "warnings": [
                f"{name}: {line}"
                for name, outcome in zip(self.names, self.outcomes, strict=True)
                for line in outcome.diagnosis.warnings
            ],
            "provenance": provenance,
        }

    def _p_value(self, model: Together) -> float:
        """Return the global p-value of the largest score, and of what sharing costs."""
        chi2, freedom = self.joint.disagreement(model)
        shared = float(chdtrc(max(freedom, 1), chi2))
        leads = self.joint.leads(model)
        scores = [self.joint.p_value(lead, lead.score) for lead in leads]
        return min(1.0, 2.0 * min([shared, *scores]))

    def _model(self, model: Together | None) -> dict[str, Any]:
        if model is None:
            return {"parameters": {}, "residual_rms_rad": None, "chi2_per_dof": None}
        residuals, chi2, used = [], 0.0, 0
        for fit, member in zip(model.fits, self.joint.members, strict=True):
            data = member.found.data
            residuals.append(data.residual(fit.at.reading)[data.weight > 0.0])
            chi2, used = chi2 + fit.chi2, used + data.used
        return {
            "parameters": {
                name: each.as_json() for name, each in self._shared(model).items() if each
            },
            "residual_rms_rad": _rms(np.concatenate(residuals)),
            "chi2_per_dof": chi2 / max(used - len(model.layout.keys), 1),
        }

    def _shared(self, model: Together) -> dict[str, Estimate | None]:
        return {
            name: _estimate(model, key, _UNITS[name], name == "frequency")
            for name, key in PARAMETERS.items()
        }

    def _effect(self, named: Named) -> FoundEffect:
        """Return one effect with its shared values."""
        rival, effect = named.rival, named.rival.lead.effect
        first = effect.parameter_free
        found = {}
        if self.joint.is_shared(effect):
            for index, parameter in enumerate(effect.parameters):
                key, unit = (effect.key, first + index), parameter.unit_in(self.unit)
                found[parameter.name] = _estimate(self.together, key, unit)
        return FoundEffect(
            effect.identifier,
            effect.name,
            effect.kind,
            effect.equation,
            {name: each for name, each in found.items() if each},
            rival.gain,
            self.joint.p_value(rival.lead, rival.gain),
            float(named.weights[0]),
            tuple(
                (mate.identifier, float(weight))
                for mate, weight in zip(named.mates, named.weights[1:], strict=False)
            ),
            effect.discriminating_test,
            Location(summary=f"in all {len(self.names)} recordings"),
        )

    def _contradiction(self, released: Released) -> FoundEffect:
        """Return what the recordings contradict each other in."""
        name = _name(released)
        where = "all" if released.recording is None else self.names[released.recording]
        values = {
            each: found
            for number, each in enumerate(self.names)
            if (found := self._own(self.together, number, name)) is not None
        }
        gain = self.joint.cost(self.together, released)
        more = len(self.names) - 1 if released.recording is None else 1
        return FoundEffect(
            f"parameter-{name}",
            f"{name} differs between the recordings",
            "parameter",
            name,
            values,
            gain,
            float(chdtrc(more, gain)),
            1.0,
            (),
            "record each of them once more, in another order",
            Location(summary=f"in {where}"),
        )

    def _own(self, model: Together, number: int, name: str) -> Estimate | None:
        """Return one recording's value of a parameter: its own, or the shared one."""
        index = BASELINE.index(PARAMETERS[name])
        own = _estimate(model, (number, index), _UNITS[name], name == "frequency")
        return own or _estimate(model, PARAMETERS[name], _UNITS[name], name == "frequency")

    def _recording(self, number: int) -> dict[str, Any]:
        outcome, fit = self.outcomes[number], self.together.fits[number]
        data = outcome.search.data
        residual = data.residual(fit.at.reading)[data.weight > 0.0]
        others = [k for k in range(len(self.names)) if k != number]
        rest = self.joint.joined(
            self.together.alone,
            self.together.effects,
            self.together.released,
            self.together.fits,
            others,
        )
        return {
            "name": self.names[number],
            "alone": {
                "verdict": outcome.verdict,
                "effects": [each.identifier for each in outcome.effects],
                "classes": [sorted(each) for each in _classes(outcome)],
            },
            "amplitude_rad": float(fit.at.span.first_amplitude),
            "parameters": {
                _name(each): value.as_json()
                for each in self.together.released
                if each.recording in (None, number)
                and (value := self._own(self.together, number, _name(each)))
            },
            "residual_rms_rad": _rms(residual),
            "chi2_per_dof": fit.chi2 / max(data.used - len(fit.free), 1),
            "agreement": self._agreement(number, rest),
            "prediction": self._prediction(number, rest),
        }

    def _agreement(self, number: int, rest: Together) -> dict[str, Any]:
        """Compare one recording with what the others say: chi^2 of what they share."""
        alone = self.joint.chi2_alone(self.together, number)
        chi2 = max(self.together.chi2 - rest.chi2 - alone, 0.0)
        freedom = max(self.together.layout.shared - rest.layout.shared, 1)
        return {"chi2": chi2, "dof": freedom, "p_value": float(chdtrc(freedom, chi2))}

    def _prediction(self, number: int, rest: Together) -> dict[str, Any] | None:
        """Predict a recording from the others; its start is fitted to its first quarter.

        Readings are compared with the band of all values' errors and the noise.
        """
        fit, joint = self.together.fits[number], self.joint
        found, scale = joint.members[number].found, joint.members[number].scale
        used = np.flatnonzero(found.data.weight > 0.0)
        head, tail = np.split(used, [int(_HEAD * len(used))])
        free, noise = list(fit.free), scale * found.noise.rms
        # Coloured noise moves the motion by its density at the motion's frequency.
        turns = float(fit.value[OMEGA]) / (2.0 * math.pi) * found.data.interval_s
        dense = scale * max(found.noise.rms_at(turns), found.noise.rms)
        columns = jacobian(fit.model, fit.value, fit.at)[:, free] / dense
        residual = found.data.residual(fit.at.reading) / dense
        keys = [self.together.layout.keys[k] for k in self.together.layout.slots[number]]
        mine = [here for here, key in enumerate(keys) if key in rest.layout.keys]
        theirs = [rest.layout.keys.index(keys[here]) for here in mine]
        covariance = rest.covariance()[np.ix_(theirs, theirs)]
        sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        weights = np.linalg.pinv(covariance / np.outer(sd, sd), rcond=1e-10, hermitian=True)
        weights = weights / np.outer(sd, sd)
        normal = columns[head].T @ columns[head]
        right = columns[head].T @ residual[head]
        normal[np.ix_(mine, mine)] += weights
        right[mine] += weights @ (rest.values[theirs] - fit.value[free][mine])
        length = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        inverse = np.linalg.pinv(normal / np.outer(length, length), rcond=1e-13, hermitian=True)
        inverse = inverse / np.outer(length, length)
        value = fit.value.copy()
        value[free] += inverse @ right
        try:
            low, high = fit.model.bounds()
            reading = fit.model.reading(fit.model.settled(np.clip(value, low, high)))
        except NoMotionError:
            return None
        off = found.data.residual(reading)[tail] / noise
        band = np.einsum("ij,jk,ik->i", columns[tail], inverse, columns[tail])
        band *= (dense / noise) ** 2
        return {
            "fitted_readings": len(head),
            "predicted_readings": len(tail),
            "rms_rad": _rms(off * noise),
            "expected_rms_rad": float(noise * np.sqrt(1.0 + band.mean())),
            "within_95": float(np.mean(np.abs(off) < _Z95 * np.sqrt(1.0 + band))),
        }

    def _statement(
        self, recordings: Sequence[Mapping[str, Any]], p_value: float, unexplained: float
    ) -> str:
        count, shared = len(self.names), self._shared(self.together)
        model = BASELINES.get(self.baseline, self.baseline)
        common = [f"{name} = {value}" for name, value in shared.items() if value]
        text = [
            f"{count} recordings of one pendulum ({_listed(self.names)}) were taken together: each"
            " has a start, an offset and noise of its own"
            + (f", and all have {_listed(common)}." if common else "."),
        ]
        text.extend(map(self._said_of, self.named))
        for released in self.released:
            values = [
                f"{self._own(self.together, number, _name(released))} in {name}"
                for number, name in enumerate(self.names)
            ]
            who = (
                "The recordings contradict each other"
                if released.recording is None
                else f"{self.names[released.recording]} contradicts the others"
            )
            text.append(f"{who} in {_name(released)}: {_listed(values)}.")
        if not self.named:
            text.insert(
                1,
                f"{model[0].upper()}{model[1:]} describes them, and no effect of the catalogue"
                f" improves the fit of all more than chance would ({printed(unexplained)}).",
            )
        else:
            text.insert(
                1, f"{model[0].upper()}{model[1:]} does not describe them ({printed(p_value)})."
            )
        if self.events:
            said = [f"{each.name} in {name}" for name, each in self.events]
            text.append(f"One recording alone shows {_listed(said)}.")
        odd = [
            each["name"] for each in recordings if each["agreement"]["p_value"] < self.level / count
        ]
        if odd and count > 2:
            text.append(f"What {_listed(odd)} says of the shared values contradicts the others.")
        elif odd:
            text.append("What the two say of the shared values is not the same.")
        told = [each for each in recordings if each["prediction"]]
        if told:
            parts = [
                f"{100.0 * each['prediction']['within_95']:.0f} % of {each['name']}"
                f" ({compact(each['prediction']['rms_rad'], self.unit)} rms, expected"
                f" {compact(each['prediction']['expected_rms_rad'], self.unit)})"
                for each in told
            ]
            text.append(
                "Predicted from the others, with only its first quarter to fit what is its own,"
                f" the 95 % band holds {_listed(parts)}."
            )
        return " ".join(text)

    def _said_of(self, named: Named) -> str:
        """Return what an effect is, how sure, and what the recordings settle about it."""
        rival, effect = named.rival, named.rival.lead.effect
        numbers = [f"{name} = {each}" for name, each in self._effect(named).parameters.items()]
        facts = [f"probability {100.0 * float(named.weights[0]):.0f} %", *numbers]
        text = f"Missing: {effect.name} ({'; '.join(facts)})."
        mates = {mate.identifier for mate in named.mates}
        if mates:
            text += (
                f" Even together they cannot distinguish it from {_listed(sorted(mates), 'or')}."
            )
            text += f" What to measure next: {effect.discriminating_test}."
        alone = [
            each
            for outcome in self.outcomes
            for each in _classes(outcome)
            if rival.identifier in each
        ]
        settled = sorted(set().union(*alone) - mates - {rival.identifier})
        if settled:
            text += f" Single recordings leave {_listed(settled)} too; together they exclude it."
        elif not alone:
            text += " No single recording shows it."
        return text


def _classes(outcome: Outcome) -> list[set[str]]:
    """Return the class of each effect of a diagnosis, itself included."""
    return [
        {effect.identifier, *(name for name, _ in effect.indistinguishable)}
        for effect in outcome.effects
    ]


def _name(released: Released) -> str:
    return next(name for name, key in PARAMETERS.items() if key == released.name)


def _estimate(model: Together, key: object, unit: str, turns: bool = False) -> Estimate | None:
    """Return a value of all with its error; None where it is not among them."""
    if key not in model.layout.keys:
        return None
    place = model.layout.keys.index(key)
    scale = 0.5 / math.pi if turns else 1.0
    sd = math.sqrt(max(float(model.covariance()[place, place]), 0.0))
    value = float(model.values[place])
    half = _Z95 * sd
    return Estimate(
        scale * value, scale * sd, unit, (scale * (value - half), scale * (value + half))
    )


def _rms(values: FloatArray | Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _listed(parts: Sequence[str], word: str = "and") -> str:
    """Return the parts as one list in words."""
    if len(parts) < 2:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {word} {parts[-1]}"
