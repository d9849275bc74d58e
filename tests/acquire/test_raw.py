"""The raw file: repeatable, and good up to where it breaks off."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.acquire.decode import decode_recording
from pendpipe.acquire.raw import RawWriter, read_raw
from pendpipe.errors import InputError
from pendpipe.recording import MISSING, SUSPECT

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


@given(pieces=st.lists(st.binary(max_size=50), max_size=10))
def test_what_was_kept_comes_back(pieces: list[bytes]) -> None:
    raw = read_raw(written(*pieces))
    assert raw.data == b"".join(pieces)
    assert raw.arrived_bytes.tolist() == [
        len(b"".join(pieces[: number + 1])) for number in range(len(pieces))
    ]
    assert raw.event("stopped")["reason"] == "time"
    assert not raw.damaged_bytes


@given(data=st.data())
def test_a_file_cut_anywhere_opens_with_all_whole_frames(data: st.DataObject) -> None:
    pieces = [bytes([number] * number) for number in range(1, 12)]
    whole = written(*pieces)
    begin = whole.index(b"\n") + 1
    cut = data.draw(st.integers(begin, len(whole)))
    raw = read_raw(whole[:cut])
    assert b"".join(pieces).startswith(raw.data)
    size = [17 + len(piece) for piece in pieces]
    complete = sum(begin + sum(size[: number + 1]) <= cut for number in range(len(pieces)))
    assert len(raw.arrival_s) == complete


@given(place=st.integers(0, 10_000), mask=st.integers(1, 255))
def test_a_damaged_frame_is_never_believed(place: int, mask: int) -> None:
    whole = bytearray(written(b"\x00\x81" * 20, b"\x08\x81" * 20))
    begin = whole.index(b"\n") + 1
    at = begin + place % (len(whole) - begin)
    whole[at] ^= mask
    raw = read_raw(bytes(whole))
    assert (b"\x00\x81" * 20 + b"\x08\x81" * 20).startswith(raw.data)
    assert raw.damaged_bytes > 0


@pytest.mark.parametrize("content", [b"", b"time_s,volts\n", b"{}\n", b"\xff" * 100, b'{"a":1'])
def test_another_file_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.raw"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"other\.raw: this is no raw recording"):
        read_raw(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="can't be read"):
        decode_recording(tmp_path / "nowhere.raw")


def test_a_lost_scan_is_a_row_and_not_a_join() -> None:
    """Volts 0, (lost), 1 LSB: the time of the last is two intervals after the first."""
    recording = decode_recording(written(b"\x00\x81", b"\x81", b"\x08\x81"))
    assert recording.time_s.tolist() == [0.0, 0.01, 0.02]
    assert recording.quality is not None
    assert recording.quality.tolist() == [SUSPECT, MISSING, 0]
    assert recording.values[[0, 2]].tolist() == [0.0, 20 / 4096]
    assert any("1 scans lost at 1 places" in note for note in recording.notes)


def test_a_recording_cut_short_says_so() -> None:
    recording = decode_recording(written(b"\x00\x81" * 5, stopped=False))
    assert len(recording) == 5
    assert any("cut short" in note for note in recording.notes)


def test_nothing_recorded_is_refused() -> None:
    with pytest.raises(InputError, match="no scan was recorded"):
        decode_recording(written())


def test_a_channel_that_was_not_recorded_is_refused() -> None:
    with pytest.raises(InputError, match="channel 2 was not recorded"):
        decode_recording(written(b"\x00\x81"), channel=2)
