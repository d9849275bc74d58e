"""Detection: every effect's best score on what a fit leaves, and the global p-value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.chance import DRAWS, FEW_DRAWS, Chance, Trials, draw_chance
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.scores import Bank, build_bank, local_p_values
from pendpipe.diagnose.spectrum import Band, ToneScan, ToneScans, tone_scan
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.catalogue.oscillations import plane_band_hz

_DYING: Final = (0.06, 0.25)
"""Decay times of the dying tones that are looked for, over the record's duration."""

_PLAINLY: Final = 0.2
"""Global p-value from which no more draws are made: far above any level that is asked for."""
_TURNS: Final = 3.0
"""Cycles in the record that make a tone; what is slower is a drift."""
_ABOVE: Final = 1.3
"""Of the motion's frequency: where second modes are looked for."""


@dataclass(frozen=True)
class Lead:
    """An effect's best score.

    Parameters
    ----------
    effect, shape
        The effect, and the shape at which it scores best.
    score
        chi^2 that it would take off, to first order.
    p_value
        How often chance does better over the effect's own shapes.
    """

    effect: Effect
    shape: tuple[float, ...]
    score: float
    p_value: float


@dataclass(frozen=True)
class Detection:
    """What a scan of the whole catalogue has found.

    Parameters
    ----------
    leads
        One an effect, the best first.
    p_value
        Global: of the smallest local p-value anywhere.
    chance
        What chance finds in the catalogue, and with each effect by itself.
    """

    leads: tuple[Lead, ...]
    p_value: float
    chance: Chance


@dataclass(frozen=True)
class Scanner:
    """The columns of a catalogue along one fit."""

    bank: Bank
    tones: ToneScans
    spectral: tuple[Effect, ...]
    duration_s: float


def prepare(fit: Fit, data: Data, noise: Noise, effects: Sequence[Effect]) -> Scanner:
    """Work out all columns."""
    spectral = tuple(effect for effect in effects if effect.spectral)
    others = [effect for effect in effects if effect not in spectral]
    bank = build_bank(fit, noise, others)
    scans: list[ToneScan] = []
    if spectral and data.uniform:
        duration = float(data.time_s[-1] - data.time_s[0])
        own = fit.value[OMEGA] / (2.0 * math.pi)
        steady = Band(_TURNS / duration, own, plane_band_hz(fit.at.span))
        scans.append(tone_scan(data, noise, bank.basis, np.ones(len(data)), steady))
        since = (data.time_s - data.time_s[0]) / (data.time_s[-1] - data.time_s[0])
        scans += [
            tone_scan(data, noise, bank.basis, np.exp(-since / dying), Band(_ABOVE * own))
            for dying in _DYING
        ]
    return Scanner(
        bank, ToneScans(noise, tuple(scans)), spectral, float(data.time_s[-1] - data.time_s[0])
    )


def detect(scanner: Scanner, fit: Fit, *, seed: int, known: Detection | None = None) -> Detection:
    """Score everything.

    Parameters
    ----------
    scanner, fit
        The columns, and the fit whose residual is looked at.
    seed
        Of the draws that count the trials.
    known
        An earlier detection on this record: its trials are used again.
    """
    bank = scanner.bank
    residual = fit.residual - bank.basis @ (bank.basis.T @ fit.residual)
    smallest = 1.0
    scores = bank.scores(residual) if bank.candidates else np.zeros(0)
    if bank.candidates:
        smallest = float(local_p_values(scores, bank.freedom).min())
    tones = scanner.tones.scores(residual)
    for scan in tones:
        smallest = min(smallest, math.exp(-0.5 * float(scan.max())))
    few = None if known is None else known.chance
    chance = few or draw_chance(bank, scanner.tones, seed, FEW_DRAWS)
    if chance.draws < DRAWS and chance.everywhere.global_p_value(smallest) < _PLAINLY:
        chance = draw_chance(bank, scanner.tones, seed)
    leads = _bank_leads(bank, scores, chance.own)
    leads += _tone_leads(scanner, tones)
    leads.sort(key=lambda lead: (lead.p_value, -lead.score))
    return Detection(tuple(leads), chance.everywhere.global_p_value(smallest), chance)


def more_leads(fit: Fit, noise: Noise, effects: Sequence[Effect]) -> list[Lead]:
    """Score effects that were not scanned, on what a fit leaves."""
    bank = build_bank(fit, noise, effects)
    residual = fit.residual - bank.basis @ (bank.basis.T @ fit.residual)
    return _bank_leads(bank, bank.scores(residual), {}) if bank.candidates else []


def _bank_leads(bank: Bank, scores: FloatArray, own: dict[str, Trials]) -> list[Lead]:
    leads = []
    for name, rows in bank.rows().items():
        index = rows[int(np.argmax(scores[rows]))]
        candidate = bank.candidates[index]
        score = float(scores[index])
        local = float(local_p_values(np.array([score]), np.array([float(candidate.width)]))[0])
        p_value = own[name].global_p_value(local) if name in own else local
        leads.append(Lead(candidate.effect, candidate.shape, score, p_value))
    return leads


def _tone_leads(scanner: Scanner, tones: Sequence[FloatArray]) -> list[Lead]:
    """The strongest tone, steady or dying, for each effect that is one."""
    leads = []
    for effect in scanner.spectral:
        found = []
        for scan, dying, scores in zip(scanner.tones.scans, (None, *_DYING), tones, strict=False):
            index = int(np.argmax(scores))
            score = float(scores[index])
            decay = math.inf if dying is None else dying * scanner.duration_s
            shape = effect.tone(float(scan.frequency_hz[index]), decay)
            if shape is not None:
                local = Trials(0.5 * len(scores), 0.0).global_p_value(math.exp(-0.5 * score))
                found.append(Lead(effect, tuple(shape), score, local))
        leads += sorted(found, key=lambda lead: lead.p_value)[:1]
    return leads
