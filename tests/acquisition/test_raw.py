"""The raw file: repeatable, and good up to where it breaks off."""

import json
import struct
import zlib
from io import BytesIO
from pathlib import Path
from random import Random

import numpy as np
import pytest
from benchmarks.acquisition import flip, recorded_bytes
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.raw import Frame, RawWriter, read_raw
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
    with pytest.raises(InputError, match=r"other\.raw: this is no raw recording"):
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


def test_a_damaged_first_frame_moves_nothing() -> None:
    """Its scans are rows without a reading, and the others stay where they are."""
    whole = written(*(bytes([2 * code, 0x81]) for code in range(1, 9)))
    sound = decode_recording(whole)
    damaged = bytearray(whole)
    damaged[whole.index(b"\x02\x81")] ^= 8
    recording = decode_recording(bytes(damaged))
    assert recording.time_s.tolist() == sound.time_s.tolist()
    assert recording.quality.tolist() == [MISSING] + [0] * 7
    assert recording.values[1:].tolist() == sound.values[1:].tolist()
    assert any("1 scans are lost" in note for note in recording.notes)


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
