"""Detection: the best score of every effect on a fit's residual, and the global p-value.

One inner product for each effect, whitened and projected: every effect has a derivative of the
readings by its size along the fitted motion. The part that the model's own parameters can reproduce
is projected out; the score is the inner product of the rest, at unit length, with the whitened
residual: the locally most powerful test. A scan over an effect's shape is many such columns. How
often chance alone does as well anywhere in the catalogue (the look-elsewhere effect) is counted on
white residuals.
Tones of any frequency, steady or decaying, have a scan of their own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.ndimage import uniform_filter1d

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import blocks_of, local_p_values, tangent_basis, whitened
from pendpipe.diagnosis.refine import Fit
from pendpipe.dynamics.eq8 import OMEGA
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.in_time import plane_band_hz
from pendpipe.effects.curves import Curve
from pendpipe.effects.effect import Span
from pendpipe.effects.model import Model
from pendpipe.estimate import Z95
from pendpipe.score import Trials, trials_of

_OVERSAMPLING: Final = 2
"""Frequencies in an interval of 1/duration."""
_BESIDE: Final = 12.0
"""Frequencies beside a line, in 1/duration: a choice; a stand's resonance is wider."""
_LINE: Final = 2.0
"""Frequencies of the line itself, in 1/duration: its main lobe."""
OFF_HARMONIC: Final = 0.1
"""Distance of a separate line from the nearest harmonic, over the motion's frequency."""
_TONE_VISIBLE: Final = 0.02
"""Part of a tone's power that must remain after the projection."""


class Band(NamedTuple):
    """The scanned frequencies: above one, and not near the motion's own."""

    above_hz: float
    own_hz: float
    width_hz: float = 0.0


@dataclass(frozen=True)
class ToneScan:
    """A scan over frequency with one envelope.

    Parameters
    ----------
    decay_s
        Decay time of the tone; inf where it is steady.
    envelope
        What multiplies it, shape (n,).
    frequency_hz
        Shape (m,).
    inverse
        Of the 2x2 Gram matrices of projected cosine and sine, shape (m, 3): entries 11, 12, 22;
        zero where nothing remains.
    log_scale_variance
        Variance of the logarithm of the noise at each frequency, shape (m,).
    size
        Of the Fourier transform.
    wider
        By how much a tone is wider than a steady one.
    as_steady
        Where what lies beside a steady tone is taken, shape (m,): near the motion's harmonics,
        whose misfits fade too, or everywhere if beside a wider one lies the next harmonic.
    lines
        Independent frequencies in the scanned band (Baluev 2008): sqrt(4 pi) times its width and
        the standard deviation of the time, weighted with the squared envelope.
    """

    decay_s: float
    envelope: FloatArray
    frequency_hz: FloatArray
    inverse: FloatArray
    log_scale_variance: FloatArray
    size: int
    wider: float
    as_steady: BoolArray
    lines: float

    def trials(self, height: FloatArray) -> FloatArray:
        """Return the number of trials at half a chi^2, to a tenth.

        By Rice's formula they grow with the root of the height, up to all frequencies.
        """
        crossings, most = self.lines * np.sqrt(height), np.count_nonzero(self.inverse[:, 0])
        return np.asarray(crossings * most / np.maximum(np.hypot(crossings, most), 1.0))

    def p_values(self, scores: FloatArray) -> FloatArray:
        """Return the probability that chance alone does better at each frequency by itself.

        It is that of `scores.local_p_values` for two degrees of freedom. Where the frequencies
        beside one are louder than the noise should be, it is compared with them. They tell the
        noise too where its spectrum is hardly known, as beside a strong line.
        """
        level, beside = self._beside(scores)
        least = np.where(level > 1.0, 1.0 / beside, self.log_scale_variance)
        half = np.maximum(0.5 * np.minimum(least, 1.0 / beside), 1e-12)
        return np.asarray(np.exp(-0.5 / half * np.log1p(half * scores / level)))

    def _beside(self, scores: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the level of the frequencies beside each one, over the noise, and their number.

        A spectrum that is smooth over many cosines misses the resonance of a stand. A level is 1
        where chance explains it. A tone that fades is wider.
        """
        steady = self.size / len(self.envelope)
        found = [self._about(scores, resolved) for resolved in (steady, steady * self.wider)]
        level, beside = (np.where(self.as_steady, *each) for each in zip(*found, strict=True))
        return np.where(level > 1.0 + Z95 / np.sqrt(beside), level, 1.0), beside

    def _about(self, scores: FloatArray, resolved: float) -> tuple[FloatArray, FloatArray]:
        """Return the mean of the frequencies about each one, and their number.

        `resolved` is by how many entries independent frequencies lie apart.
        """
        seen = self.inverse.any(axis=1)

        def sums(cosines: float) -> FloatArray:
            width = 2 * round(cosines * resolved) + 1
            pair = np.stack([0.5 * scores * seen, seen.astype(np.float64)])
            return np.asarray(width * uniform_filter1d(pair, width, mode="constant"))

        total, number = sums(_BESIDE) - sums(_LINE)
        return total / np.maximum(number, 1.0), np.maximum(number / resolved, 1.0)

    def scores(self, weights: FloatArray) -> FloatArray:
        """Return chi^2 (two degrees of freedom) of a tone at each frequency; shape (m, ...).

        `weights` is `Noise.adjoint` of the whitened and projected residual, shape (n, ...).
        """
        rows = np.multiply(weights.T, self.envelope, order="C")
        lines = np.fft.rfft(rows, n=self.size)[..., 1 : len(self.inverse) + 1]
        real, imaginary = lines.real, lines.imag
        first, mixed, second = self.inverse.T
        found = first * real**2 - 2.0 * mixed * real * imaginary + second * imaginary**2
        return np.asarray(found.T)


def tone_scan(data: Data, noise: Noise, basis: FloatArray, decay_s: float, band: Band) -> ToneScan:
    """Prepare a scan: project the model's tangent space out of a tone at each frequency."""
    count, envelope = len(data), np.exp((data.time_s[0] - data.time_s) / decay_s)
    size = _OVERSAMPLING * next_fast_len(count, real=True)
    frequency = np.asarray(np.fft.rfftfreq(size, data.interval_s)[1:], dtype=np.float64)
    keep = slice(1, len(frequency) + 1)
    cosine = 2.0 * count * data.interval_s * frequency
    # Products of tones follow from the Fourier transform of the squared envelope, and their
    # power from its autocorrelation: a tone leaks to where the noise may be far less.
    swell = noise.scale * envelope
    double = np.fft.rfft(swell**2, n=size) / float(swell @ swell)
    together = np.fft.irfft(np.abs(np.fft.rfft(swell, n=size)) ** 2, n=size)
    heard = np.fft.irfft(1.0 / np.append(noise.variance, noise.variance[-1]))[:count]
    together[:count] *= heard
    together[count : size - count + 1] = 0.0
    together[size - count + 1 :] *= heard[:0:-1]
    power = 0.5 * np.maximum(np.fft.rfft(together).real[keep], 0.0)
    index = 2 * np.arange(1, len(frequency) + 1)
    folded = np.where(index <= size // 2, index, size - index)
    lines = np.where(index <= size // 2, double[folded], np.conj(double[folded]))
    g11 = power * (1.0 + lines.real)
    g22 = power * (1.0 - lines.real)
    g12 = -power * lines.imag
    h11, h22, h12 = g11.copy(), g22.copy(), g12
    for row in basis[:-1].T:
        known = np.fft.rfft(noise.adjoint(row) * envelope, n=size)[keep]
        h11 -= known.real**2
        h22 -= known.imag**2
        h12 += known.real * known.imag
    determinant = h11 * h22 - h12**2
    seen = (
        (determinant > (_TONE_VISIBLE * 0.25 * (g11 + g22) ** 2))
        & (frequency > band.above_hz)
        & (np.abs(frequency - band.own_hz) > band.width_hz)
        & (frequency < 0.98 * frequency[-1])
    )
    safe = np.where(seen, determinant, 1.0)
    inverse = np.empty((len(frequency), 3))
    for entry, own in enumerate((h22, -h12, h11)):
        inverse[:, entry] = own / safe * seen
    order, fade = frequency / band.own_hz, envelope**2
    wider = float(count * (fade @ fade) / fade.sum() ** 2)
    beyond = _BESIDE * wider / (count * data.interval_s) > band.own_hz
    as_steady = beyond | (np.abs(order - np.rint(order)) < OFF_HARMONIC)
    unsure = noise.log_variance_at(cosine)
    since = data.time_s - data.time_s[0]
    since = since - float(fade @ since) / float(fade.sum())
    spread_s = math.sqrt(float(fade @ since**2) / float(fade.sum()))
    width_hz = np.count_nonzero(seen) / (size * data.interval_s)
    own = float(math.sqrt(4.0 * math.pi) * spread_s * width_hz)
    return ToneScan(decay_s, envelope, frequency, inverse, unsure, size, wider, as_steady, own)


_VISIBLE = 1e-4
"""Part of a derivative that must remain after the projection for the effect to be visible."""

_RESOLVED_SD = 4.0
"""Standard deviations at which a coefficient of a curve must be visible to be kept."""


_COLUMNS_AT_ONCE = 32
"""Columns projected together: a block of them stays in the processor's cache."""
_NUMBERS_AT_ONCE = 1 << 22
"""Numbers in it, 32 MB, where a column is long."""


class Lead(NamedTuple):
    """An effect at a shape, and how it scores there.

    Parameters
    ----------
    effect, shape
        The effect, and its values behind the sizes.
    score
        Fall of chi^2, to first order.
    p_value
        Probability that chance does better over the effect's own shapes.
    begun
        The model with it, and the values where a refit begins (`Effect.restart`); None at size 0.
    """

    effect: Effect
    shape: tuple[float, ...] = ()
    score: float = 0.0
    p_value: float = 1.0
    begun: tuple[Model, FloatArray] | None = None


@dataclass(frozen=True)
class Bank:
    """Unit columns of all candidates, orthogonal to the model's tangent space.

    Parameters
    ----------
    basis
        Orthonormal, of the model's tangent space, shape (m + 1, p).
    columns
        Shape (m + 1, k), float32: a candidate's columns are orthonormal among themselves.
    candidates, freedom
        The effects and shapes to which the columns belong, and how many each has: its degrees of
        freedom.
    log_scale_variance
        Variance of the logarithm of the noise that each candidate meets, shape (candidates,).
    noise
        Of the m numbers that are compared; None where they are given as such.
    """

    basis: FloatArray
    columns: NDArray[np.float32]
    candidates: tuple[Lead, ...]
    freedom: NDArray[np.intp]
    log_scale_variance: FloatArray
    noise: Noise | None = None

    def compared(self, residual: FloatArray) -> FloatArray:
        """Return what is compared of a whitened residual, less what the model can reproduce."""
        numbers = residual if self.noise is None else self.noise.numbers_of(residual)
        return np.asarray(numbers - self.basis @ (self.basis.T @ numbers))

    def scores(self, residual: FloatArray) -> FloatArray:
        """Return the sum of squares of each candidate's inner products; shape (candidates, ...).

        A size that can't be negative (a friction) scores with a positive sign only.
        """
        products = self.columns.T @ residual.astype(np.float32)
        sided = np.array([each.effect.one_sided for each in self.candidates], dtype=bool)
        signed = self.first[sided]
        products[signed] = np.maximum(products[signed], 0.0)
        squares = products.astype(np.float64) ** 2
        return np.asarray(np.add.reduceat(squares, self.first, axis=0))

    def p_values(self, scores: FloatArray) -> FloatArray:
        """Return the probability that chance alone does better, for each candidate by itself."""
        return local_p_values(scores, self.freedom, self.log_scale_variance)

    @property
    def first(self) -> NDArray[np.intp]:
        """The number of each candidate's first column."""
        return np.cumsum(self.freedom) - self.freedom

    def rows(self) -> dict[str, list[int]]:
        """Return the indices of the candidates of each effect, by its key."""
        found: dict[str, list[int]] = {}
        for index, candidate in enumerate(self.candidates):
            found.setdefault(candidate.effect.key, []).append(index)
        return found


def build_bank(fit: Fit, noise: Noise, effects: Sequence[Effect]) -> Bank:
    """Compute the columns of all effects along a fitted motion.

    A few shapes at a time, stored in single precision, and of a long record in blocks.
    """
    fit, noise = blocks_of(fit, noise)
    shapes = [[tuple(map(float, row)) for row in each.shapes(fit.at.span)] for each in effects]
    most = sum(max(e.sizes, 1) * len(rows) for e, rows in zip(effects, shapes, strict=True))
    basis, filled = tangent_basis(fit), 0
    columns = np.empty((most, len(basis)), dtype=np.float32)
    candidates, freedom, unsure = list[Lead](), list[int](), [np.zeros(0)]
    at_once = max(min(_COLUMNS_AT_ONCE, _NUMBERS_AT_ONCE // len(basis)), 1)
    for effect, rows in zip(effects, shapes, strict=True):
        some = max(at_once // max(effect.sizes, 1), 1)
        if isinstance(effect, Curve):
            some = len(rows)
        for first in range(0, len(rows), some):
            part = rows[first : first + some]
            seen, own, units = _beside(basis, effect, part, whitened(fit, noise, effect, part))
            if not own:
                continue
            flat = units.reshape(-1, len(basis))
            columns[filled : filled + len(flat)] = flat
            filled += len(flat)
            each = noise.log_scale_variance(flat)
            unsure.append(each.reshape(units.shape[:2]).mean(axis=1))
            candidates += [Lead(seen, shape) for shape in own]
            freedom += [units.shape[1]] * len(own)
    width = np.array(freedom, dtype=np.intp)
    return Bank(basis, columns[:filled].T, tuple(candidates), width, np.concatenate(unsure), noise)


def _beside(
    basis: FloatArray,
    effect: Effect,
    shapes: Sequence[tuple[float, ...]],
    columns: FloatArray,
) -> tuple[Effect, list[tuple[float, ...]], NDArray[Any]]:
    """Project out the model's tangent space, and return what is seen of each shape.

    Returns
    -------
    effect
        A curve with the combinations of its basis functions that the record resolves; else as it
        was.
    shapes, units
        Those of which something is seen, and their orthonormal columns, shape (shapes, width,
        n + 1).
    """
    least = _VISIBLE * np.linalg.norm(columns, axis=1)
    left = columns
    left -= (columns @ basis) @ basis.T
    if isinstance(effect, Curve):
        effect, left = _visible(effect, left)
        least = np.zeros(len(left))
    rows, lengths = _orthonormal(left.reshape(len(shapes), -1, len(basis)))
    seen = np.all(lengths > least.reshape(lengths.shape), axis=1) & (lengths.size > 0)
    return effect, [shapes[k] for k in np.flatnonzero(seen).tolist()], rows[seen]


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Make each shape's columns orthonormal in their order.

    Returns
    -------
    units, lengths
        Shape (shapes, width, n + 1), and what of each column is left beside those before it,
        shape (shapes, width).
    """
    units, triangle = np.linalg.qr(np.swapaxes(columns, 1, 2))
    diagonal = np.einsum("kii->ki", triangle)
    return np.swapaxes(units * np.sign(diagonal)[:, None], 1, 2), np.abs(diagonal)


def _visible(curve: Curve, part: FloatArray) -> tuple[Curve, FloatArray]:
    """Keep the combinations of a curve's basis functions that the record resolves."""
    mixtures, lengths, _ = np.linalg.svd(np.asarray(np.linalg.qr(part.T, mode="r")).T)
    mixing = mixtures[:, lengths > _RESOLVED_SD]
    return curve.reduced(mixing), mixing.T @ part


CATALOGUE_SHARE: Final = 0.5
"""Part of the significance level for the scan of the catalogue."""
RED_NOISE_SHARE: Final = 0.2
"""Part of it for the test whether red noise is an effect."""
TESTS_SHARE: Final = 1.0 - CATALOGUE_SHARE - RED_NOISE_SHARE
"""Part of it that the tests of the measurement share."""
DRAWS: Final = 256
"""Spectra drawn for the null: a chance of one half is known to 3 %; the tail by `TAIL_SHARE`."""
FEW_DRAWS: Final = 64
"""Draws for a first look: they determine the number of trials to 20 %."""
_DRAWS_AT_ONCE: Final = 32
"""Draws computed together: few enough for the processor's cache."""
_DRAWN_AT_ONCE: Final = 1 << 21
"""Numbers of white residuals computed together, for memory's sake."""


_DECAY_TIMES: Final = (0.06, 0.25)
"""Decay times of the decaying tones in the scan, over the record's duration."""

_SURE: Final = 1e-15
"""A tone of a smaller p-value is no chance; of two the larger score leads."""
_CLEARLY_CHANCE: Final = 0.2
"""Global p-value above which no more draws are made: far above any significance level."""
_FEWEST_CYCLES: Final = 3.0
"""Fewest cycles of a tone in the record; slower ones are drifts."""
_LOWEST_MODE: Final = 1.3
"""Lowest frequency of a decaying second mode, over the motion's."""


@dataclass(frozen=True)
class Chance:
    """Trials of the scans, counted on white residuals.

    Parameters
    ----------
    everywhere
        Trials of the whole catalogue.
    own
        Trials of each effect by itself, by identifier.
    draws
        Number of draws.
    """

    everywhere: Trials
    own: dict[str, Trials]
    draws: int = DRAWS


@dataclass(frozen=True)
class Detection:
    """The result of a scan of the whole catalogue.

    Parameters
    ----------
    leads
        One for each effect, the best first.
    p_value
        Global: of the smallest local p-value anywhere.
    chance
        Trials of the whole catalogue, and of each effect.
    """

    leads: tuple[Lead, ...]
    p_value: float
    chance: Chance


@dataclass(frozen=True)
class Scanner:
    """The derivatives by all effects of a catalogue along one fit.

    Parameters
    ----------
    bank
        Of the effects that are no tones.
    noise
        Of the readings.
    basis
        Orthonormal, of the model's tangent space among all readings, shape (n + 1, p).
    lines, scans
        The effects that make a line, and the scans for them, steady or decaying.
    """

    bank: Bank
    noise: Noise
    basis: FloatArray
    lines: tuple[Effect, ...] = ()
    scans: tuple[ToneScan, ...] = ()

    def tones(self, residual: FloatArray) -> list[FloatArray]:
        """Return each scan's chi^2 of a whitened residual (with the prior's entry)."""
        if not self.scans:
            return []
        left = residual - self.basis @ (self.basis.T @ residual)
        weights = self.noise.adjoint(left[:-1])
        return [scan.scores(weights) for scan in self.scans]


def prepare(fit: Fit, data: Data, noise: Noise, effects: Sequence[Effect]) -> Scanner:
    """Compute the derivatives by all effects."""
    lines = tuple(effect for effect in effects if effect.has_lines)
    bank = build_bank(fit, noise, [effect for effect in effects if not effect.spectral])
    basis = bank.basis if len(bank.basis) == len(fit.residual) else tangent_basis(fit)
    scans: list[ToneScan] = []
    if lines and data.uniform:
        since = data.time_s - data.time_s[0]
        own = fit.value[OMEGA] / (2.0 * math.pi)
        steady = Band(_FEWEST_CYCLES / float(since[-1]), own, plane_band_hz(fit.at.span))
        scans.append(tone_scan(data, noise, basis, math.inf, steady))
        scans += [
            tone_scan(data, noise, basis, part * float(since[-1]), Band(_LOWEST_MODE * own, own))
            for part in _DECAY_TIMES
        ]
    return Scanner(bank, noise, basis, lines, tuple(scans))


def draw_chance(scanner: Scanner, seed: int, draws: int = DRAWS) -> Chance:
    """Count trials: draw white residuals and scan them; a loudest tone is drawn from its law.

    The tail of the smallest p-value is extrapolated with a slowly growing number of trials, as
    by Gross and Vitells for continuous scans.

    Parameters
    ----------
    scanner
        The effects' derivatives, and the scans for tones.
    seed, draws
        Of the generator; the number of draws.
    """
    generator, bank = np.random.default_rng(seed), scanner.bank
    rows = bank.rows()
    largest: list[list[FloatArray]] = []
    at_once = max(min(_DRAWS_AT_ONCE, _DRAWN_AT_ONCE // len(bank.basis)), 1)
    for first in range(0, draws, at_once):
        # The columns are orthogonal to what a fit would take from it.
        white = generator.standard_normal((min(at_once, draws - first), len(bank.basis))).T
        scores = bank.scores(white)
        largest.append([scores[indices].max(axis=0) for indices in rows.values()])
    # All shapes of one effect have the same degrees of freedom.
    found = {
        name: local_p_values(np.concatenate(parts)[None], bank.freedom[rows[name][:1]])[0]
        for name, parts in zip(rows, zip(*largest, strict=True), strict=True)
    }
    own = {
        name: Trials(1.0, 0.0) if len(rows[name]) == 1 else trials_of(local)
        for name, local in found.items()
    }
    tone = np.exp(-_loudest(scanner.scans, generator.exponential(size=draws)))
    smallest = np.min([tone, *found.values()], axis=0)
    return Chance(trials_of(smallest), own, draws)


def _loudest(scans: Sequence[ToneScan], rare: FloatArray) -> FloatArray:
    """Return half of the largest chi^2 of a tone where its trials times e^-that are `rare`."""
    height = np.full_like(rare, 0.0 if not scans else 10.0)
    for _ in range(6 if scans else 0):
        trials = np.sum([scan.trials(height) for scan in scans], axis=0)
        height = np.maximum(np.log(np.maximum(trials, 1e-9) / rare), 1e-3)
    return height


def detect(scanner: Scanner, fit: Fit, *, seed: int, known: Detection | None = None) -> Detection:
    """Score all effects on a fit's residual.

    Parameters
    ----------
    scanner, fit
        The derivatives, and the fit.
    seed
        Of the draws that count the trials.
    known
        An earlier detection on this record, whose trials are reused.
    """
    bank = scanner.bank
    scores, tones = bank.scores(bank.compared(fit.residual)), scanner.tones(fit.residual)
    local = [scan.p_values(found) for scan, found in zip(scanner.scans, tones, strict=True)]
    smallest = min(
        [1.0, *(float(each.min()) for each in (bank.p_values(scores), *local) if len(each))]
    )
    few = None if known is None else known.chance
    chance = few or draw_chance(scanner, seed, FEW_DRAWS)
    if chance.draws < DRAWS and chance.everywhere.global_p_value(smallest) < _CLEARLY_CHANCE:
        chance = draw_chance(scanner, seed)
    leads = [
        *_bank_leads(bank, scores, chance.own),
        *_tone_leads(scanner, tones, local, fit.at.span),
    ]
    # One that makes lines near and far is led by the larger score.
    leads = list({each.effect.key: each for each in sorted(leads, key=lambda e: e.score)}.values())
    leads.sort(key=lambda lead: (lead.p_value, -lead.score))
    return Detection(tuple(leads), chance.everywhere.global_p_value(smallest), chance)


def more_leads(fit: Fit, noise: Noise, effects: Sequence[Effect]) -> list[Lead]:
    """Score effects that were not scanned, on a fit's residual."""
    bank = build_bank(fit, noise, effects)
    return _bank_leads(bank, bank.scores(bank.compared(fit.residual)), {})


def _bank_leads(bank: Bank, scores: FloatArray, own: dict[str, Trials]) -> list[Lead]:
    leads = []
    p_values = bank.p_values(scores)
    for name, rows in bank.rows().items():
        # How surely the noise is known differs by shape: that counts for chance, not for the name.
        candidate = bank.candidates[max(rows, key=lambda row: scores[row])]
        score, local = float(np.max(scores[rows])), float(np.min(p_values[rows]))
        p_value = own[name].global_p_value(local) if name in own else local
        leads.append(candidate._replace(score=score, p_value=p_value))
    return leads


def _tone_leads(
    scanner: Scanner, tones: Sequence[FloatArray], local: Sequence[FloatArray], span: Span
) -> list[Lead]:
    """Return the strongest tone, steady or decaying, for each effect that is a tone."""
    leads = []
    for effect in scanner.lines:
        found = []
        for scan, scores, p_values in zip(scanner.scans, tones, local, strict=True):
            # What a strong line leaks bounds its p-value, beside it: there the scores decide.
            sure = p_values <= max(float(p_values.min()), _SURE)
            index = int(np.argmax(np.where(sure, scores, -np.inf)))
            shape = effect.tone(float(scan.frequency_hz[index]), scan.decay_s, span)
            if shape is not None:
                trials = Trials(0.5 * len(scores), 0.0)
                p_value = trials.global_p_value(float(p_values[index]))
                found.append(Lead(effect, tuple(shape), float(scores[index]), p_value))
        leads += sorted(found, key=lambda lead: (max(lead.p_value, _SURE), -lead.score))[:1]
    return leads
