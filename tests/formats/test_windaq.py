"""WinDaq's bytes, put together by the format's description, are read back exactly."""

from pathlib import Path

import numpy as np
import pytest

from pendpipe.errors import InputError
from pendpipe.formats import ReadOptions, inspect, read

from .cases import WindaqFile, swing

COUNTS = np.rint(swing(2000, 250.0)[1] * 8000).astype(np.int64)[:, None]
TWO = np.hstack([COUNTS, np.roll(COUNTS, 100)])


def write(path: Path, content: WindaqFile) -> Path:
    path.write_bytes(content.pack())
    return path


def test_14_bit_counts_are_shifted_and_scaled(tmp_path: Path) -> None:
    path = write(tmp_path / "a.WDQ", WindaqFile(TWO, intercept=0.25))
    for channel in (1, 2):
        recording = read(path, ReadOptions(channel=str(channel)))
        np.testing.assert_allclose(recording.values, TWO[:, channel - 1] * 10 / 16384 + 0.25)
    assert recording.quantity == "volts"
    assert recording.resolution == pytest.approx(10 / 16384)
    np.testing.assert_allclose(recording.time_s, np.arange(2000) * 0.004)


def test_hires_counts_keep_their_two_low_bits(tmp_path: Path) -> None:
    path = write(tmp_path / "a.WDH", WindaqFile(4 * COUNTS + 1, hires=True))
    np.testing.assert_allclose(read(path).values, (4 * COUNTS[:, 0] + 1) / 4 * 10 / 16384)
    assert inspect(path).format == "windaq-hires"


def test_a_circular_file_begins_with_its_oldest_sample(tmp_path: Path) -> None:
    turned = np.roll(TWO, 700, axis=0)
    content = WindaqFile(turned, hires=True, header_size=1536, state=2, next_write=700)
    path = write(tmp_path / "a.WHC", content)
    np.testing.assert_allclose(read(path).values, TWO[:, 0] / 4 * 10 / 16384)
    assert inspect(path).format == "windaq-hires-circular"


def test_packed_channels_have_their_own_rates(tmp_path: Path) -> None:
    # As documented, no such file being at hand: a channel is in the scans its divisor divides.
    path = write(tmp_path / "a.WDQ", WindaqFile(TWO, divisors=[1, 4]))
    second = read(path, ReadOptions(channel="2"))
    np.testing.assert_allclose(second.values, TWO[::4, 1] * 10 / 16384)
    np.testing.assert_allclose(second.time_s, np.arange(500) * 0.016)
    assert len(read(path, ReadOptions(channel="1"))) == 2000


def test_markers_carry_their_comments(tmp_path: Path) -> None:
    texts = [b"Angle", b"Level"]
    offset = sum(len(text) + 1 for text in texts)
    events = [0, 0, -500, 1200, 4, (offset | 1 << 31) - (1 << 32)]
    content = WindaqFile(TWO, events=events, annotations=texts, comments=b"released\0")
    found = inspect(write(tmp_path / "a.WDQ", content))
    assert [channel[0] for channel in found.channels] == ["Angle", "Level"]
    assert [(mark.sample, mark.comment) for mark in found.markers] == [
        (0, ""),
        (500, ""),
        (1200, "released"),
    ]


def test_hires_pointers_count_samples(tmp_path: Path) -> None:
    content = WindaqFile(TWO, hires=True, events=[0, 0, -1000])
    assert inspect(write(tmp_path / "a.WDH", content)).markers[1].sample == 500


def test_a_pause_is_a_gap_and_nothing_else_is(tmp_path: Path) -> None:
    # Scan 1000 stands 4 s after the start by the samples, and 60 s by its stamp.
    path = write(tmp_path / "a.WDQ", WindaqFile(COUNTS, events=[0, 0, 500, 2, 1000, 60, 1500, 62]))
    found = inspect(path)
    assert [(gap.after_sample, gap.missing_s) for gap in found.gaps] == [(999, pytest.approx(56.0))]
    time = read(path).time_s
    assert time[1000] == pytest.approx(60.0)
    assert time[-1] == pytest.approx(60.0 + 999 * 0.004)


def test_the_units_of_the_header_are_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "a.WDQ", WindaqFile(COUNTS, unit=b"deg"))
    assert read(path).quantity == "angle_rad"
    path = write(tmp_path / "b.WDQ", WindaqFile(COUNTS, unit=b"rpm"))
    assert inspect(path).channels == (("channel 1", "rpm"),)
    with pytest.raises(InputError, match="no column looks like"):
        read(path)
    assert read(path, ReadOptions(channel="1", unit="V")).quantity == "volts"


@pytest.mark.parametrize("size", [8000 | 1 << 28, 8000 | 1 << 20 | 1 << 14, 0xFFFF_FFFF, 0])
def test_a_damaged_data_size_is_mended_from_the_trailers(tmp_path: Path, size: int) -> None:
    events = [0, 0, -500, -1200]
    texts = [b"Angle", b"Level"]
    content = WindaqFile(TWO, events=events, annotations=texts, data_bytes=size)
    found = inspect(write(tmp_path / "a.WDQ", content))
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


def test_the_users_rate_mends_a_damaged_interval(tmp_path: Path) -> None:
    path = write(tmp_path / "a.WDQ", WindaqFile(COUNTS, interval_s=-1.2e-41))
    assert read(path, ReadOptions(sample_rate=250)).time_s[1] == pytest.approx(0.004)


def test_samples_at_the_converters_end_are_counted(tmp_path: Path) -> None:
    clipped = np.clip(3 * COUNTS, -8192, 8191)
    found = inspect(write(tmp_path / "a.WDQ", WindaqFile(clipped)))
    assert found.clipped_samples == np.sum((clipped == -8192) | (clipped == 8191)) > 0


def test_an_event_behind_the_last_sample_has_its_time(tmp_path: Path) -> None:
    events = [0, 0, len(COUNTS), 99]
    found = inspect(write(tmp_path / "a.WDQ", WindaqFile(COUNTS, events=events)))
    assert found.markers[-1].time_s == pytest.approx(0.004 * (len(COUNTS) - 1), abs=1e-9)


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
    with pytest.raises(InputError, match="line 3: 'sc 3' is no whole scan"):
        read(path)
