"""A page that shows a recording while it is made: the last minute, the amplitude, the time left.

It is a process of its own that opens nothing but the raw file, and that for reading: closed, slow,
stopped or killed, it can't keep the recorder from anything. It ends with the recorder, whose
end of a pipe then closes, however the recorder ended.
"""

import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.raw import parse_header, whole_frames
from pendpipe.arrays import FloatArray
from pendpipe.templates import render

_LAST_S: Final = 60.0
_COLUMNS: Final = 600
"""Most extremes that the last minute is drawn by."""
_STRETCHES: Final = 200
_SHORTEST_STRETCH_S: Final = 5.0
"""Amplitudes are half the range of a stretch: a 200th of the recording, and no less than that."""


@contextmanager
def shown(raw: Path) -> Iterator[None]:
    """Show a recording that is being made; its page's address goes to standard error."""
    viewer = subprocess.Popen(
        [sys.executable, "-m", "pendpipe.acquisition.view", str(raw)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is the recorder's
    )
    try:
        yield
    finally:
        with suppress(OSError, subprocess.TimeoutExpired):
            viewer.communicate(timeout=2.0)
        if viewer.poll() is None:  # stopped, or at a loss
            viewer.kill()
            viewer.wait()


class Follower:
    """What a growing raw file holds so far.

    Parameters
    ----------
    path
        The file; it need not be there yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0
        self._rest = b""
        self._header: dict[str, Any] = {}
        self._elapsed_s, self._scans, self._lost, self._reason = 0.0, 0, 0, ""
        self._time_s, self._volts = np.empty(0), np.empty(0)
        self._low: dict[int, float] = {}
        self._high: dict[int, float] = {}

    def read(self) -> None:
        """Take in what was appended since the last time."""
        with suppress(FileNotFoundError), self._path.open("rb") as stream:
            stream.seek(self._read)
            new = stream.read()
            self._read += len(new)
            self._rest += new
        if not self._header:
            line, feed, rest = self._rest.partition(b"\n")
            if not feed:
                return
            self._header, self._rest = parse_header(line), rest
            self._start()
        frames, end = whole_frames(self._rest)
        self._rest = self._rest[end:]
        for frame in frames:
            self._elapsed_s = frame.time_s
            if frame.kind == b"D":
                self._take(frame.content)
            elif frame.kind == b"E":
                event = json.loads(frame.content)
                if event.get("event") == "restarted":
                    self._start()
                self._reason = str(event.get("reason") or "")

    def _start(self) -> None:
        """A device counts anew after each start."""
        driver = find_driver(self._header["model"])
        self._decoder = driver.decoder(len(self._header["channels"]))
        self._step = self._header["range_volts"] / 2 ** (driver.bits - 1)
        self._begin = self._elapsed_s, self._scans + self._lost

    def _take(self, content: bytes) -> None:
        scans = self._decoder.feed(content)
        count = len(scans.counts)
        self._scans += count
        self._lost += sum(loss.lost_scans for loss in scans.losses if loss.after_scan)
        if not count:
            return
        first = self._scans - count - self._begin[1] + self._lost
        time_s = self._begin[0] + (first + np.arange(count)) / self._header["rate_hz"]
        volts = self._step * scans.counts[:, 0].astype(np.float64)
        stretch = (time_s / self.stretch_s).astype(int)
        for number in range(int(stretch[0]), int(stretch[-1]) + 1):
            if len(part := volts[stretch == number]):
                self._low[number] = min(self._low.get(number, np.inf), float(part.min()))
                self._high[number] = max(self._high.get(number, -np.inf), float(part.max()))
        time_s, volts = np.append(self._time_s, time_s), np.append(self._volts, volts)
        recent = time_s > time_s[-1] - _LAST_S
        self._time_s, self._volts = time_s[recent], volts[recent]

    @property
    def stretch_s(self) -> float:
        """Length of a stretch of which the amplitude is drawn."""
        return max(_SHORTEST_STRETCH_S, float(self._header["duration_s"]) / _STRETCHES)

    def state(self) -> dict[str, Any]:
        """Return what the page draws: times in s, readings in V."""
        if not self._header:
            return {"scans": 0}
        whole = [n for n in self._low if (n + 1) * self.stretch_s <= self._elapsed_s]
        return {
            "elapsed_s": self._elapsed_s,
            "duration_s": self._header["duration_s"],
            "model": self._header["model"],
            "scans": self._scans,
            "lost": self._lost,
            "bytes": self._read,
            "reason": self._reason,
            "last": thinned(self._time_s, self._volts),
            "amplitude": [
                ((n + 0.5) * self.stretch_s, 0.5 * (self._high[n] - self._low[n])) for n in whole
            ],
        }


def thinned(time_s: FloatArray, values: FloatArray) -> list[tuple[float, float]]:
    """Return points that look like all: of many the least and the largest of a few each."""
    each = -(-len(values) // _COLUMNS)
    if each > 2:
        starts = np.arange(0, len(values), each)
        parts = zip(starts.tolist(), [*starts[1:].tolist(), len(values)], strict=True)
        keep = [{a + int(values[a:b].argmin()), a + int(values[a:b].argmax())} for a, b in parts]
        index = sorted(set[int]().union(*keep))
        time_s, values = time_s[index], values[index]
    return list(zip(time_s.tolist(), values.tolist(), strict=True))


class _Handler(BaseHTTPRequestHandler):
    follower: Follower
    page: bytes
    lock = threading.Lock()

    def do_GET(self) -> None:
        """Answer a browser of this machine."""
        host = self.headers.get("Host", "").rpartition(":")[0]
        if host not in ("127.0.0.1", "localhost") or self.path not in ("/", "/data"):
            self.send_error(404)
            return
        kind, content = "text/html; charset=utf-8", self.page
        if self.path == "/data":
            with self.lock:
                self.follower.read()
                state = self.follower.state()
            kind, content = "application/json", json.dumps(state).encode()
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Say nothing: the terminal is the recorder's."""


def main(raw: str) -> None:
    """Serve the page of a raw file until standard input ends."""
    _Handler.follower = Follower(Path(raw))
    _Handler.page = render("pendpipe.acquisition", "view.html", file=Path(raw).name).encode()
    with ThreadingHTTPServer(("127.0.0.1", 0), _Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_address[1]}/"
        print(f"pendpipe: the recording is shown at {address}", file=sys.stderr, flush=True)
        sys.stdin.read()
        server.shutdown()


if __name__ == "__main__":
    main(sys.argv[1])
