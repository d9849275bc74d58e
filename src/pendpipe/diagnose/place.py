"""A place in a recording: time, amplitude, phase of the cycle, frequency, harmonic, code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Location:
    """Where an effect shows in the readings.

    Parameters
    ----------
    time_s, amplitude_rad, phase_rad
        Intervals that hold nine tenths of what it explains; the phase from a turning point
        at the positive side; None where it is everywhere.
    frequency_hz, harmonics
        Where in the spectrum: frequencies, and multiples of the motion's.
    adc_codes
        The converter's codes that are concerned.
    summary
        One clause.
    """

    time_s: tuple[float, float] | None = None
    amplitude_rad: tuple[float, float] | None = None
    phase_rad: tuple[float, float] | None = None
    frequency_hz: tuple[float, ...] = ()
    harmonics: tuple[int, ...] = ()
    adc_codes: tuple[int, ...] = ()
    summary: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the contract's form."""

        def pair(interval: tuple[float, float] | None) -> list[float] | None:
            return None if interval is None else [float(end) for end in interval]

        return {
            "summary": self.summary,
            "time_s": pair(self.time_s),
            "amplitude_rad": pair(self.amplitude_rad),
            "phase_rad": pair(self.phase_rad),
            "frequency_hz": list(self.frequency_hz),
            "harmonics": list(self.harmonics),
            "adc_codes": list(self.adc_codes),
        }
