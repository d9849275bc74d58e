"""Raw files: what was kept comes back, whatever happens to the recorder, its disk or the file."""

import io
import json
import os
import random
import signal
import struct
import time
import zlib
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any, cast

import numpy as np
import pytest
from benchmarks.acquisition import flip, recorded_bytes
from hypothesis import given, strategies as st

from pendpipe.acquisition.attempts import accept, choose, new_path, read_attempts, refuse_lost
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers.streams import Scans, plain_scans
from pendpipe.acquisition.line import LineLostError
from pendpipe.acquisition.raw import Frame, RawReader, RawWriter, append_event, lock, read_raw
from pendpipe.acquisition.recorder import ProgressLine, acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.recording import MISSING, SUSPECT, read_plain

# The raw file: repeatable, and good up to where it breaks off.

HEADER = {
    "model": "DI-154RS",
    "port": "COM3",
    "channels": [1],
    "rate_hz": 100.0,
    "recorded_at": "2026-01-01T00:00:00+00:00",
}


def written(*pieces: bytes, stopped: bool = True) -> bytes:
    """A raw recording with a piece every 10 ms."""
    stream = BytesIO()
    writer = RawWriter(stream, HEADER)
    for number, piece in enumerate(pieces):
        writer.data(0.01 * number, piece)
    if stopped:
        writer.event(0.01 * len(pieces), event="stopped", reason="time")
    return stream.getvalue()


@given(pieces=st.lists(st.binary(min_size=1, max_size=50), max_size=10))
def test_what_was_kept_comes_back(pieces: list[bytes]) -> None:
    raw = read_raw(written(*pieces))
    assert raw.data == b"".join(pieces)
    assert raw.arrived_bytes.tolist() == [
        len(b"".join(pieces[: number + 1])) for number in range(len(pieces))
    ]
    assert raw.event("stopped")["reason"] == "time"
    assert not raw.damaged_bytes
    assert not raw.holes


def test_a_frame_holds_a_second_at_most() -> None:
    """What comes at once after a pause is one arrival, in several frames."""
    stream = BytesIO()
    RawWriter(stream, HEADER, bytes_per_s=100).data(3.0, bytes(250))
    assert read_raw(stream.getvalue()).arrived_bytes.tolist() == [250]
    # One byte of the last frame wrong: the two before are there.
    content = bytearray(stream.getvalue())
    content[-1] ^= 1
    assert read_raw(bytes(content)).arrived_bytes.tolist() == [200]


@given(data=st.data())
def test_a_file_cut_anywhere_opens_with_all_whole_frames(data: st.DataObject) -> None:
    pieces = [bytes([number] * number) for number in range(1, 12)]
    whole = written(*pieces)
    begin = len(written(stopped=False))
    cut = data.draw(st.integers(begin, len(whole)))
    raw = read_raw(whole[:cut])
    assert b"".join(pieces).startswith(raw.data)
    frame = len(Frame(b"D", 0.0, b"").packed())
    size = [frame + len(piece) for piece in pieces]
    complete = sum(begin + sum(size[: number + 1]) <= cut for number in range(len(pieces)))
    assert len(raw.arrival_s) == complete
    short = decode_recording(written(b"\x00\x81" * 5, stopped=False))
    assert len(short) == 5
    assert any("cut short" in note for note in short.notes)


@given(place=st.integers(0, 10_000), mask=st.integers(1, 255))
def test_a_damaged_byte_costs_one_frame_at_most(place: int, mask: int) -> None:
    """Wherever it is: in the description, its copy, a frame's head or content."""
    pieces = [bytes([number, 0x81]) * 20 for number in range(0, 80, 8)]
    whole = written(*pieces)
    damaged = bytearray(whole)
    damaged[place % len(whole)] ^= mask
    raw = read_raw(bytes(damaged))
    assert raw.header == read_raw(whole).header
    assert raw.event("stopped")["reason"] == "time"
    assert raw.damaged_bytes > 0
    lost = [number for number, piece in enumerate(pieces) if piece not in raw.data]
    assert len(lost) <= 1
    assert raw.data == b"".join(p for number, p in enumerate(pieces) if number not in lost)
    assert [(hole.at_byte, hole.bytes_missing) for hole in raw.holes] == [
        (40 * number, 40) for number in lost
    ]


def test_a_changed_description_is_noticed() -> None:
    """In one place the other is believed; in both the file is refused."""
    whole = written(b"\x00\x81" * 20)
    assert whole.count(b'"rate_hz": 100.0') == 2
    changed = whole.replace(b'"rate_hz": 100.0', b'"rate_hz": 300.0', 1)
    assert read_raw(changed).header["rate_hz"] == 100.0
    assert any("damaged" in note for note in decode_recording(changed).notes)
    changed = whole.replace(b'"rate_hz": 100.0', b'"rate_hz": 300.0')
    with pytest.raises(InputError, match="the description of the recording is damaged"):
        read_raw(changed)


def test_files_of_version_1_are_still_read() -> None:
    """Frames without marks, a description without a check sum: up to the first damage."""
    content = json.dumps({"format": "pendpipe-raw", "version": 1, **HEADER}).encode() + b"\n"
    for number in range(3):
        body = bytes([8 * number, 0x81]) * 20
        check = zlib.crc32(body, zlib.crc32(struct.pack("<cId", b"D", len(body), 0.2 * number)))
        content += struct.pack("<cIdI", b"D", len(body), 0.2 * number, check) + body
    recording = decode_recording(content)
    assert len(recording) == 60
    assert recording.values[[0, 20, 40]].tolist() == [0.0, 20 / 4096, 40 / 4096]
    damaged = bytearray(content)
    damaged[-50] ^= 1
    assert len(decode_recording(bytes(damaged))) == 40


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["di154", "di2108"])
def test_damage_in_a_raw_file_costs_a_gap_and_shifts_nothing(kind: str) -> None:
    whole = recorded_bytes(kind)
    random = Random(1)
    for _ in range(40):
        outcome = flip(whole, random.randrange(8 * len(whole)))
        assert outcome.noticed
        assert outcome.frames_lost <= 1
        assert outcome.false_samples == 0


@pytest.mark.parametrize("content", [b"", b"time_s,volts\n", b"{}\n", b"\xff" * 100, b'{"a":1'])
def test_another_file_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.raw"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"other\.raw: this is not a raw recording"):
        read_raw(path)


def test_what_holds_no_such_scan_is_refused(tmp_path: Path) -> None:
    for source, channel, said in (
        (tmp_path / "nowhere.raw", None, "can't be read"),
        (written(), None, "no scan was recorded"),
        (written(b"\x00\x81"), 2, "channel 2 was not recorded"),
    ):
        with pytest.raises(InputError, match=said):
            decode_recording(source, channel)


def test_a_lost_scan_is_a_row_and_not_a_join() -> None:
    """Volts 0, (lost), 1 LSB: the time of the last is two intervals after the first."""
    recording = decode_recording(written(b"\x00\x81", b"\x81", b"\x08\x81"))
    assert recording.time_s.tolist() == [0.0, 0.01, 0.02]
    assert recording.quality.tolist() == [SUSPECT, MISSING, 0]
    assert recording.values[[0, 2]].tolist() == [0.0, 20 / 4096]
    assert any("1 scans lost at 1 places" in note for note in recording.notes)


@pytest.mark.parametrize("model", ["DI-2108", "DI-154RS"])
def test_frames_need_not_hold_whole_scans(model: str) -> None:
    """Two channels in pieces of seven bytes: behind any lost piece they are told apart."""
    codes = np.arange(200)[:, None] * [[1, -1]] + [[0, 0]]
    data = DEVICES["di2108" if model == "DI-2108" else "di154"]().encode(codes)
    stream = BytesIO()
    writer = RawWriter(stream, {**HEADER, "model": model, "channels": [1, 2]})
    for number, begin in enumerate(range(0, len(data), 7)):
        writer.data(0.0175 * number, data[begin : begin + 7])
    whole = stream.getvalue()
    sound = decode_recording(whole, channel=2)
    for begin in range(0, len(data) - 14, 7):
        damaged = bytearray(whole)
        damaged[whole.index(data[begin : begin + 7])] ^= 8
        recording = decode_recording(bytes(damaged), channel=2)
        assert len(recording) == len(sound)
        good = recording.usable
        assert 2 <= np.sum(~good) <= 3
        assert np.array_equal(recording.time_s, sound.time_s)
        assert np.array_equal(recording.values[good], sound.values[good])


# The recorder against the noise, a full disk, a killed process and a busy terminal.

resource = pytest.importorskip("resource", reason="this system has no limit on a file's size")


def slow(time_s: FloatArray) -> FloatArray:
    return np.asarray(5.0 * np.sin(0.02 * time_s))


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


def test_a_killed_recorder_leaves_a_recording_that_opens(tmp_path: Path, answer_of: Any) -> None:
    instants = random.Random(5)
    for number in range(2):
        raw, out = tmp_path / f"{number}.raw", tmp_path / f"{number}.csv"
        size = kill_a_recorder(raw, instants.uniform(0.0, 0.3))
        assert "cut short" in answer_of(["acquire", "--recover", str(raw), "--out", str(out)]).err
        kept = read_raw(raw)
        # Whatever had been written before is there, but for a frame half written.
        assert raw.stat().st_size - kept.damaged_bytes >= size - 5000
        recording = read_plain(out)
        assert np.abs(recording.values - slow(recording.time_s)).max() < 3e-4
    with pytest.raises(InputError, match="a raw recording is never overwritten"):
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


# Which of the kept attempts is used, and what is never taken for one.


def kept(folder: Path, minute: int, scans: int, reason: str | None) -> Path:
    """A raw file with so many scans, which ended for a reason or not at all."""
    header = {
        "model": "DI-2108",
        "port": "COM3",
        "channels": [1],
        "rate_hz": 100.0,
        "duration_s": 1.0,
        "recorded_at": f"2026-01-01T00:{minute:02}:00+00:00",
    }
    stream = BytesIO()
    writer = RawWriter(stream, header)
    for number in range(scans):
        writer.data(0.01 * number, b"\0\1")
    if reason:
        writer.event(1.0, event="stopped", reason=reason)
    path = new_path(f"{folder}/")
    path.write_bytes(stream.getvalue())
    return path


@pytest.mark.parametrize(
    ("attempts", "chosen"),
    [
        # The newest complete one; without one the longest.
        ([(100, "scans"), (100, "time"), (300, None), (300, "interrupted by the user")], 1),
        ([(20, None), (90, "the line was lost"), (50, None)], 1),
    ],
)
def test_the_best_attempt_is_used(
    attempts: list[tuple[int, str | None]], chosen: int, tmp_path: Path
) -> None:
    paths = [kept(tmp_path, minute, *attempt) for minute, attempt in enumerate(attempts)]
    assert choose(read_attempts(tmp_path.iterdir())).path == paths[chosen]


@pytest.mark.parametrize(
    ("events", "lost"),
    [
        ([("stopped", "scans")], ""),
        ([("stopped", "interrupted by the user")], ""),
        ([("stopped", "the line was lost")], "the line was lost"),
        ([("stopped", "the device fell silent")], "the device fell silent"),
        ([], ""),  # killed
        ([("broken", "the line was lost")], "the line was lost"),  # and killed while it waited
        ([("broken", "the line was lost"), ("restarted", "")], ""),
        ([("stopped", "the line was lost"), ("accepted", "")], ""),
    ],
)
def test_what_a_lost_line_has_ended_is_no_recording_unless_it_is_accepted(
    events: list[tuple[str, str]], lost: str, tmp_path: Path
) -> None:
    path = kept(tmp_path, 1, 20, None)
    for event, reason in events:
        append_event(path, event=event, reason=reason)
    assert read_raw(path).lost_line == lost


def test_a_lost_line_is_reported_with_what_is_kept_of_what_was_asked(tmp_path: Path) -> None:
    (attempt,) = read_attempts([kept(tmp_path, 1, 51, "the line was lost")])
    with pytest.raises(LineLostError, match=r"COM3: the line was lost; 0\.5 s of 1 s are kept in"):
        refuse_lost(attempt, "record anew")
    assert LineLostError.status == 1
    accept(attempt)
    refuse_lost(read_raw(attempt.path), "record anew")


def test_attempts_without_a_scan_do_not_count(tmp_path: Path) -> None:
    """A header alone, a part of one, an empty file; a damaged file beside a sound one."""
    kept(tmp_path, 1, 0, None)
    (tmp_path / "part.raw").write_bytes(kept(tmp_path, 2, 0, None).read_bytes()[:20])
    (tmp_path / "empty.raw").touch()
    assert read_attempts(tmp_path.iterdir()) == []
    (tmp_path / "damaged.raw").write_bytes(b"x" * 500)
    with pytest.raises(InputError, match=r"damaged\.raw: this is not a raw recording"):
        read_attempts(tmp_path.iterdir())
    (tmp_path / "worse.raw").write_bytes(b"y" * 500)
    with pytest.raises(InputError, match=r"damaged\.raw: "):  # the first by its name
        read_attempts(tmp_path.iterdir())
    sound = kept(tmp_path, 3, 10, None)
    assert [one.path for one in read_attempts(tmp_path.iterdir())] == [sound]


def test_what_is_being_recorded_is_left_alone(tmp_path: Path) -> None:
    """A recorder may outlive a Snakemake that was killed."""
    pytest.importorskip("fcntl", reason="this system has no such lock")
    path = kept(tmp_path, 1, 50, None)
    with path.open("ab") as recorder:
        assert lock(recorder)
        with pytest.raises(InputError, match="another process is recording into it"):
            read_attempts([path])
    assert len(read_attempts([path])) == 1


def test_a_clock_that_was_set_back_makes_no_attempt_the_older_one(tmp_path: Path) -> None:
    """The new one is newer by its name, whatever the clock says."""
    first = kept(tmp_path, 30, 100, "time")
    ahead = first.with_name(f"29991231T235959.999999Z{first.name[-13:]}")
    first.rename(ahead)
    second = kept(tmp_path, 0, 100, "time")
    assert choose(read_attempts(tmp_path.glob("*.raw"))).path == second


def test_a_file_that_grows_is_read_on_where_it_ended(tmp_path: Path) -> None:
    content = written(*(bytes([number]) * 7 for number in range(50)))
    growing, whole = tmp_path / "a.raw", read_raw(content)
    growing.write_bytes(content[:500])
    reader = RawReader(growing)
    for end in range(500, len(content), 97):
        growing.write_bytes(content[:end])
        assert whole.data.startswith(reader.read().data)
    growing.write_bytes(content)
    again = reader.read()
    assert again.data == whole.data
    assert again.arrived_bytes.tolist() == whole.arrived_bytes.tolist()
    assert (again.events, again.damaged_bytes) == (whole.events, 0)
