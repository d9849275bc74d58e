"""The recorder against the noise, a full disk, a killed process and a busy terminal."""

import errno
import io
import os
import random
import signal
import time
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.drivers.streams import Scans, plain_scans
from pendpipe.acquisition.raw import Frame, RawWriter, read_raw
from pendpipe.acquisition.recorder import ProgressLine, acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.recording import read_plain

resource = pytest.importorskip("resource", reason="this system has no limit on a file's size")


def slow(time_s: FloatArray) -> FloatArray:
    return np.asarray(5.0 * np.sin(0.02 * time_s))


class FullDisk:
    """Takes so many bytes and no more."""

    def __init__(self, room: int) -> None:
        self.content = b""
        self._room = room

    def flush(self) -> None:
        """Nothing is held back."""

    def write(self, data: bytes) -> int:
        piece = bytes(data[: self._room - len(self.content)])
        if not piece:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.content += piece
        return len(piece)


def test_a_full_disk_keeps_every_whole_frame() -> None:
    disk = FullDisk(1200)
    writer = RawWriter(disk, {"model": "DI-2108"})  # type: ignore[arg-type]
    pieces = [bytes([number]) * 20 for number in range(40)]
    with pytest.raises(OSError, match="No space left"):
        for number, piece in enumerate(pieces):
            writer.data(0.1 * number, piece)
    raw = read_raw(disk.content)
    assert b"".join(pieces).startswith(raw.data)
    described = len(disk.content) - len(disk.content.partition(b"\n")[2])
    frame = len(Frame(b"D", 0.0, b"").packed())
    # The description stands twice, the second time as a frame.
    assert len(raw.data) // 20 == (1200 - 2 * described + 1 - frame) // (frame + 20)


def test_a_full_file_system_is_one_line_and_what_was_kept_opens(tmp_path: Path) -> None:
    raw = tmp_path / "full.raw"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(InputError, match=r"can't be written .*--recover") as caught:
            acquire_simulated("di2108", slow, rate_hz=1e3, duration_s=60.0, raw_path=raw)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    assert str(caught.value).startswith(str(raw))
    recording = decode_recording(raw)
    assert len(recording) > 8000
    assert np.abs(recording.values - slow(recording.time_s)).max() < 3e-4


def kill_a_recorder(raw: Path, after_s: float) -> int:
    """Record in a process of its own, kill it, and return the size the file had before."""
    process = os.fork()
    if not process:
        try:
            acquire_simulated(
                "di2108", slow, rate_hz=1e3, duration_s=1e6, clock_scale=50.0, raw_path=raw
            )
        finally:
            os._exit(1)
    while not raw.exists() or raw.stat().st_size < 1000:
        time.sleep(0.005)
    time.sleep(after_s)
    size = raw.stat().st_size
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return size


def test_a_killed_recorder_leaves_a_recording_that_opens(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    instants = random.Random(5)
    for number in range(2):
        raw, out = tmp_path / f"{number}.raw", tmp_path / f"{number}.csv"
        size = kill_a_recorder(raw, instants.uniform(0.0, 0.3))
        assert main(["acquire", "--recover", str(raw), "--out", str(out)]) == 0
        assert "cut short" in capsys.readouterr().err
        kept = read_raw(raw)
        # Whatever had been written before is there, but for a frame half written.
        assert raw.stat().st_size - kept.damaged_bytes >= size - 5000
        recording = read_plain(out)
        assert np.abs(recording.values - slow(recording.time_s)).max() < 3e-4
    with pytest.raises(InputError, match="no raw recording is overwritten"):
        acquire_simulated("di2108", slow, rate_hz=60.0, duration_s=1.0, raw_path=raw)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Session:
    """A DI-2108 of one channel, +-10 V."""

    step_volts = 10.0 / 32768

    def decode(self, data: bytes) -> Scans:
        return plain_scans(data, 1)


def test_the_progress_line_tells_amplitude_losses_and_breaks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pendpipe.acquisition.recorder._REFRESH_S", -1.0)
    terminal = Terminal()
    line, session = ProgressLine(terminal, 60.0), cast("Any", Session())
    line.end()
    assert terminal.getvalue() == ""
    line.add(1.0, np.array([16384, -16384], dtype="<i2").tobytes(), session)
    line.interrupt()
    line.add(1.5, np.array([3277, -3277], dtype="<i2").tobytes(), session)
    text = line.text(2.0)
    assert "2.0 of 60 s, 4 scans, 2.0 Hz" in text
    assert "amplitude 1.000 V" in text
    assert text.endswith("0 lost, 1 break(s)")
    line.end()
    assert terminal.getvalue().endswith("\n")
