"""Several recordings of one pendulum as one measurement: physics shared, start and noise their own.

Each recording is diagnosed alone first. The readings then meet in one least squares of all
recordings: a, b, c, the frequency and the sizes of effects of the pendulum are one number for all,
while start, time, offset, sudden effects and (unless told otherwise) the sensor are each
recording's own. A recording enters by the QR factor of its whitened Jacobian, so that a step costs
no more than the recordings alone. Moves are those of a single diagnosis, by the same evidence: an
effect is added, or a value that the recordings contradict each other in is no longer shared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.special import chdtrc

from pendpipe.analysis.fit.least_squares import bounded_least_squares
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.detect import Lead
from pendpipe.diagnosis.evidence import (
    SIZE_CHARGE,
    Rival,
    equivalent,
    evidence,
    of_one_class,
    probabilities,
    ranked,
)
from pendpipe.diagnosis.gauss_newton import GaussNewton
from pendpipe.diagnosis.moves import CHOICE, FURTHER
from pendpipe.diagnosis.refine import Fit, best_fit
from pendpipe.diagnosis.refits import NEAR
from pendpipe.diagnosis.remainder import remainder_of
from pendpipe.diagnosis.scores import whitened
from pendpipe.diagnosis.search import Search
from pendpipe.diagnosis.task import applicable
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import BASELINE
from pendpipe.effects.catalogue import CATALOGUE

SHARED: Final = ("a", "b", "c", "share", "omega")
"""What every recording of one pendulum has in common, besides its effects."""
_RELEASED: Final = ("a", "b", "c", "omega")
"""What may turn out not to be shared."""
_MOST_EFFECTS: Final = 4
_MOST_MOVES: Final = 8
_MOST_REFITTED: Final = 7
_MOST_SWAPS: Final = 4
_LIKELIER: Final = 1.5
"""Odds from which a rival replaces an effect."""
_CLEAN_CHARGE: Final = 5.0
"""Against "none of these", as in a single diagnosis."""
_PART_BEHIND: Final = 0.3
"""Part of the best score that a refit may catch up."""
_ROUNDS: Final = 10
_SETTLED: Final = 0.05
_DAMPINGS: Final = (0.0, 1e-4, 1e-3, 1e-2, 0.1)


class Released(NamedTuple):
    """A value that is not shared: by none of the recordings, or not by one of them."""

    name: str
    recording: int | None = None


class Named(NamedTuple):
    """An effect with its rivals: probabilities of it, of its mates, and of none of them."""

    rival: Rival
    mates: tuple[Rival, ...]
    weights: FloatArray


class Member(NamedTuple):
    """One recording: its own search, what happened to it alone, and the scale of its errors."""

    found: Search
    extras: tuple[Effect, ...]
    scale: float = 1.0


@dataclass(frozen=True)
class Layout:
    """Where each recording's free values stand among all.

    Parameters
    ----------
    slots
        For each recording the position of each of its free values.
    keys
        What stands at each position: a name, (effect, number), or (recording, number).
    """

    slots: tuple[IntArray, ...]
    keys: tuple[object, ...]

    @property
    def shared(self) -> int:
        """How many constraints sharing makes."""
        return sum(len(slot) for slot in self.slots) - len(self.keys)


@dataclass(frozen=True)
class Together:
    """One model of all recordings.

    Parameters
    ----------
    effects, released
        What all have, and what is not shared.
    alone, fits
        Each recording fitted by itself, and at the values of all.
    layout, values, triangle
        The values of all, and the root of their normal matrix, shape (m, n).
    chi2
        At these values; with each recording's scale of errors.
    """

    effects: tuple[Effect, ...]
    released: tuple[Released, ...]
    alone: tuple[Fit, ...]
    fits: tuple[Fit, ...]
    layout: Layout
    values: FloatArray
    triangle: FloatArray
    chi2: float

    def covariance(self) -> FloatArray:
        """Of the values of all."""
        length = np.linalg.norm(self.triangle, axis=0)
        length[length == 0.0] = 1.0
        inverse = np.linalg.pinv(self.triangle / length, rcond=1e-9)
        return np.asarray(inverse @ inverse.T / np.outer(length, length))


class Joint:
    """The search over all recordings.

    Parameters
    ----------
    searches
        Of each recording alone.
    baseline, level
        As in a single diagnosis.
    same_sensor
        Whether the sensor's errors are shared too.
    own
        Names of what the recordings are known not to share.
    progress
        Receives one line for each step.
    """

    def __init__(
        self,
        searches: Sequence[Search],
        *,
        baseline: str,
        level: float,
        same_sensor: bool,
        own: Sequence[str],
        progress: Progress,
    ) -> None:
        self.members = [Member(found, _extras(found)) for found in searches]
        self.baseline, self.level, self.same_sensor = baseline, level, same_sensor
        self.progress = progress
        self.own = tuple(Released(name) for name in own)
        self._starts: dict[str, FloatArray] = {}
        for found in searches:
            for step in found.steps:
                for rival in reversed(step.rivals):
                    self._remember(rival.lead.effect, rival.fit)
            for effect in found.named.model.effects:
                self._remember(effect, found.named)

    def _remember(self, effect: Effect, fit: Fit) -> None:
        place = next((place for other, place in fit.model.places() if other is effect), None)
        if place is not None:
            self._starts[effect.key] = fit.value[place]

    def is_shared(self, effect: Effect) -> bool:
        """Whether the recordings share an effect's values."""
        # Two sizes are an amplitude and a phase, which each release sets anew.
        return effect.sizes < 2 and (effect.kind == "dynamics" or self.same_sensor)

    # One model of all recordings ------------------------------------------------------------

    def fitted(
        self, effects: Sequence[Effect], released: Sequence[Released], near: Together | None = None
    ) -> Together | None:
        """Fit each recording by itself, then all together; None where there is no such motion."""
        alone, there = [], []
        for number, member in enumerate(self.members):
            found = member.found
            model = found.baseline.model.bare().at_times(found.data.time_s)
            own = (*member.extras, *effects)
            for effect in own:
                model = model.adding(effect)
            bases = [*([near.alone[number]] if near else []), found.named, found.baseline]
            starts = [self._start(base, own) for base in bases]
            starts.append(self._start(found.baseline, own, sizes=False))
            fit = best_fit(model, found.data, found.noise, starts, held=_held(found))
            if fit is None:
                return None
            alone.append(fit)
            if near:
                value = self._start(near.fits[number], own)
                steps = GaussNewton(model, found.data, found.noise)
                with suppress(NoMotionError):
                    there.append(replace(fit, evaluation=steps.evaluate_within_bounds(value)))
        return self.joined(alone, effects, released, there if len(there) == len(alone) else ())

    def _start(self, base: Fit, effects: Sequence[Effect], sizes: bool = True) -> FloatArray:
        """Return a model's values: those of a fit, and where it lacks an effect its own start.

        Without `sizes` such an effect starts at zero: with others gone, friction of its last
        size may stop the motion.
        """
        places = {other.key: place for other, place in base.model.places()}
        start = [base.value[: len(BASELINE)]]
        for effect in effects:
            place = places.get(effect.key)
            value = base.value[place] if place else self._starts[effect.key].copy()
            if place is None and not sizes and not effect.parameter_free:
                value[: effect.sizes] = 0.0
            start.append(value)
        return np.concatenate(start)

    def joined(
        self,
        alone: Sequence[Fit],
        effects: Sequence[Effect],
        released: Sequence[Released],
        near: Sequence[Fit] = (),
        only: Sequence[int] | None = None,
    ) -> Together:
        """Solve for the values of all, from each recording's own and from those of a near model.

        A recording that hardly shows an effect has values of it far from those of all; recordings
        that contradict each other have none of all that are near. `only` some of them.
        """
        chosen = list(range(len(alone))) if only is None else list(only)
        layout = self._layout(alone, effects, released, chosen)
        own = [alone[number] for number in chosen]
        starts = [own, [near[number] for number in chosen]] if near else [own]
        solutions = [self._descended(start, layout, chosen) for start in starts]
        here, values, triangle, chi2 = min(solutions, key=lambda each: each[-1])
        if np.isinf(chi2):
            # The recordings contradict each other so much that no motion is common to them.
            here = own
            values, triangle, chi2 = self._solved(own, layout, chosen)
        return Together(
            tuple(effects),
            tuple(released),
            tuple(alone),
            tuple(here),
            layout,
            values,
            triangle,
            chi2,
        )

    def _descended(
        self, here: Sequence[Fit], layout: Layout, chosen: Sequence[int]
    ) -> tuple[Sequence[Fit], FloatArray, FloatArray, float]:
        """Return fits, values, triangle and chi^2 of the minimum; inf where nothing moves so."""
        values, _, _ = _origin(here, layout)
        common = all(
            np.allclose(values[slot], fit.value[list(fit.free)], rtol=1e-12, atol=0.0)
            for fit, slot in zip(here, layout.slots, strict=True)
        )
        chi2 = self._chi2(here, chosen) if common else np.inf
        for _ in range(_ROUNDS):
            for damping in _DAMPINGS:
                tried, triangle, _ = self._solved(here, layout, chosen, values, damping)
                there = self._moved(here, layout, tried, chosen)
                if there is not None and self._chi2(there, chosen) <= chi2 + 1e-9:
                    break
            else:
                break
            gained, here, values = chi2 - self._chi2(there, chosen), there, tried
            chi2 = self._chi2(here, chosen)
            if gained < _SETTLED:
                break
        return here, values, triangle, chi2

    def _layout(
        self,
        fits: Sequence[Fit],
        effects: Sequence[Effect],
        released: Sequence[Released],
        chosen: Sequence[int],
    ) -> Layout:
        keys: dict[object, int] = {}
        slots = []
        for number in chosen:
            names = self._names(fits[number], number, effects, released)
            slots.append(np.array([keys.setdefault(name, len(keys)) for name in names]))
        return Layout(tuple(slots), tuple(keys))

    def _names(
        self,
        fit: Fit,
        number: int,
        effects: Sequence[Effect],
        released: Sequence[Released],
    ) -> list[object]:
        """Return what each of a recording's free values is among all."""
        names: list[object] = [(number, index) for index in range(fit.model.size)]
        for name in SHARED:
            if {Released(name), Released(name, number)}.isdisjoint(released):
                names[BASELINE.index(name)] = name
        for effect, place in fit.model.places():
            if any(effect is each for each in effects) and self.is_shared(effect):
                names[place] = [(effect.key, index) for index in range(effect.count)]
        return [names[index] for index in fit.free]

    def block(self, fit: Fit, number: int, first: bool) -> tuple[FloatArray, FloatArray]:
        """Return the Jacobian by the free values and the residual, over the scale of errors.

        All share one prior of the hysteretic share of b: the first has its row.
        """
        count = len(fit.residual) - (not first)
        scale = self.members[number].scale
        return fit.jacobian[:count][:, list(fit.free)] / scale, fit.residual[:count] / scale

    def _solved(
        self,
        fits: Sequence[Fit],
        layout: Layout,
        chosen: Sequence[int],
        near: FloatArray | None = None,
        damping: float = 0.0,
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return the best values of all for linear models about each recording's own values.

        And the root of their normal matrix, and chi^2 to first order. Damped as by Levenberg and
        Marquardt towards the values `near`.
        """
        size = len(layout.keys)
        origin, low, high = _origin(fits, layout)
        rows, right = [], []
        for fit, number, slot in zip(fits, chosen, layout.slots, strict=True):
            columns, residual = self.block(fit, number, number == chosen[0])
            target = residual + columns @ (fit.value[list(fit.free)] - origin[slot])
            length = np.linalg.norm(columns, axis=0)
            length[length == 0.0] = 1.0
            stacked = np.column_stack([columns / length, target])
            reduced = np.asarray(np.linalg.qr(stacked, mode="r"))
            part = np.zeros((len(reduced), size))
            part[:, slot] = reduced[:, :-1] * length
            rows.append(part)
            right.append(reduced[:, -1])
        triangle = np.concatenate(rows)
        scale = np.linalg.norm(triangle, axis=0)
        scale[scale == 0.0] = 1.0
        floor, ceiling = (low - origin) * scale, (high - origin) * scale
        matrix, target = triangle / scale, np.concatenate(right)
        if near is not None and damping:
            matrix = np.concatenate([matrix, damping * np.eye(size)])
            target = np.concatenate([target, damping * (near - origin) * scale])
        step = bounded_least_squares(matrix, target, floor, ceiling)
        return origin + step / scale, triangle, float(np.sum((target - matrix @ step) ** 2))

    def _moved(
        self, fits: Sequence[Fit], layout: Layout, values: FloatArray, chosen: Sequence[int]
    ) -> list[Fit] | None:
        moved: list[Fit] = []
        for fit, number, slot in zip(fits, chosen, layout.slots, strict=True):
            value = fit.value.copy()
            value[list(fit.free)] = values[slot]
            found = self.members[number].found
            try:
                steps = GaussNewton(fit.model, found.data, found.noise)
                moved.append(replace(fit, evaluation=steps.evaluate_within_bounds(value)))
            except NoMotionError:
                return None
        return moved

    def _chi2(self, fits: Sequence[Fit], chosen: Sequence[int]) -> float:
        total = 0.0
        for fit, number in zip(fits, chosen, strict=True):
            rows = slice(None) if number == chosen[0] else slice(-1)
            total += float(np.sum((fit.residual[rows] / self.members[number].scale) ** 2))
        return total

    def chi2_alone(self, together: Together, number: int) -> float:
        """Return chi^2 of one recording at its own values."""
        fit = together.alone[number]
        prior = 0.0 if number == 0 else float(fit.residual[-1] / self.members[number].scale) ** 2
        return self._chi2([fit], [number]) - prior

    # What sharing costs ---------------------------------------------------------------------

    def disagreement(self, together: Together) -> tuple[float, int]:
        """Return by how much chi^2 rises where values are shared, and the degrees of freedom."""
        own = self._chi2(together.alone, range(len(self.members)))
        return max(together.chi2 - own, 0.0), together.layout.shared

    def cost(self, together: Together, released: Released) -> float:
        """Return by how much chi^2 would rise if a value were shared after all."""
        kept = [each for each in together.released if each != released]
        shared = self.joined(together.alone, together.effects, kept, together.fits)
        return max(shared.chi2 - together.chi2, 0.0)

    def _releases(self, here: Together) -> Iterator[tuple[float, str, Together]]:
        """Yield evidence, words and model where one more value is not shared, or is again."""
        numbers = range(len(self.members) if len(self.members) > 2 else 0)
        for name in _RELEASED:
            for option in (Released(name), *(Released(name, number) for number in numbers)):
                if option in self.own:
                    continue
                again = option in here.released
                others = [each for each in here.released if each != option]
                if not again and option.recording is None:
                    others = [each for each in others if each.name != name]
                released = (*others, *(() if again else (option,)))
                there = self.joined(here.alone, here.effects, released, here.fits)
                more = len(there.layout.keys) - len(here.layout.keys)
                if not more:
                    continue
                trials = 2.0 * np.log(1 + len(numbers)) if option.recording is not None else 0.0
                worth = _worth(abs(here.chi2 - there.chi2), abs(more)) - trials - FURTHER
                words = f"{name} is shared" if again else f"{name} is not shared"
                yield -worth if again else worth, words, there

    # Moves ----------------------------------------------------------------------------------

    def search(self) -> Together:
        """Release what is contradicted and add what is missing, until chance explains the rest."""
        here = self._begun()
        for _ in range(_MOST_MOVES):
            moves = list(self._releases(here))
            leads = self.leads(here) if len(here.effects) < _MOST_EFFECTS else []
            leads = [lead for lead in leads if self.p_value(lead, lead.score) < self.level]
            for rival, there in self.rivals(here, leads):
                moves.append((rival.evidence - CHOICE, f"adding {rival.name}", there))
            worth, words, there = max(moves, key=lambda move: move[0])
            if worth <= 0.0:
                break
            self.progress(words)
            here = self._rescaled(there)
        return here

    def _begun(self) -> Together:
        """Start with the names that the recordings have alone, those of largest gain."""
        gains: dict[str, tuple[float, Effect]] = {}
        for member in self.members:
            for step in member.found.steps:
                effect = step.winner.lead.effect
                if may_be_common(effect) and effect.key in self._starts:
                    gain = gains.get(effect.key, (0.0, effect))[0] + step.winner.gain
                    gains[effect.key] = (gain, effect)
        names = [effect for _, effect in sorted(gains.values(), key=lambda each: -each[0])]
        for number in range(min(len(names), _MOST_EFFECTS), -1, -1):
            here = self.fitted(names[:number], self.own)
            if here is not None:
                return self._rescaled(here)
        raise NoMotionError("the recordings have no motion in common")

    def _rescaled(self, here: Together) -> Together:
        """Widen the errors of a recording that even its own values leave a misfit in."""
        for number, (member, fit) in enumerate(zip(self.members, here.alone, strict=True)):
            rest = remainder_of(fit, member.found.data, member.found.noise)
            self.members[number] = member._replace(scale=rest.error_scale)
        here = self.joined(here.alone, here.effects, here.released, here.fits)
        for effect in here.effects:
            self._remember(effect, here.fits[-1])
        return here

    def rivals(
        self, without: Together, leads: Sequence[Lead], here: Together | None = None
    ) -> list[tuple[Rival, Together]]:
        """Refit the leads in all recordings together, and rank them; `here` has one of them."""
        best = max((lead.score for lead in leads), default=0.0)
        near = [lead for lead in leads if lead.score > (1.0 - _PART_BEHIND) * best - NEAR]
        found: dict[int, tuple[Rival, Together]] = {}
        for lead in near[:_MOST_REFITTED]:
            effect = lead.effect
            there = here if here and effect in here.effects else None
            there = there or self.fitted((*without.effects, effect), without.released, without)
            if there is None:
                continue
            gain = without.chi2 - there.chi2
            chance = self._loudest.detection.chance
            worth = evidence(lead, there.fits[0], gain, chance)
            if not self.is_shared(effect):
                worth -= SIZE_CHARGE * effect.sizes * (len(self.members) - 1)
            rival = Rival(lead, there.fits[0], gain, gain, worth)
            found[id(rival)] = (rival, there)
        order = ranked([rival for rival, _ in found.values()]) if found else []
        return [found[id(rival)] for rival in order]

    def settled(self) -> tuple[Together, list[Named]]:
        """Search; then compare each effect with its rivals, exchange it or drop it."""
        here = self.search()
        for left in range(_MOST_SWAPS, -1, -1):
            named: list[Named] = []
            there: Together | None = None
            for effect in here.effects:
                others = [other for other in here.effects if other is not effect]
                without = self.fitted(others, here.released, here)
                if without is None:
                    raise NoMotionError(f"there is no motion without {effect.name}")
                rivals = self.rivals(without, self._contenders(without, effect), here)
                own = next((pair[0] for pair in rivals if pair[0].lead.effect is effect), None)
                if own is None or own.evidence < CHOICE:
                    self.progress(f"dropping {effect.name}")
                    there = without
                    break
                named.append(_weighed(own, [rival for rival, _ in rivals]))
                odds = named[-1].weights[1:-1] / named[-1].weights[0]
                if left and odds.max(initial=0.0) > _LIKELIER:
                    likelier = named[-1].mates[int(np.argmax(odds))]
                    self.progress(f"replacing {effect.name} by {likelier.name}")
                    there = next(joint for rival, joint in rivals if rival is likelier)
                    break
            if there is None:
                break
            here = self._rescaled(there)
        return here, named

    def _contenders(self, without: Together, effect: Effect) -> list[Lead]:
        """Return the leads without an effect: it first, then what single recordings left."""
        leads = self.leads(without)
        score = max([lead.score for lead in leads if lead.effect.key == effect.key], default=0.0)
        alone = {
            rival.lead.effect.key
            for member in self.members
            for step in member.found.steps
            for rival in step.rivals
            if rival.fit.chi2 < step.winner.fit.chi2 + NEAR
        }
        first = [lead for lead in leads if lead.effect.key in alone and lead.effect is not effect]
        rest = [lead for lead in leads if lead not in first and lead.effect.key != effect.key]
        best = max([score, *(lead.score for lead in leads)])
        own = Lead(effect, (), best, 0.0)
        raised = [replace(lead, score=best) for lead in first[:3]]
        return [own, *raised, *rest]

    # Scores of the catalogue, over all recordings -------------------------------------------

    @property
    def _loudest(self) -> Search:
        """The recording of the largest amplitude."""
        searches = [member.found for member in self.members]
        return max(searches, key=lambda found: found.baseline.at.span.first_amplitude)

    def leads(self, here: Together) -> list[Lead]:
        """Score every effect that all recordings may lack, to first order, the best first."""
        tangents = self._tangents(here)
        loudest = self._loudest
        used = {effect.key for effect in here.effects}
        found = []
        for effect in applicable(
            CATALOGUE, here.alone[0], self.baseline, self.members[0].found.data.unit
        ):
            if effect.key in used or not may_be_common(effect):
                continue
            shapes = [tuple(map(float, row)) for row in effect.shapes(loudest.baseline.at.span)]
            scores, sizes = self._scores(here, tangents, effect, shapes)
            best = int(np.argmax(scores))
            if scores[best] > 0.0:
                self._starts.setdefault(effect.key, np.append(sizes[best], shapes[best]))
                found.append(Lead(effect, shapes[best], float(scores[best]), 1.0))
        return sorted(found, key=lambda lead: -lead.score)

    def _tangents(self, here: Together) -> tuple[list[FloatArray], FloatArray, list[FloatArray]]:
        """Return each recording's basis, the constraint of sharing, and what it leaves."""
        everyone = range(len(self.members))
        values = here.values
        _, low, high = _origin(here.fits, here.layout)
        inside = (values > low) & (values < high)
        bases, rows, left = [], [], []
        for fit, number, slot in zip(here.fits, everyone, here.layout.slots, strict=True):
            columns, residual = self.block(fit, number, number == 0)
            basis, triangle = np.linalg.qr(columns)
            part = np.zeros((len(triangle), len(values)))
            part[:, slot] = triangle
            bases.append(basis)
            rows.append(part)
            left.append(residual - columns @ (values[slot] - fit.value[list(fit.free)]))
        stacked = np.concatenate(rows)[:, inside]
        # A shared value has one unit for all: it is scaled only once they are stacked.
        stacked /= np.maximum(np.linalg.norm(stacked, axis=0), 1e-300)
        common, sizes, _ = np.linalg.svd(stacked, full_matrices=False)
        common = common[:, sizes > 1e-9 * sizes[0]]
        return bases, common, left

    def _scores(
        self,
        here: Together,
        tangents: tuple[list[FloatArray], FloatArray, list[FloatArray]],
        effect: Effect,
        shapes: Sequence[tuple[float, ...]],
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Return the fall of chi^2 by each shape, to first order, and its sizes."""
        bases, common, left = tangents
        width, count, shared = max(effect.sizes, 1), len(shapes), self.is_shared(effect)
        inner, outer, products = [], [], []
        for number, (fit, basis) in enumerate(zip(here.fits, bases, strict=True)):
            member = self.members[number]
            rows = whitened(fit, member.found.noise, effect, shapes)[:, : len(basis)]
            rows = rows / member.scale
            inner.append((rows @ basis).reshape(count, width, -1))
            rest = rows - (rows @ basis) @ basis.T
            outer.append(rest.reshape(count, width, -1))
            # A recording's own size can't restore what the others take from its own tangent space.
            seen = rows if shared else rest
            products.append((seen @ left[number]).reshape(count, width))
        scores, sizes = np.zeros(count), []
        for shape in range(count):
            flat = np.concatenate([each[shape] for each in inner], axis=1)
            gram = np.array([each[shape] @ each[shape].T for each in outer])
            pull = np.array([each[shape] for each in products])
            if not shared:
                lengths = np.trace(gram, axis1=1, axis2=2)
                whole = lengths + np.array([np.sum(each[shape] ** 2) for each in inner])
                pull = pull * (lengths > 1e-8 * whole)[:, None]
                own = [
                    np.linalg.lstsq(*pair, rcond=1e-10)[0] for pair in zip(gram, pull, strict=True)
                ]
                scores[shape] = float(np.sum(pull * own))
                sizes.append(np.mean(own, axis=0))
                continue
            off = flat - (flat @ common) @ common.T
            matrix, right = gram.sum(axis=0) + off @ off.T, pull.sum(axis=0)
            size = np.linalg.lstsq(matrix, right, rcond=1e-10)[0]
            visible = np.trace(matrix) > 1e-8 * np.trace(flat @ flat.T)
            wrong = effect.one_sided and size[0] <= 0.0
            scores[shape] = 0.0 if wrong or not visible else float(size @ right)
            sizes.append(np.ones(1) if effect.parameter_free else size)
        return scores, sizes

    def p_value(self, lead: Lead, gain: float) -> float:
        """Return the probability that chance gains as much anywhere in the catalogue."""
        freedom = lead.effect.sizes * (1 if self.is_shared(lead.effect) else len(self.members))
        everywhere = self._loudest.detection.chance.everywhere
        return float(everywhere.global_p_value(float(chdtrc(max(freedom, 1), max(gain, 0.0)))))


def _weighed(own: Rival, rivals: Sequence[Rival]) -> Named:
    others = [rival for rival in rivals if rival is not own]
    mates = tuple(rival for rival in others if of_one_class(own, rival))
    none = own.evidence - max(own.prior, 0.0) - _CLEAN_CHARGE
    return Named(own, mates, probabilities([own, *mates], none))


def _worth(gain: float, freedom: int) -> float:
    beyond = gain - SIZE_CHARGE * (freedom - 1)
    return equivalent(float(chdtrc(freedom, max(gain, 0.0))), beyond)


def _held(found: Search) -> Sequence[int]:
    return [index for index in found.held if index < len(BASELINE)]


def may_be_common(effect: Effect) -> bool:
    """Whether an effect may be one of all recordings: no instant, no tone, no curve."""
    return effect.has_signature and not (
        effect.local or effect.spectral or effect.kind in ("unnamed", "parameter")
    )


def _extras(found: Search) -> tuple[Effect, ...]:
    """Return what happened in one recording alone."""
    effects = found.named.model.effects
    return tuple(e for e in effects if e.kind != "unnamed" and not may_be_common(e))


def _origin(fits: Sequence[Fit], layout: Layout) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a point near the recordings' own values, and the bounds."""
    origin, low, high = (np.zeros(len(layout.keys)) for _ in range(3))
    for fit, slot in zip(fits, layout.slots, strict=True):
        free = list(fit.free)
        floor, ceiling = fit.model.bounds()
        origin[slot], low[slot], high[slot] = fit.value[free], floor[free], ceiling[free]
    return origin, low, high
