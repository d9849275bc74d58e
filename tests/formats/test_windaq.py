"""WinDaq files, byte by byte: read and written."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from numpy.typing import NDArray

from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.formats import ReadOptions, inspect, read
from pendpipe.formats.windaq import Channel, Event, pack
from pendpipe.formats.writing import write
from pendpipe.recording import GOOD, MISSING, SUSPECT, Recording, read_plain, write_plain

from .cases import WindaqFile, swing

# WinDaq's bytes, put together by the format's description, are read back exactly.

COUNTS = np.rint(swing(2000, 250.0)[1] * 8000).astype(np.int64)[:, None]
TWO = np.hstack([COUNTS, np.roll(COUNTS, 100)])


def written(path: Path, content: WindaqFile) -> Path:
    path.write_bytes(content.pack())
    return path


STEP_V = 10 / 16384
PLAIN = WindaqFile(TWO, intercept=0.25)
HIRES = WindaqFile(4 * COUNTS + 1, hires=True)
CIRCULAR = WindaqFile(
    np.roll(TWO, 700, axis=0), hires=True, header_size=1536, state=2, next_write=700
)
PACKED = WindaqFile(TWO, divisors=[1, 4])
"""As documented, no such file being at hand: a channel is in the scans its divisor divides."""
FULL = np.clip(3 * COUNTS, -8192, 8191)


def of_channel(path: Path, channel: str) -> Recording:
    return read(path, ReadOptions(channel=channel))


@pytest.mark.parametrize(
    ("content", "asked", "expected"),
    [
        (PLAIN, lambda path: of_channel(path, "1").values, TWO[:, 0] * STEP_V + 0.25),
        (PLAIN, lambda path: of_channel(path, "2").values, TWO[:, 1] * STEP_V + 0.25),
        (PLAIN, lambda path: read(path).quantity, "volts"),
        (PLAIN, lambda path: read(path).resolution, STEP_V),
        (PLAIN, lambda path: read(path).time_s, np.arange(2000) * 0.004),
        (WindaqFile(COUNTS, unit=b"deg"), lambda path: read(path).quantity, "angle_rad"),
        (HIRES, lambda path: read(path).values, (4 * COUNTS[:, 0] + 1) / 4 * STEP_V),
        (HIRES, lambda path: inspect(path).format, "windaq-hires"),
        (CIRCULAR, lambda path: read(path).values, TWO[:, 0] / 4 * STEP_V),
        (CIRCULAR, lambda path: inspect(path).format, "windaq-hires-circular"),
        (PACKED, lambda path: of_channel(path, "2").values, TWO[::4, 1] * STEP_V),
        (PACKED, lambda path: of_channel(path, "2").time_s, np.arange(500) * 0.016),
        (PACKED, lambda path: len(of_channel(path, "1")), 2000),
        (
            WindaqFile(TWO, hires=True, events=[0, 0, -1000]),
            lambda path: inspect(path).markers[1].sample,
            500,
        ),
        (
            WindaqFile(COUNTS, interval_s=-1.2e-41),
            lambda path: read(path, ReadOptions(sample_rate=250)).time_s[1],
            0.004,
        ),
        (
            WindaqFile(FULL),
            lambda path: inspect(path).clipped_samples,
            np.count_nonzero((FULL == -8192) | (FULL == 8191)),
        ),
        (
            WindaqFile(COUNTS, events=[0, 0, len(COUNTS), 99]),
            lambda path: inspect(path).markers[-1].time_s,
            0.004 * (len(COUNTS) - 1),
        ),
    ],
    ids=[
        *("14 bits, shifted and scaled", "14 bits, second channel", "volts", "step", "times"),
        *("the unit of the header", "two low bits of HiRes", "HiRes", "the oldest sample first"),
        *("circular", "packed: every fourth scan", "packed: at its own rate", "packed: all scans"),
        *("pointers of HiRes count samples", "the user's rate beside a damaged interval"),
        *("samples at the converter's end", "an event behind the last sample"),
    ],
)
def test_a_file_says(
    tmp_path: Path, content: WindaqFile, asked: Callable[[Path], object], expected: object
) -> None:
    assert asked(written(tmp_path / "a.WDQ", content)) == pytest.approx(expected)


def test_markers_carry_their_comments(tmp_path: Path) -> None:
    texts = [b"Angle", b"Level"]
    offset = sum(len(text) + 1 for text in texts)
    events = [0, 0, -500, 1200, 4, (offset | 1 << 31) - (1 << 32)]
    content = WindaqFile(TWO, events=events, annotations=texts, comments=b"released\0")
    found = inspect(written(tmp_path / "a.WDQ", content))
    assert [channel[0] for channel in found.channels] == ["Angle", "Level"]
    assert [(mark.sample, mark.comment) for mark in found.markers] == [
        (0, ""),
        (500, ""),
        (1200, "released"),
    ]


def test_a_pause_is_a_gap_and_nothing_else_is(tmp_path: Path) -> None:
    # Scan 1000 stands 4 s after the start by the samples, and 60 s by its stamp.
    path = written(
        tmp_path / "a.WDQ", WindaqFile(COUNTS, events=[0, 0, 500, 2, 1000, 60, 1500, 62])
    )
    found = inspect(path)
    assert [(gap.after_sample, gap.missing_s) for gap in found.gaps] == [(999, pytest.approx(56.0))]
    time = read(path).time_s
    assert time[1000] == pytest.approx(60.0)
    assert time[-1] == pytest.approx(60.0 + 999 * 0.004)


def test_the_units_of_the_header_are_kept(tmp_path: Path) -> None:
    path = written(tmp_path / "b.WDQ", WindaqFile(COUNTS, unit=b"rpm"))
    assert inspect(path).channels == (("channel 1", "rpm"),)
    with pytest.raises(InputError, match="no column looks like"):
        read(path)
    assert read(path, ReadOptions(channel="1", unit="V")).quantity == "volts"


@pytest.mark.parametrize("size", [8000 | 1 << 28, 8000 | 1 << 20 | 1 << 14, 0xFFFF_FFFF, 0])
def test_a_damaged_data_size_is_mended_from_the_trailers(tmp_path: Path, size: int) -> None:
    events = [0, 0, -500, -1200]
    texts = [b"Angle", b"Level"]
    content = WindaqFile(TWO, events=events, annotations=texts, data_bytes=size)
    found = inspect(written(tmp_path / "a.WDQ", content))
    assert found.samples == 2000
    assert [mark.sample for mark in found.markers] == [0, 500, 1200]
    assert any("repaired to 2000 scans" in warning for warning in found.warnings)


def test_a_file_that_is_cut_short_gives_its_whole_scans(tmp_path: Path) -> None:
    path = tmp_path / "a.WDQ"
    path.write_bytes(WindaqFile(TWO).pack()[: 1156 + 4 * 700 + 3])
    recording = read(path)
    np.testing.assert_allclose(recording.values, TWO[:700, 0] * 10 / 16384)
    assert any("700 whole scans" in n and "3 byte(s)" in n for n in recording.notes)


@pytest.mark.parametrize(
    ("at", "junk", "said", "lost"),
    [
        (1154, b"\0\0", "0x8001", True),
        (28, b"\0" * 8, "sample interval 0 s", True),
        (28, b"\xff" * 8, "sample interval nan s", True),
        (0, b"\0\0", "0 channels", True),
        (118, b"\xff" * 8, "scale of channel 1", True),
        (6, b"\xff\x7f", "", False),  # the header is found by its mark
        (44, b"\0\0\0\0", "compression of the display (0)", False),
        (12, b"\xff\xff\xff\x7f", "list of events is damaged", False),
        (16, b"\xff\xff", "size of the annotations (65535)", False),
    ],
)
def test_damage_of_the_header_is_reported_and_refused_if_it_costs_samples(
    tmp_path: Path, at: int, junk: bytes, said: str, lost: bool
) -> None:
    damaged = bytearray(WindaqFile(COUNTS).pack())
    damaged[at : at + len(junk)] = junk
    path = tmp_path / "a.WDQ"
    path.write_bytes(bytes(damaged))
    if lost:
        with pytest.raises(InputError, match=said):
            read(path)
        return
    assert len(read(path)) == 2000
    assert any(said in note for note in read(path).notes)


def test_a_spreadsheet_export_goes_by_place_and_index(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    head = "Relative Time,Date,Time Stamp UTC,Volt,Volt,Chn 1 Events\n"
    volts = TWO * 10 / 8192
    rows = []
    for row in range(1000):
        clock = 34 + row // 360 + (20 if row >= 700 else 0)
        event = "Resume" if row == 700 else ""
        rows.append(
            f"{round(row / 360, 6)},7/27/2026,2:{45 + clock // 60}:{clock % 60:02d} PM,"
            f"{volts[row, 0]:.9f},{volts[row, 1]:.9f},{event}\n"
        )
    path.write_text(head + "".join(rows))
    recording = read(path, ReadOptions(channel="2"))
    np.testing.assert_allclose(recording.values, volts[:1000, 1], atol=1e-9)
    np.testing.assert_allclose(np.diff(recording.time_s[:700]), 1 / 360, atol=1e-12)
    found = inspect(path)
    assert found.format == "windaq-csv"
    assert [gap.after_sample for gap in found.gaps] == [699]
    assert found.gaps[0].missing_s == pytest.approx(20.0, abs=1.0)
    assert found.markers[0].comment == "Resume"


def test_a_di149_capture_is_scaled_and_timed(tmp_path: Path) -> None:
    path = tmp_path / "a.cso"
    path.write_text("1376398772.89\nstart\n" + "sc 12 -2048\nsc 1024 20\n" * 20 + "stop\n")
    recording = read(path, ReadOptions(channel="1"))
    np.testing.assert_allclose(recording.values[:2], [0.05859375, 5.0])
    assert recording.time_s[1] == pytest.approx(65535 / 750_000)
    assert any("does not give its srate" in note for note in recording.notes)
    assert read(path, ReadOptions(channel="2")).values[0] == -10.0
    path.write_text("srate 300\nstart\n" + "sc 1\nsc 2\n" * 20 + "stop\n")
    assert read(path).time_s[1] == pytest.approx(300 / 750_000)


def test_a_spoilt_scan_of_a_capture_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.cso"
    path.write_text("start\nsc 1 2\nsc 3\nsc 4 5\nstop\n")
    with pytest.raises(InputError, match="line 3: 'sc 3' is not a complete scan"):
        read(path)


# What is written for WinDaq has the bytes of its description, and is read back exactly.


def volts(
    codes: NDArray[np.int64], bits: int = 16, rate_hz: float = 100.0, range_volts: float = 10.0
) -> Recording:
    """A recording as ``pendpipe acquire`` makes it."""
    step = range_volts / 2 ** (bits - 1)
    return Recording(
        time_s=np.arange(len(codes)) / rate_hz,
        values=codes * step,
        quantity="volts",
        metadata={
            "bits": str(bits),
            "range_volts": repr(range_volts),
            "recorded_at": "2026-11-21T06:52:29+00:00",
            "channel": "2",
            "model": "DI-2108",
        },
        resolution=step,
    )


SWING = np.rint(swing(1500, 100.0)[1] * 30000).astype(np.int64)


def test_the_worked_bytes_of_a_header() -> None:
    # dataq-facts B1, B2: two scans of two channels, 250 Hz, +-10 V, an event with a comment.
    channels = [
        Channel(1, 10 / 8192, 0.0, "Volt", 10.0, "Angle"),
        Channel(4, 5 / 8192, -1.5, "degree", 5.0),
    ]
    counts = np.array([[1, -2], [32767, -32768]])
    data = pack(
        counts,
        channels,
        0.004,
        opened=1_700_000_000,
        closed=1_700_000_001,
        events=[Event(1, 9, "hit")],
    )
    expected = {
        0: b"\x02\x00",
        4: b"\x6e\x24\x84\x04",  # 110, 36, 1156
        8: b"\x08\x00\x00\x00",  # data bytes
        12: b"\x14\x00\x00\x00",  # five numbers of events
        16: b"\x07\x00",  # "Angle\0" and "\0"
        28: bytes.fromhex("fc a9 f1 d2 4d 62 70 3f"),  # as in the vendor's SAMPLE.WDQ
        36: struct.pack("<ii", 1_700_000_000, 1_700_000_001),
        44: b"\x01\x00\x00\x00",
        68: bytes(range(32)),
        100: b"\x02\x00",  # HiRes, not packed
        118: bytes.fromhex("00 00 00 00 00 00 54 3f"),  # 10/8192
        134: b"Volt\0\0",
        142: b"\x01\x10",  # channel 1, 10 000 mV, gain 1
        154: struct.pack("<dd", 5 / 8192, -1.5),
        170: b"degre\0",
        178: b"\x04\x00",  # channel 4, 5000 mV, gain 1
        1154: b"\x01\x80",
        1156: bytes.fromhex("01 00 fe ff ff 7f 00 80"),
        # Start; the pointer counts samples (scan 1 of two channels); its stamp; its comment.
        1164: struct.pack("<iiiiI", 0, 0, 2, 9, 0x8000_0007),
        1184: b"Angle\0\0hit\0",
    }
    assert {at: data[at : at + len(part)] for at, part in expected.items()} == expected
    assert len(data) == 1184 + len(expected[1184])
    assert data[65] >> 6 == 0


@pytest.mark.parametrize(
    ("range_volts", "code"),
    [
        (10.0, 0x10),  # 10 000 mV, gain 1
        (5.0, 0x00),  # 5000 mV, gain 1
        (2.5, 0x01),  # 5000 mV, gain 2
        (0.1, 0x04),  # 5000 mV, gain 50
        (1.0, 0x02),  # 5000 mV, gain 5
        (0.5, 0x03),  # 5000 mV, gain 10
        (0.05, 0x05),  # 5000 mV, gain 100
        (0.01, 0x06),  # 5000 mV, gain 500
        (0.005, 0x07),  # 5000 mV, gain 1000
        (1.25, 0x08),  # 5000 mV, gain 4
        (0.625, 0x09),  # 5000 mV, gain 8
        (0.25, 0x0A),  # 5000 mV, gain 20
        (0.025, 0x0B),  # 5000 mV, gain 200
        (0.0005, 0x0C),  # 5000 mV, gain 10 000
        (0.00005, 0x0D),  # 5000 mV, gain 100 000
        (0.125, 0x0E),  # 5000 mV, gain 40
        (0.0625, 0x0F),  # 5000 mV, gain 80
        (0.256, 0x39),  # 2048 mV, gain 8
        (0.16, 0x49),  # 1280 mV, gain 8
        (100.0, 0x52),  # 500 000 mV, gain 5
        (1000.0, 0x60),  # 1 000 000 mV, gain 1
        (7.3, 0x10),  # what no code says is left at 10 V
        (None, 0x10),
    ],
)
def test_the_gain_code_is_that_of_the_range(range_volts: float | None, code: int) -> None:
    channel = Channel(1, 1.0, 0.0, "V", range_volts)
    assert pack(np.zeros((1, 1), dtype=np.int64), [channel], 1.0)[143] == code


@pytest.mark.parametrize(("bits", "range_volts"), [(16, 10.0), (14, 50.0), (12, 10.0), (16, 0.2)])
def test_every_code_of_a_converter_comes_back_exactly(
    tmp_path: Path, bits: int, range_volts: float
) -> None:
    half = 2 ** (bits - 1)
    codes = np.concatenate([np.arange(-half, half, max(1, half // 1000)), [-half, half - 1, 0]])
    recording = volts(codes, bits, range_volts=range_volts)
    path = tmp_path / "a.wdh"
    assert write(path, recording) == ()
    again = read(path)
    assert np.array_equal(again.values, recording.values)
    assert again.resolution == pytest.approx(recording.resolution)
    assert inspect(path).clipped_samples == np.sum((codes == -half) | (codes == half - 1))
    np.testing.assert_allclose(again.time_s, recording.time_s, rtol=1e-12)
    assert again.metadata["recorded_at"] == "2026-11-21T06:52:29+00:00"


def test_a_day_counted_in_seconds_since_1970_is_kept(tmp_path: Path) -> None:
    recording = volts(SWING)
    recording.metadata["recorded_at"] = "1795243949.250000 s since 1970"
    write(tmp_path / "a.wdh", recording)
    assert read(tmp_path / "a.wdh").metadata["recorded_at"].startswith("2026-11-21T06:52:29")


def test_a_pause_is_given_by_a_stamp_and_exactly_by_a_comment(tmp_path: Path) -> None:
    recording = volts(SWING)
    time_s = recording.time_s.copy()
    time_s[600:] += 113.25
    time_s[1000:] += 0.35
    quality = np.full(len(time_s), GOOD, dtype=np.uint8)
    paused = Recording(time_s, recording.values, "volts", quality, recording.metadata)
    path = tmp_path / "a.wdh"
    assert any("2 gap(s) of 113.6 s" in note for note in write(path, paused))
    marks = [(mark.sample, mark.comment) for mark in inspect(path).markers]
    assert marks == [(0, ""), (600, "gap 113.250000000 s"), (1000, "gap 0.350000000 s")]
    # Of an event the pointer is followed by whole seconds since the opening.
    stamps = np.frombuffer(path.read_bytes()[1156 + 2 * len(SWING) :][:40], "<i4")
    assert [stamps[at + 1] for at in (2, 5)] == [119, 124]
    again = read(path)
    np.testing.assert_allclose(again.time_s, time_s, atol=1e-9)
    assert [gap.after_sample for gap in inspect(path).gaps] == [599, 999]


def test_a_strangers_stamp_overrules_a_comment_that_disagrees(tmp_path: Path) -> None:
    data = pack(
        SWING[:, None],
        [Channel(1, 10 / 8192, 0.0, "Volt")],
        0.01,
        events=[Event(500, 5, "gap 7.000000000 s"), Event(900, 60)],
    )
    path = tmp_path / "a.wdh"
    path.write_bytes(data)
    assert [gap.after_sample for gap in inspect(path).gaps] == [899]


def test_missing_rows_become_a_pause_and_suspect_ones_a_marker(tmp_path: Path) -> None:
    whole = volts(SWING)
    quality = np.full(len(whole), GOOD, dtype=np.uint8)
    quality[700:735] = MISSING
    quality[[90, 91, 400]] = SUSPECT
    values = np.where(quality == MISSING, np.nan, whole.values)
    holed = Recording(whole.time_s, values, "volts", quality, whole.metadata)
    path = tmp_path / "a.wdh"
    write(path, holed)
    again = read(path)
    np.testing.assert_allclose(again.time_s, whole.time_s[quality != MISSING], atol=1e-9)
    assert np.array_equal(again.values, whole.values[quality != MISSING])
    found = inspect(path)
    assert [(mark.sample, mark.comment) for mark in found.markers] == [
        (0, ""),
        (90, "suspect"),
        (400, "suspect"),
        (700, "gap 0.350000000 s"),
    ]


def test_an_encoders_angles_keep_their_steps(tmp_path: Path) -> None:
    step = 2 * np.pi / 2400
    angle = np.rint(swing(900, 100.0)[1] / step) * step
    recording = Recording(np.arange(900) / 100, angle, "angle_rad", resolution=step)
    path = tmp_path / "a.wdh"
    assert write(path, recording) == ()
    again = read(path)
    np.testing.assert_allclose(again.values, angle, atol=1e-12)
    assert again.quantity == "angle_rad"
    assert again.resolution == pytest.approx(step)


def test_smooth_readings_are_rounded_and_it_is_said(tmp_path: Path) -> None:
    time_s, angle = swing(900, 100.0)
    path = tmp_path / "a.wdh"
    recording = Recording(
        time_s + 12.8, angle, "displacement_m", metadata={"volts_per_radian": "2"}
    )
    said = " | ".join(write(path, recording))
    assert "rounded to the .WDH's 16 bits" in said
    assert "no place for volts_per_radian (2)" in said
    assert "12.8 s here" in said
    again = read(path)
    assert np.abs(again.values - angle).max() <= 0.51 * np.ptp(angle) / 65534
    assert again.time_s[0] == 0.0


def test_uneven_times_are_refused(tmp_path: Path) -> None:
    time_s, angle = swing(900, 100.0)
    uneven = time_s + 0.004 * np.sin(np.arange(900))
    with pytest.raises(InputError, match="not evenly spaced"):
        write(tmp_path / "a.wdh", Recording(uneven, angle, "angle_rad"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["out.WDQ", "out.whc", "out.mat", "out.xlsx"])
def test_a_form_that_is_only_read_is_refused_before_anything_is_done(
    name: str, tmp_path: Path, answer_of: Any
) -> None:
    assert (
        "this format can be read, not written"
        in answer_of(["convert", str(tmp_path / "nowhere.csv"), str(tmp_path / name)], 2).err
    )
    call = ["acquire", "--device", "simulated:di2108", "--out", str(tmp_path / name)]
    assert "this format can be read, not written" in answer_of(call, 2).err


def test_convert_there_and_back(tmp_path: Path, answer_of: Any) -> None:
    first, windaq, last = tmp_path / "a.csv", tmp_path / "a.WDH", tmp_path / "b.csv"
    marked = {**volts(SWING).metadata, "marker_1": "250; 2.5 s; released"}
    write_plain(first, Recording(volts(SWING).time_s, volts(SWING).values, "volts", None, marked))
    assert main(["convert", str(first), str(windaq)]) == 0
    assert "1500 samples" in answer_of(["convert", str(windaq), str(last)]).out
    assert np.array_equal(read_plain(last).values, read_plain(first).values)
    assert [(m.sample, m.comment) for m in inspect(last).markers] == [(0, ""), (250, "released")]


def test_a_recording_straight_to_windaq(tmp_path: Path) -> None:
    out = tmp_path / "decay.wdh"
    call = "acquire --device simulated:di4108 --rate 100 --samples 400 --range-volts 1.5"
    assert main([*call.split(), "--clock-scale", "20", "--out", str(out)]) == 0
    assert inspect(out).format == "windaq-hires"
    assert len(read(out)) == 400
    again = tmp_path / "again.wdh"
    assert main(["acquire", "--recover", str(tmp_path / "decay.raw"), "--out", str(again)]) == 0
    assert again.read_bytes()[1156:] == out.read_bytes()[1156:]


@settings(max_examples=60)
@given(
    noise=st.lists(st.integers(-99, 99), min_size=1, max_size=60),
    gaps=st.dictionaries(st.integers(1, 59), st.floats(0.1, 1e4), max_size=3),
    rate_hz=st.floats(0.01, 1e5),
    range_volts=st.floats(1e-3, 1e3),
)
def test_any_recording_there_and_back(
    tmp_path_factory: pytest.TempPathFactory,
    noise: list[int],
    gaps: dict[int, float],
    rate_hz: float,
    range_volts: float,
) -> None:
    # A reading far beside its neighbours would stand for a lost one.
    codes = SWING[: len(noise)] + noise
    # Where every second step is a gap nobody can say what the interval is.
    assume(2 * sum(at < len(codes) for at in gaps) < len(codes) - 1 or not gaps)
    folder = tmp_path_factory.getbasetemp()
    recording = volts(codes, rate_hz=rate_hz, range_volts=range_volts)
    time_s = recording.time_s.copy()
    for at, intervals in gaps.items():
        time_s[at:] += (1.0 + intervals) / rate_hz
    gapped = Recording(time_s, recording.values, "volts", None, recording.metadata)
    path = folder / "a.wdh"
    write(path, gapped)
    again = read(path, ReadOptions(channel="1", unit="V"))
    np.testing.assert_allclose(again.values, recording.values, rtol=1e-12, atol=0)
    assert again.time_s == pytest.approx(time_s, rel=1e-6, abs=1e-6)
