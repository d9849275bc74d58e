"""One line on the terminal that shows how a recording goes on."""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from typing import TextIO

import numpy as np

from pendpipe.acquisition.drivers.base import Driver, Setup
from pendpipe.acquisition.drivers.decoders import Decoder
from pendpipe.arrays import AnyArray

_REFRESH_S = 0.2
_MEMORY_S = 5.0
"""The amplitude shown is that of the last seconds, of the recorder's clock."""


class ProgressLine:
    """Elapsed time, scans, rate, amplitude now and losses, rewritten in place.

    Parameters
    ----------
    stream
        Where to write, usually standard error; nothing is written if it is no terminal.
    duration_s
        What was asked for.
    """

    def __init__(self, stream: TextIO, duration_s: float) -> None:
        self._stream = stream
        self._duration_s = duration_s
        self._shown = 0.0
        self._scans = self._lost = self._breaks = 0
        self._recent: deque[tuple[float, AnyArray]] = deque()
        self._decoder: Decoder | None = None
        self._step = 0.0

    def begin(self, driver: type[Driver], setup: Setup) -> None:
        """Show what is recorded; again after a break."""
        self._breaks += self._decoder is not None
        self._recent.clear()
        self._decoder = driver.decoder(len(setup.channels))
        self._step = setup.range_volts / 2 ** (driver.bits - 1)

    def update(self, elapsed_s: float, data: bytes) -> None:
        """Show further bytes, by `elapsed_s` of the recorder's clock."""
        if self._decoder is None or not self._stream.isatty():
            return
        scans = self._decoder.feed(data)
        self._scans += len(scans)
        self._lost += sum(loss.lost_scans for loss in scans.losses if loss.after_scan)
        if len(scans):
            self._recent.append((elapsed_s, scans.counts[:, 0]))
        while len(self._recent) > 1 and self._recent[0][0] < elapsed_s - _MEMORY_S:
            self._recent.popleft()
        if time.monotonic() - self._shown > _REFRESH_S:
            self._shown = time.monotonic()
            self._write(f"\r{self.text(elapsed_s)}\x1b[K")

    def text(self, elapsed_s: float) -> str:
        """The line without its control characters."""
        amplitude = 0.0
        if self._recent:
            recent = np.concatenate([counts for _, counts in self._recent])
            amplitude = 0.5 * self._step * float(int(recent.max()) - int(recent.min()))
        rate = self._scans / elapsed_s if elapsed_s > 0 else 0.0
        return (
            f"{elapsed_s:.1f} of {self._duration_s:g} s, {self._scans} scans, {rate:.1f} Hz, "
            f"amplitude {amplitude:.3f} V, {self._lost} lost"
            + (f", {self._breaks} break(s)" if self._breaks else "")
        )

    def end(self) -> None:
        """Close the display."""
        if self._shown:
            self._write("\n")

    def _write(self, text: str) -> None:
        """Show it, unless the terminal has gone: that must not end a recording."""
        with suppress(OSError):
            self._stream.write(text)
            self._stream.flush()
