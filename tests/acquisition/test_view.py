"""The live page shows what is recorded, and nothing that happens to it costs a reading."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.raw import read_raw
from pendpipe.acquisition.recorder import acquire_simulated, example_signal
from pendpipe.acquisition.view import Shown
from pendpipe.recording import read_plain

SCALE = 20.0
"""Simulated seconds in a real one."""


class Recorder:
    """`pendpipe acquire --view` at work, for far longer than any test."""

    def __init__(self, folder: Path) -> None:
        self.out, self.raw = folder / "decay.csv", folder / "decay.raw"
        self.said = folder / "said.txt"
        words = ["acquire", "--device", "simulated:di2108", "--rate", "110", "--duration", "1e6"]
        words += ["--clock-scale", str(SCALE), "--view", "--raw", str(self.raw)]
        # A shell may have left SIGINT ignored to what runs behind it.
        code = (
            "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
            "from pendpipe.cli import main; sys.exit(main(sys.argv[1:]))"
        )
        with self.said.open("wb") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code, *words, "--out", str(self.out)],
                stderr=stream,
                env=os.environ | {"TMPDIR": str(folder)},  # what a killed view leaves
            )
        self.until(lambda: "http" in self.said.read_text())
        self.address = re.findall(r"http://[\d.:]+/\S+/", self.said.read_text())[0]
        children = psutil.Process(self.process.pid).children(recursive=True)
        (self.viewer,) = [each for each in children if "--live" in each.cmdline()]

    def until(self, met: Callable[[], bool]) -> None:
        """Wait for what the recorder does; if it ends before, that is the answer."""
        while not met():
            assert self.process.poll() is None, self.said.read_text()
            time.sleep(0.01)

    def data(self) -> dict[str, Any]:
        """What the page asks for."""
        with urllib.request.urlopen(f"{self.address}live") as answer:
            return dict(json.load(answer))

    def kept(self) -> int:
        """How many bytes off the wire the raw file holds."""
        return len(read_raw(self.raw).data)


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[Recorder]:
    if sys.platform == "win32":
        pytest.skip("signals end no process there as they do elsewhere")
    running = Recorder(tmp_path)
    yield running
    running.process.kill()
    running.process.wait()


@pytest.mark.slow
def test_nothing_that_happens_to_the_view_costs_a_scan(recorder: Recorder) -> None:
    """A browser that asks and takes no answer, a viewer that stands still, one that is killed."""
    recorder.until(lambda: recorder.data()["scans"] > 200)
    host, token = recorder.address.removeprefix("http://").split("/")[:2]
    port = int(host.partition(":")[2])
    with socket.create_connection(("127.0.0.1", port)) as deaf:
        deaf.sendall(f"GET /{token}/live HTTP/1.0\r\nHost: {host}\r\n\r\n".encode() * 50)
        for happens in (lambda: None, recorder.viewer.suspend, recorder.viewer.kill):
            happens()
            before = recorder.kept()
            recorder.until(lambda before=before: recorder.kept() > before + 5_000)
        recorder.process.send_signal(signal.SIGINT)
        assert recorder.process.wait() == 0, recorder.said.read_text()
    raw, recording = read_raw(recorder.raw), read_plain(recorder.out)
    assert raw.damaged_bytes == 0
    assert len(recording) == len(decode_recording(recorder.raw))
    assert bool(np.all(recording.usable)), "a gap"
    assert not recorder.viewer.is_running() or recorder.viewer.status() == psutil.STATUS_ZOMBIE


def test_the_page_is_for_this_machine_alone_and_ends_with_its_recorder(recorder: Recorder) -> None:
    """A page of the web that resolves its name to 127.0.0.1 gets nothing."""
    with urllib.request.urlopen(recorder.address) as answer:
        assert b"The last minute" in answer.read()
    own = recorder.address.split("/")[2]
    for host, path, status in (
        ("evil.example:80", "live", 403),
        ("127.0.0.1:1", "live", 403),
        (own, "etc/passwd", 404),
    ):
        asked = urllib.request.Request(recorder.address + path, headers={"Host": host})
        with pytest.raises(urllib.error.HTTPError) as fault:
            urllib.request.urlopen(asked)
        fault.value.close()
        assert fault.value.code == status
    os.kill(recorder.process.pid, signal.SIGKILL)
    recorder.process.wait()
    recorder.viewer.wait()
    assert not recorder.viewer.is_running()


def test_a_growing_file_is_shown_as_far_as_it_has_come(tmp_path: Path) -> None:
    """Wherever it ends: nothing, the half of a frame, all of it."""
    raw, growing = tmp_path / "whole.raw", tmp_path / "growing.raw"
    options = {"channels": (1,), "rate_hz": 110.0, "duration_s": 90.0, "raw_path": raw}
    acquire_simulated("di2108", example_signal(1, 3.85), clock_scale=200.0, **options)
    recording, content = decode_recording(raw), raw.read_bytes()
    page = Shown(growing)
    assert page.state() == {"scans": 0}
    growing.write_bytes(content[: len(content) // 2])
    half = page.state()
    assert 0.3 * len(recording) < half["scans"] < 0.7 * len(recording)
    assert half["reason"] == ""
    growing.write_bytes(content)
    whole = page.state()
    assert (whole["scans"], whole["lost"]) == (len(recording), 0)
    assert (whole["reason"], whole["duration_s"]) == ("scans", 90.0)
    time_s, volts = np.array(whole["last"]).T
    assert time_s[-1] - time_s[0] == pytest.approx(60.0, abs=0.1)
    recent = recording.values[-6600:]
    assert (volts.min(), volts.max()) == (recent.min(), recent.max()), "thinned, with all extremes"
    assert len(volts) <= 1200
    at, amplitude = np.array(whole["amplitude"])[0]
    assert amplitude == pytest.approx(0.5 * np.ptp(recording.values[: int(2 * at * 110)]), rel=0.02)


def test_where_nothing_is_recorded_there_is_nothing_to_view(
    answer_of: Any,
) -> None:
    assert answer_of(["acquire", "--view", "--serve", "di2108"], 2).err.startswith(
        "pendpipe: --view: it shows a recording in progress"
    )
