"""Detection: the best score of every effect on a fit's residual, and the global p-value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.chance import DRAWS, FEW_DRAWS, Chance, Trials, draw_chance
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.scores import Bank, build_bank
from pendpipe.diagnosis.spectrum import Band, ToneScan, ToneScans, tone_scan
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.catalogue.in_time import plane_band_hz

_DECAY_TIMES: Final = (0.06, 0.25)
"""Decay times of the decaying tones in the scan, over the record's duration."""

_CLEARLY_CHANCE: Final = 0.2
"""Global p-value above which no more draws are made: far above any significance level."""
_FEWEST_CYCLES: Final = 3.0
"""Fewest cycles of a tone in the record; slower ones are drifts."""
_LOWEST_MODE: Final = 1.3
"""Lowest frequency of a decaying second mode, over the motion's."""


@dataclass(frozen=True)
class Lead:
    """An effect's best score.

    Parameters
    ----------
    effect, shape
        The effect, and the shape at which it scores best.
    score
        Fall of chi^2, to first order.
    p_value
        Probability that chance does better over the effect's own shapes.
    """

    effect: Effect
    shape: tuple[float, ...]
    score: float
    p_value: float


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
    """The derivatives by all effects of a catalogue along one fit."""

    bank: Bank
    tones: ToneScans
    spectral: tuple[Effect, ...]
    duration_s: float


def prepare(fit: Fit, data: Data, noise: Noise, effects: Sequence[Effect]) -> Scanner:
    """Compute the derivatives by all effects."""
    spectral = tuple(effect for effect in effects if effect.spectral)
    others = [effect for effect in effects if effect not in spectral]
    bank = build_bank(fit, noise, others)
    scans: list[ToneScan] = []
    if spectral and data.uniform:
        duration = float(data.time_s[-1] - data.time_s[0])
        own = fit.value[OMEGA] / (2.0 * math.pi)
        steady = Band(_FEWEST_CYCLES / duration, own, plane_band_hz(fit.at.span))
        scans.append(tone_scan(data, noise, bank.basis, np.ones(len(data)), steady))
        since = (data.time_s - data.time_s[0]) / (data.time_s[-1] - data.time_s[0])
        scans += [
            tone_scan(data, noise, bank.basis, np.exp(-since / dying), Band(_LOWEST_MODE * own))
            for dying in _DECAY_TIMES
        ]
    return Scanner(
        bank, ToneScans(noise, tuple(scans)), spectral, float(data.time_s[-1] - data.time_s[0])
    )


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
    residual = fit.residual - bank.basis @ (bank.basis.T @ fit.residual)
    smallest = 1.0
    scores = bank.scores(residual) if bank.candidates else np.zeros(0)
    if bank.candidates:
        smallest = float(bank.p_values(scores).min())
    tones = scanner.tones.scores(residual)
    for scan, found in zip(scanner.tones.scans, tones, strict=True):
        smallest = min(smallest, float(scan.p_values(found).min()))
    few = None if known is None else known.chance
    chance = few or draw_chance(bank, scanner.tones, seed, FEW_DRAWS)
    if chance.draws < DRAWS and chance.everywhere.global_p_value(smallest) < _CLEARLY_CHANCE:
        chance = draw_chance(bank, scanner.tones, seed)
    leads = _bank_leads(bank, scores, chance.own)
    leads += _tone_leads(scanner, tones)
    leads.sort(key=lambda lead: (lead.p_value, -lead.score))
    return Detection(tuple(leads), chance.everywhere.global_p_value(smallest), chance)


def more_leads(fit: Fit, noise: Noise, effects: Sequence[Effect]) -> list[Lead]:
    """Score effects that were not scanned, on a fit's residual."""
    bank = build_bank(fit, noise, effects)
    residual = fit.residual - bank.basis @ (bank.basis.T @ fit.residual)
    return _bank_leads(bank, bank.scores(residual), {}) if bank.candidates else []


def _bank_leads(bank: Bank, scores: FloatArray, own: dict[str, Trials]) -> list[Lead]:
    leads = []
    p_values = bank.p_values(scores)
    for name, rows in bank.rows().items():
        # How surely the noise is known differs by shape: that counts for chance, not for the name.
        candidate = bank.candidates[max(rows, key=lambda row: scores[row])]
        score, local = float(np.max(scores[rows])), float(np.min(p_values[rows]))
        p_value = own[name].global_p_value(local) if name in own else local
        leads.append(Lead(candidate.effect, candidate.shape, score, p_value))
    return leads


def _tone_leads(scanner: Scanner, tones: Sequence[FloatArray]) -> list[Lead]:
    """Return the strongest tone, steady or decaying, for each effect that is a tone."""
    leads = []
    for effect in scanner.spectral:
        found = []
        for scan, dying, scores in zip(
            scanner.tones.scans, (None, *_DECAY_TIMES), tones, strict=False
        ):
            p_values = scan.p_values(scores)
            # Beyond 10^-308 all p-values are zero: there the scores decide.
            index = int(np.lexsort((-scores, p_values))[0])
            score = float(scores[index])
            decay = math.inf if dying is None else dying * scanner.duration_s
            shape = effect.tone(float(scan.frequency_hz[index]), decay)
            if shape is not None:
                local = Trials(0.5 * len(scores), 0.0).global_p_value(float(p_values[index]))
                found.append(Lead(effect, tuple(shape), score, local))
        leads += sorted(found, key=lambda lead: (lead.p_value, -lead.score))[:1]
    return leads
