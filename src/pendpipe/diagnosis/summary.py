"""The answer in a dozen lines: what is seen, what is missing, how much it matters, what to quote.

What is seen comes first: it is true whatever its cause. A cause is named from a probability of
0.8 on; two or three that have one half together are named as "A or B"; of others what they have in
common is said. From a fifth on they stand in one line of candidates. Everything below is in the
details.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from pendpipe.analysis.fit.printed import short_size
from pendpipe.analysis.fit.quality import period_of_frequency
from pendpipe.analysis.noise import quantisation_rms
from pendpipe.answer import Answer, Table, factor, percent, printed
from pendpipe.diagnosis.found import CANDIDATE, COLOURED_NOISE, FoundEffect
from pendpipe.diagnosis.outcome import Outcome
from pendpipe.diagnosis.refine import Remainder
from pendpipe.diagnosis.seen import Seen
from pendpipe.effects.catalogue import CATALOGUE, by_identifier, declared
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES
from pendpipe.effects.effect import Effect
from pendpipe.estimate import ALONE, LISTED, MOST_NAMES, NAMED, Z95, Estimate, named_together
from pendpipe.files import fields_of
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import compact, listed, with_error

BASELINES: Final = {"eq8": "Eq. 8", "viscous": "the viscous model (Eq. 3)"}
"""The baselines in words."""
DOUBTFUL: Final = 0.05
"""Probability up to which a name only describes and is not to be quoted."""
_SURE: Final = 0.95
"""Probability from which a name without rivals needs no further measurement."""
_SHOWN: Final = 4
"""Of what was looked for."""
UNNAMED: Final = {
    "unnamed-damping": "a loss of unknown form",
    "unnamed-restoring": "a restoring torque of unknown form",
    "unnamed-drive": "a torque that depends on the time in an unknown way",
    "unnamed-measurement": "an unknown error of the sensor",
}
NAMES_OF_CURVES: Final = {
    name: tuple(each.name for each in (*CURVES, *FOLLOW_UP_CURVES) if each.identifier == name)
    for name in UNNAMED
}
"""Of the curves of an identifier."""
PARTS: Final = {
    "offset": "in the offset",
    "amplitude": "in the amplitude",
    "phase": "in the phase",
    "harmonics": "in the higher harmonics",
    "between": "between the harmonics",
}
_LOOKED_FOR: Final = (
    *("second-mode", "plane-coupling", "frequency-drift", "damping-drift", "sensor-cubic"),
    *("offset-drift", "clock-drift", "stribeck-friction", "impulse", "cubic-stiffness"),
)
"""What readers ask after first."""


@dataclass(frozen=True)
class Change:
    """One number as fitted, and with what is missing.

    Parameters
    ----------
    quantity
        ``"period"``, ``"a"``, ``"b"``, ``"c"``, or ``"Q"``.
    fitted, with_missing
        The baseline's, and that of the model with what was found; of Q what the turning points
        show, which holds whatever is missing.
    amplitude_rad, unit
        Of Q.
    """

    quantity: str
    fitted: Estimate
    with_missing: Estimate
    amplitude_rad: float | None = None
    unit: str = "rad"

    @property
    def moved_sd(self) -> float:
        """By how many standard deviations it moves."""
        sd = math.hypot(self.fitted.sd, self.with_missing.sd)
        off = abs(self.fitted.value - self.with_missing.value)
        return off / sd if sd > 0.0 else (math.inf if off else 0.0)

    def as_json(self) -> dict[str, Any]:
        """Return its form in JSON."""
        return {**fields_of(self), "moved_sd": self.moved_sd}


@dataclass(frozen=True)
class Summary:
    """The answer of a diagnosis.

    Parameters
    ----------
    headline
        What is missing, in a line.
    missing
        Names of the causes, or of classes whose members can't be told apart.
    matters
        How much it matters, a clause.
    consequence
        The same as numbers.
    where, certainty
        Clauses.
    candidates, excluded
        What may be missing, and what was looked for and is not it.
    decide_by
        The one measurement that decides.
    quote
        What can be quoted.
    sentence
        To copy.
    seen
        What is seen, whatever its cause: clauses, the first of which stands in the headline.
    """

    headline: str
    missing: tuple[str, ...] = ()
    matters: str = ""
    consequence: tuple[Change, ...] = ()
    where: str = ""
    certainty: str = ""
    candidates: str = ""
    excluded: tuple[str, ...] = ()
    decide_by: str = ""
    quote: str = ""
    sentence: str = ""
    seen: str = ""

    def pairs(self) -> list[tuple[str, str]]:
        """Return what is known, a title and a clause each, as it is printed."""
        looked = ", ".join(self.excluded[:_SHOWN])
        more = len(self.excluded) - _SHOWN
        pairs = (
            ("how much it matters", self.matters),
            ("where", self.where),
            ("how sure", self.certainty),
            ("candidates", self.candidates),
            ("looked for, not found", looked + (f" ({more} more: -v)" if more > 0 else "")),
            ("decide by", self.decide_by),
            ("quote", self.quote),
        )
        return [(title, value) for title, value in pairs if value]

    @property
    def answer(self) -> Answer:
        """What is printed: where it is too wide, without times, then without numbers."""
        told = (
            self.headline,
            *(self.headline.replace(long, short) for long, short in self._shorter()),
        )
        short = self.headline
        for long, bare in self._shorter():
            short = short.replace(long, bare)
        of_q = [each for each in self.consequence if each.quantity == "Q"]
        fewer = [each for each in self.consequence if each not in of_q[1:-1]]
        tables = (_table(self.consequence), _table(fewer)) if self.consequence else ()
        return Answer((*told, short), tuple(self.pairs()), tables=tables, sentence=self.sentence)

    def _shorter(self) -> Iterator[tuple[str, str]]:
        """Yield parts of the headline with a shorter form: what stands in brackets can go."""
        for part in (self.seen.partition("; ")[0], *self.missing):
            if part:
                yield part, re.sub(r" \([^()]*(\([^()]*\)[^()]*)*\)", "", part)


def _table(changes: Sequence[Change]) -> Table:
    """Return *as fitted* and *with what is missing* side by side, heads first."""
    return (
        ("", "as fitted", "with what is missing"),
        *(
            (
                _title(each),
                each.fitted.or_limit(),
                replace(each.with_missing, unit=each.fitted.unit).or_limit(),
            )
            for each in changes
        ),
    )


def read_summary(content: Mapping[str, Any], unit: str) -> Summary:
    """Read ``summary`` of ``diagnosis.json``, with the unit of the amplitudes."""
    changes = tuple(
        Change(
            each["quantity"],
            Estimate.from_json(each["fitted"]),
            Estimate.from_json(each["with_missing"]),
            each["amplitude_rad"],
            unit,
        )
        for each in content["consequence"]
    )
    lists = {name: tuple(content[name]) for name in ("missing", "excluded")}
    return Summary(**{**content, **lists, "consequence": changes})


def _title(change: Change) -> str:
    if change.amplitude_rad is None:
        return {"period": "T0"}.get(change.quantity, change.quantity)
    return f"Q at {short_size(change.amplitude_rad, change.unit)}"


def summarise(diagnosis: Outcome) -> Summary:
    """Make the answer of a diagnosis."""
    presumed = _presumed(diagnosis)
    found = [each for each in diagnosis.missing if each.identifier != COLOURED_NOISE]
    seen = _seen(diagnosis.seen, presumed) or _by_a_test(found)[:1]
    if not found:
        beyond = f" beyond {presumed}, which is fitted" if presumed else ""
        noise = any(each.identifier == COLOURED_NOISE for each in diagnosis.effects)
        p = printed(diagnosis.p_value)
        coloured = "; its noise is coloured" if noise else ""
        zero = "; its zero wanders" if diagnosis.wanders else ""
        said, sentence = f"nothing is missing{beyond}", ""
        if diagnosis.verdict != "consistent":
            said = f"a small misfit is left{beyond}, its cause is NOT known"
            said = f"{seen[0]}: {said}" if seen else said
            sentence = _sentence(diagnosis, seen, presumed, "The cause is not known")
        whole = "; ".join(seen)
        return Summary(f"{said} ({p}){coloured}{zero}", sentence=sentence, seen=whole)
    causes = causes_of(found)
    told = {cause.text: cause for cause in causes if cause.text}
    named = list(told)
    candidates = [_candidate(each.effect) for each in causes if not each.text]
    changes = _changes(diagnosis)
    rest = diagnosis.remainder is not None and diagnosis.remainder.systematic
    family = family_of([each for each in causes if not each.text])
    if named:
        drawn = ["described by " * cause.described + text for text, cause in told.items()]
        headline, lacks = f"missing: {'; '.join(drawn)}", _lacks(list(told.values()))
        if rest or not all(cause.text for cause in causes):
            headline += ", and a misfit of unknown cause"
            left = _seen(diagnosis.left, "")
            more = f" ({left[0]})" if left else f" ({family})" if family else ""
            lacks += f"; there is a misfit of unknown cause, too{more}"
    else:
        headline = "its cause is NOT known" + (f": {family}" if family else "")
        headline = headline if seen else f"something is missing, {headline}"
        lacks = "The cause is not known" + (f": {family}" if family else "")
    unit, where = diagnosis.unit, _where(diagnosis, causes)
    return Summary(
        f"{seen[0]}; {headline}" if seen else headline,
        tuple(named),
        _matters(diagnosis, changes, unit),
        changes,
        where if where not in seen else "",
        _certainty(diagnosis, named, rest=rest),
        "; ".join(filter(None, candidates)) or ("none above 20 %" if not named else ""),
        _excluded(diagnosis, found),
        _decide_by(causes),
        _quote(diagnosis, changes, causes),
        _sentence(diagnosis, seen, presumed, lacks),
        "; ".join(seen),
    )


def _lacks(causes: Sequence[Cause]) -> str:
    """Say what the causes are, and by what the rest is described."""
    known = [cause.text for cause in causes if cause.text and not cause.described]
    drawn = [cause.text for cause in causes if cause.described]
    if not known:
        return f"It is described by {listed(drawn)}"
    verb = "The causes are" if len(known) > 1 else "The cause is"
    return "; ".join(
        [
            f"{verb} {listed(known)}",
            *([f"the rest is described by {listed(drawn)}"] if drawn else []),
        ]
    )


def _seen(seen: Sequence[Seen], presumed: str) -> list[str]:
    """Return what is seen as clauses; a change of the frequency is one beyond sin x."""
    beyond = ", beyond sin x" if "sin x" in presumed else ""
    return [each.clause + (beyond if each.part == "frequency" else "") for each in seen]


def _presumed(diagnosis: Outcome) -> str:
    words = {"circular-error": "sin x", "drag-form": "drag v|v|"}
    names = [words.get(each.identifier, each.name) for each in diagnosis.effects if each.presumed]
    return " and ".join(names)


def class_of(effect: FoundEffect) -> list[tuple[float, str, str]]:
    """Return an effect's class: probability, name and identifier, the most probable first."""
    own = effect.name if effect.kind != "unnamed" else name_of(effect.identifier)
    rivals = [(p, name_of(identifier), identifier) for identifier, p in effect.indistinguishable]
    # The sort is stable: of the equally probable the effect itself is first.
    members = [(effect.probability, own, effect.identifier), *rivals]
    return sorted(members, key=lambda member: -member[0])


@dataclass(frozen=True)
class Cause:
    """What is said of an effect and its class.

    Parameters
    ----------
    effect
        The effect.
    text
        Its name, or "A or B", with the probability; empty where only the family is said.
    names
        The identifiers that are named.
    """

    effect: FoundEffect
    text: str = ""
    names: tuple[str, ...] = ()

    @property
    def described(self) -> bool:
        """Whether it is a curve, which describes a cause and names none."""
        return len(self.names) == 1 and self.names[0] in UNNAMED


def causes_of(found: Sequence[FoundEffect]) -> list[Cause]:
    """Return what is said of each effect: three names together at most, the most likely first.

    Effects for which the same curve of unknown form is most likely are one cause.
    """
    room, said, curves = MOST_NAMES, dict[int, Cause](), dict[str, Cause]()
    for effect in sorted(found, key=lambda each: -class_of(each)[0][0]):
        cause = curves.get(class_of(effect)[0][2])
        if cause is None:
            cause = _cause(effect, room)
            room -= len(cause.names)
            curves |= {name: cause for name in cause.names if name in UNNAMED}
        said[id(effect)] = replace(cause, effect=effect)
    return [said[id(effect)] for effect in found]


def _cause(effect: FoundEffect, room: int) -> Cause:
    """Name a cause, or two or three that share one half; nothing where more would be needed.

    A curve is no name: it describes alone, or not at all.
    """
    members = class_of(effect)
    known = [each for each in members[:MOST_NAMES] if each[2] not in UNNAMED]
    groups = [each for each in (known, members[:1]) if each]
    counted = [each[: named_together([p for p, *_ in each], room)] for each in groups]
    likely = next(filter(None, counted), [])
    if not likely:
        return Cause(effect)
    total = min(sum(p for p, *_ in likely), 1.0)
    (_, first, identifier), *others = likely
    numbers = numbers_of(effect) if identifier == effect.identifier and not others else ""
    curve = effect.curve if not others else None
    if curve and curve["name"] in NAMES_OF_CURVES.get(identifier, ()):
        numbers = curve["summary"] * curve["stands_out"]
    together = " together" if others else ""
    inside = "; ".join(filter(None, (numbers, f"{percent(total)}{together}")))
    names = " or ".join([first, *(name for _, name, _ in others)])
    probably = "probably " * (total < ALONE and identifier not in UNNAMED)
    return Cause(effect, f"{probably}{names} ({inside})", tuple(each for *_, each in likely))


def _candidate(effect: FoundEffect) -> str:
    likely = [f"{name} ({percent(p)})" for p, name, _ in class_of(effect) if p >= CANDIDATE]
    return " or ".join(likely)


_APART: Final = {
    "time": (
        "something that changes with time or with the amplitude: one decay can't tell which",
        "release it again from half the amplitude: what depends on the amplitude is the same at the"
        " same amplitude, what depends on the time is not",
    ),
    "sensor": (
        "something in the motion or in the sensor: one recording can't tell which",
        "record it with a second sensor and clock too, a camera's: the motion is the same",
    ),
}
"""What the members of a class differ in, and the measurement that tells them apart."""


def _differing(effect: FoundEffect) -> str:
    """Return by what the likely members of a class differ, a key of `_APART`; "" by neither."""
    members = class_of(effect)
    likely = [each for p, _, each in members if p >= LISTED] or [effect.identifier]
    in_time = {changes_in_time(each) for each in likely}
    sensor = {kind_of(each) == "measurement" for each in likely}
    return "time" if len(in_time) > 1 else "sensor" if len(sensor) > 1 else ""


def _subject(causes: Sequence[Cause]) -> FoundEffect | None:
    """Return what is spoken of: of the causes with a name, else of all, the class that leads.

    Of candidates it is the one that explains most, whatever describes the rest.
    """
    known = [each for each in causes if each.text] or causes
    classes = [(sum(p for p, *_ in class_of(each.effect)), each.effect) for each in known]
    leading = sorted(
        classes, key=lambda one: ((one[0] >= CANDIDATE) * one[1].delta_chi2, one[0]), reverse=True
    )
    return leading[0][1] if leading else None


def family_of(causes: Sequence[Cause]) -> str:
    """Say what the likely ones of causes without a name have in common."""
    first = _subject(causes)
    if first is None:
        return ""
    members = class_of(first)
    if sum(p for p, *_ in members) < CANDIDATE:
        return ""
    if apart := _differing(first):
        return _APART[apart][0]
    identifier = members[0][2]
    if moves_beside(identifier):
        return "perhaps a second motion"
    if is_periodic(identifier):
        return "perhaps something periodic"
    if first.curve:
        names = NAMES_OF_CURVES.items()
        return next(f"perhaps {UNNAMED[each]}" for each, of in names if first.curve["name"] in of)
    what = (
        "perhaps an error of the sensor"
        if kind_of(identifier) == "measurement"
        else "perhaps a force"
    )
    return f"{what} that changes with time" if changes_in_time(identifier) else what


def kind_of(identifier: str) -> str:
    """Return the kind of an effect: a curve of the sensor is of the measurement."""
    if identifier in UNNAMED:
        return "measurement" if identifier == "unnamed-measurement" else "dynamics"
    return "parameter" if identifier.startswith("parameter-") else by_identifier(identifier).kind


def is_periodic(identifier: str) -> bool:
    """Whether an effect is a line or a force with a frequency of its own."""
    if identifier in UNNAMED or identifier.startswith("parameter-"):
        return False
    return any(each.word == "frequency" for each in by_identifier(identifier).parameters)


def moves_beside(identifier: str) -> bool:
    """Whether an effect is a motion beside the pendulum's that the sensor reads."""
    if identifier in UNNAMED or kind_of(identifier) != "dynamics":
        return False
    effect = by_identifier(identifier)
    return not effect.local and type(effect).reading is not Effect.reading


def jumps(identifier: str) -> bool:
    """Whether an effect makes the motion, the reading or its time jump at an instant."""
    if identifier in UNNAMED or identifier.startswith("parameter-"):
        return False
    effect = by_identifier(identifier)
    return effect.local and type(effect).acceleration is Effect.acceleration


def changes_in_time(identifier: str) -> bool:
    """Whether an effect follows the time, by an instant or a time constant, and not the motion."""
    if identifier in UNNAMED:
        return identifier == "unnamed-drive"
    if identifier.startswith("parameter-"):
        return False
    effect = by_identifier(identifier)
    shapes = effect.parameters[effect.sizes :]
    return effect.local or effect.in_time or any(each.unit == "s" for each in shapes)


def numbers_of(effect: FoundEffect) -> str:
    """Print the parameters of an effect in words, with units, where they differ from zero."""
    said, found = list[str](), effect.parameters
    for name, parameter in declared(effect.identifier).items():
        each, sine = found.get(name), found.get(name.replace("_cosine", "_sine"))
        if each is None or sine is None or name.endswith("_sine"):
            continue
        if sine is not each:
            value = math.hypot(each.value, sine.value)
            sd = math.hypot(each.sd * each.value, sine.sd * sine.value) / value if value else 0.0
            each = Estimate(value, sd, each.unit)
        # What is as it always is (a drift that is straight) says nothing.
        if abs(each.value) > Z95 * each.sd and each.value != parameter.default:
            number = with_error(each.value, each.sd, each.unit, short=True)
            said.append(f"{parameter.word or name} {number}")
    return ", ".join([*said, *filter(None, [effect.location.mains])])


def name_of(identifier: str) -> str:
    """Return the name behind an identifier."""
    if identifier in UNNAMED:
        return UNNAMED[identifier]
    if identifier.startswith("parameter-"):
        return f"another value of {identifier.removeprefix('parameter-').replace('_', ' ')}"
    return by_identifier(identifier).name


def _changes(diagnosis: Outcome) -> tuple[Change, ...]:
    """Compare the numbers of the baseline with the averages that are quoted."""
    before, after = diagnosis.baseline.parameters, diagnosis.improved.parameters
    found, fit = [], diagnosis.fit
    # Of two modes that beat the fit has no T0.
    beats = fit is not None and fit.hindered == "beat"
    if "frequency" in before and "frequency" in after and not beats:
        found.append(
            Change(
                "period",
                period_of_frequency(before["frequency"]),
                period_of_frequency(after["frequency"]),
            )
        )
    found += [
        Change(name, before[name], after[name])
        for name in "abc"
        # What is held in both says nothing.
        if name in before and name in after and before[name].sd + after[name].sd > 0.0
    ]
    if fit is not None and fit.light != "red":
        better = diagnosis.improved.quality_factors
        found += [
            Change(
                "Q",
                each.quality_factor,
                better[each.amplitude_rad],
                each.amplitude_rad,
                diagnosis.unit,
            )
            for each in fit.quality_factors
            if each.amplitude_rad in better
        ]
    return tuple(found)


def _matters(diagnosis: Outcome, changes: Sequence[Change], unit: str) -> str:
    """Say how large the misfit is, and which numbers it moves."""
    left = compact(diagnosis.baseline.residual_rms_rad, unit)
    noise = compact(diagnosis.noise_rms_rad, unit)
    moved = [each for each in changes if each.quantity != "Q" and each.moved_sd > Z95]
    words = [
        f"{_title(each)} {replace(each.fitted, unit='').or_limit()} →"
        f" {replace(each.with_missing, unit=each.fitted.unit).or_limit()}"
        for each in moved
    ]
    what = ", ".join(words) if words else "no number moves by two sd"
    return f"the fit misses the readings by {left} (noise {noise}): {what}"


def _where(diagnosis: Outcome, causes: Sequence[Cause]) -> str:
    """Say what tests have found, where the missing forces are how large, and where the rest lies.

    A force is told of a name that it is the same law as, and of a description. What does not fit
    into a line is left out from its end.
    """
    first = _subject(causes)
    assert first is not None
    named = [each.effect for each in causes if each.text and each.effect is not first]
    told = dict.fromkeys([*_by_a_test([each.effect for each in causes]), *_forces([first, *named])])
    described = class_of(first)[0][2] in UNNAMED and _forces([first])
    text = "; ".join(told if described else dict.fromkeys([*told, first.location.summary]))
    remainder = diagnosis.remainder
    if remainder is not None and remainder.systematic and remainder.shares:
        name, share = max(remainder.shares.items(), key=lambda item: item[1])
        text += f"; what is left lies {PARTS[name]} ({percent(share)})"
    return text


def _by_a_test(found: Sequence[FoundEffect]) -> list[str]:
    """Return what tests of the measurement have found: it is in no model of the readings."""
    own = [each for each in found if each.kind == "measurement" and each.identifier not in UNNAMED]
    tested = [each for each in own if not by_identifier(each.identifier).has_signature]
    return [each.location.summary for each in tested if each.location.summary]


def _forces(found: Sequence[FoundEffect]) -> list[str]:
    """Return where the forces of leaders are how large, each curve once.

    Over the time a curve only imitates what is named.
    """
    told = dict[str, str]()
    for each in found:
        curve, leader = each.curve, class_of(each)[0][2]
        if curve is None:
            continue
        own = leader == each.identifier and not curve["argument"].startswith("time")
        if own or curve["name"] in NAMES_OF_CURVES.get(leader, ()):
            told.setdefault(curve["name"], curve["summary"])
    return list(told.values())


def _certainty(diagnosis: Outcome, named: Sequence[str], *, rest: bool) -> str:
    sure: dict[str, float] = {}
    for p, name, _ in (class_of(each)[0] for each in diagnosis.missing):
        if p >= NAMED:
            sure[name] = max(p, sure.get(name, 0.0))
    words = [f"{name} {percent(p)}" for name, p in sure.items()]
    text = ", ".join(words) if words else "no cause above 50 %" if not named else ""
    held = diagnosis.held_out
    if held is not None and math.isfinite(held.gain):
        well = held.better if held.gain >= 0.0 else held.blocks - held.better
        word = "better" if held.gain >= 0.0 else "WORSE"
        predicted = (
            f"cycles left out of the fit are predicted {word} in {well} of {held.blocks} parts"
        )
        text = f"{text}; {predicted}" if text else predicted
    if rest and diagnosis.remainder is not None:
        text += f"; what is left is {factor(diagnosis.remainder.over_noise)} times the noise"
    return text or "see candidates"


def _excluded(diagnosis: Outcome, found: Sequence[FoundEffect]) -> tuple[str, ...]:
    """Names of what was looked for and not added, those that readers ask after first."""
    suspected = {each.identifier for each in found}
    suspected |= {rival for each in found for rival, _ in each.indistinguishable}
    suspected |= {each.identifier for each in diagnosis.effects}
    left = [identifier for identifier, _ in diagnosis.scanned if identifier not in suspected]
    first = [each for each in _LOOKED_FOR if each in left]
    return tuple(name_of(each) for each in (*first, *(x for x in left if x not in first)))


def test_of(effect: FoundEffect) -> str:
    """The measurement that decides about an effect: that of the leader of its class.

    Where no name leads with 80 % it is that which tells apart what the likely ones differ in.
    """
    p, _, leader = class_of(effect)[0]
    if p < ALONE and (apart := _differing(effect)):
        return _APART[apart][1]
    tests = {each.identifier: each.discriminating_test for each in reversed(CURVES)}
    tests |= {each.identifier: each.discriminating_test for each in CATALOGUE}
    tests[effect.identifier] = effect.discriminating_test
    return tests.get(leader, effect.discriminating_test)


def _decide_by(causes: Sequence[Cause]) -> str:
    """The test of what is least sure among the named, or of the family."""
    doubted = [
        each
        for each in causes
        if each.effect.probability < _SURE
        or any(p > 1.0 - _SURE for _, p in each.effect.indistinguishable)
    ]
    subject = _subject(doubted)
    return test_of(subject) if subject else ""


def _quote(diagnosis: Outcome, changes: Sequence[Change], causes: Sequence[Cause]) -> str:
    """What can be quoted: T0 and Q of the better model, a, b, c that stay."""
    said, unit, better = list[str](), diagnosis.unit, diagnosis.improved
    named = [each.effect for each in causes if each.effect.identifier in each.names]
    modes = [each.parameters.get("f_2") for each in named]
    periods = [
        with_error(each.value, each.sd, "s", short=True)
        for frequency in (better.parameters.get("frequency"), *modes)
        if frequency is not None
        for each in [period_of_frequency(frequency)]
    ]
    if periods:
        span = better.period_span_s
        drifts = f" in the mean, drifting by {compact(span[1] - span[0], 's')}" if span else ""
        said.append(f"T0 {periods[0]}{drifts}{''.join(f', other mode {T}' for T in periods[1:])}")
    good = [
        f"{with_error(q.value, q.sd, short=True)} at {short_size(amplitude, unit)}"
        for amplitude, q in better.quality_factors.items()
        if q.sd < 0.1 * q.value
    ]
    if good:
        said.append(f"Q {', '.join(dict.fromkeys((good[0], good[-1])))}")
    moved = [each.quantity for each in changes if each.quantity in "abc" and each.moved_sd > Z95]
    if moved:
        said.append(f"not {', '.join(moved)}")
    return "; ".join(said)


def _sentence(diagnosis: Outcome, seen: Sequence[str], presumed: str, cause: str) -> str:
    name = diagnosis.baseline.name
    model = {"eq8": "Eq. 8", "viscous": "Eq. 3"}.get(name, name)
    model += f" with {presumed}" if presumed else ""
    p = printed(diagnosis.p_value)
    if not seen:
        return f"“{model} does not describe this recording ({p}). {cause}.”"
    return f"“{_capital(', and '.join(seen))}, which {model} does not describe ({p}). {cause}.”"


def swinging(outcome: Outcome) -> str:
    """Return the baseline with its forms, in words."""
    forms = {"sin x": outcome.restoring == "sine", "v|v|": outcome.drag_form == "speed"}
    with_them = " and ".join(name for name, has in forms.items() if has)
    name = BASELINES.get(outcome.baseline.name, outcome.baseline.name)
    return name + (f" with {with_them}" if with_them else "")


def details_of(outcome: Outcome) -> list[str]:
    """Return all that was found, a line each: the baseline, each effect, and what is left."""
    unit, told = outcome.unit, outcome.recordings
    shared = [each for each in outcome.missing if not each.location.recording]
    model, whole = _capital(swinging(outcome)), "them" if told else "this recording"
    left, noise_rms = outcome.baseline.residual_rms_rad, outcome.noise_rms_rad
    size, noise_is = compact(left, unit), compact(noise_rms, unit)
    noise = [each.location.summary for each in shared if each.identifier == COLOURED_NOISE]
    lines = [
        f"{model} does not describe {whole} ({printed(outcome.p_value)}): the residual is"
        f" {size} rms, {factor(left / noise_rms)} times the noise of {noise_is}.",
        *map(_effect, shared),
        _rest(outcome.unexplained_p_value, outcome.level, outcome.remainder),
        *([small.sentence(unit)] if (small := outcome.improved.small_swings) is not None else []),
    ]
    if len(noise) == len(shared):
        what = f"the motion of {whole}, whose zero wanders" if outcome.wanders else whole
        agrees = f"the residual of {size} rms agrees with the noise ({noise_is})"
        step = outcome.search.data.step if outcome.search is not None else 0.0
        if left < noise_rms <= quantisation_rms(step):
            agrees = f"it leaves {size} rms, less than the rounding adds ({noise_is})"
        p = outcome.unexplained_p_value
        chance = " more than chance would" if p >= outcome.level else ", but more than by chance"
        nothing = (
            f"{model} describes {what}: {agrees}, and no effect of the catalogue"
            f" improves the fit{chance} ({printed(p)})."
        )
        lines = [nothing, *(f"{_capital(said)}." for said in noise)]
    return [*_of_several(outcome), *lines] if told else lines


def _of_several(outcome: Outcome) -> Iterator[str]:
    """Say what recordings have in common, who contradicts whom, and how each is predicted."""
    names, unit = [each["name"] for each in outcome.recordings], outcome.unit
    yield (
        f"{len(names)} recordings of one pendulum ({listed(names)}) were taken together: each has"
        " a start, an offset and noise of its own"
    )
    shared = outcome.improved.parameters.items()
    if shared:
        yield f"All have {listed([f'{name} = {value}' for name, value in shared])}."
    for each in outcome.missing:
        if each.location.recording and each.kind == "parameter":
            values = [f"{value} in {name}" for name, value in each.parameters.items()]
            yield f"{each.name}: {listed(values)}."
        elif each.location.recording:
            yield f"{each.location.recording} alone shows {each.name}."
    for one in outcome.recordings:
        if (tail := one["prediction"]) is None:
            yield f"The others do not settle how {one['name']} moves."
            continue
        yield (
            f"{one['name']} is predicted from the others, with its first quarter to fit what is its"
            f" own: the 95 % band holds {100.0 * tail['within_95']:.0f} % of the rest"
            f" ({compact(tail['rms_rad'], unit)} rms, expected"
            f" {compact(tail['expected_rms_rad'], unit)})."
        )


def _effect(effect: FoundEffect) -> str:
    """What one effect is, how sure that is, where it shows, and what would decide."""
    # What a test has counted, its location says.
    wanted = declared(effect.identifier) or effect.parameters
    members = class_of(effect)
    whose = "" if class_of(effect)[0][2] == effect.identifier else f"of {effect.name}: "
    parts = [
        ", ".join(f"{name} {percent(p)}" for p, name, _ in members)
        + (" (not distinguished)" if len(members) > 1 else ""),
        *(
            f"{whose}{name} = {each}"
            for name, each in effect.parameters.items()
            if name in wanted and each.sd > 0.0
        ),
        effect.location.summary,
        effect.curve["summary"] if effect.curve else "",
    ]
    if effect.confirmed is not None:
        sure = "confirmed" if effect.confirmed.p_value < FALSE_ALARM else "not confirmed"
        parts.append(f"{sure} without the fit: {effect.confirmed.summary}")
    decide = f"decide by: {test_of(effect)}"
    text = f"{_capital('; '.join(part for part in (*parts, decide) if part))}"
    return text if text.endswith("?") else f"{text}."


def _rest(unexplained: float, level: float, remainder: Remainder | None) -> str:
    """What is left, and what that means for probabilities and errors."""
    if remainder is None or not remainder.systematic:
        if unexplained > level:
            return f"The remaining residual is consistent with noise ({printed(unexplained)})."
        return f"A small misfit remains unexplained ({printed(unexplained)})."
    shares = sorted(remainder.shares.items(), key=lambda item: -item[1])
    where = ", ".join(f"{percent(share)} {PARTS[name]}" for name, share in shares if share > LISTED)
    return (
        f"The remaining residual is still {factor(remainder.over_noise)} times the noise"
        f" ({where}), so the model is incomplete: the errors given here allow for that, and the"
        " probabilities are lowered accordingly."
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
