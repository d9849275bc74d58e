"""Real recordings, read where they lie: layouts, counts and cuts that are known of them."""

import csv
from pathlib import Path

import numpy as np
import pytest

from pendpipe.analysis.free_decay import find_free_decay
from pendpipe.analysis.readings import motion_of
from pendpipe.errors import InputError, NotAnalysableError
from pendpipe.formats import ReadOptions, inspect, read

from .cases import SHARED

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/recordings here")

ENCODER = "yfysiks-encoder"
FURUTA = "kenevich-furuta-arm2"
ADIP = "profcarter-adip/adip_pend_data.mat"
ROLL = "kvlcc2-roll-decay/model_test_21337.csv"
SPRING = "filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv"
TAIL = "dynamicslab-single/SingleDataFreeSwing_1_Dt_0_0001.mat"
WOOD = "davidw99-wood-steel-bob/damping_angle.xlsx"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "samples", "rate", "largest", "step"),
    [
        (f"{ENCODER}/data32.csv", 14014, 99.6, 1.466, 5.236e-3),
        (f"{ENCODER}/data2_14.csv", 39454, None, 0.395, 2.618e-3),
        (ADIP, 119940, 1000.0, 1.234, 4.363e-4),
        ("jiarui-phy180/AAAtAmp3.txt", 9944, 29.99, 0.600, None),
        ("martin8ner-pohl-eddy/1.3_100mA.csv", 1590, 10.0, 2.46, 0.01),
        (ROLL, 9166, 100.0, 0.167, 8.727e-5),
        ("nielsskov-cartpend/test1pend1.csv", 10442, 149.9, 3.13, 3.1416e-3),
        (SPRING, 11886, 100.0, 0.487, 1e-4),
        ("tylertian-phy180/lab1_data.txt", 2330, 20.0, 0.702, None),
        (f"{FURUTA}/dataset4.txt", 3606, 99.84, 1.88, 0.01),
        ("lipson-schmidt-2009/real_pend_h_1.txt", 556, 6.0, 1.474, None),
        (TAIL, 231757, 10_000.0, 0.0661, 1.5708e-4),
        ("jensen-freeswing/pendulum_free_swing_data_03.txt", 5000, 1000.0, 1.115, 1.587e-3),
        (WOOD, 917, 30.0, 0.977, None),
    ],
)
def test_free_decays_are_read_as_their_table_says(
    name: str, samples: int, rate: float | None, largest: float, step: float | None
) -> None:
    recording, found = read(SHARED / name), inspect(SHARED / name)
    assert len(recording) == found.samples == samples
    assert np.abs(recording.values).max() == pytest.approx(largest, rel=3e-3)
    # Of the spring's position the file gives no unit.
    assert recording.quantity == ("reading" if name == SPRING else "angle_rad")
    if rate is not None:
        assert found.sample_rate_hz == pytest.approx(rate, rel=2e-3)
    assert found.uniform is (rate is not None)
    assert recording.resolution == (None if step is None else pytest.approx(step, rel=1e-3))
    assert found.clipped_samples == 0


def test_the_gap_in_an_encoders_record_is_seen() -> None:
    gaps = inspect(SHARED / ENCODER / "data2_12.csv").gaps
    assert max(gap.missing_s for gap in gaps) == pytest.approx(13.2, abs=0.1)


# Start and stop where they are known, and half a cycle.
@pytest.mark.parametrize(
    ("name", "start", "stop", "half_cycle"),
    [
        (ADIP, 2.0, 120.0, 0.5),
        (f"{FURUTA}/dataset4.txt", 12.8, 45.0, 0.36),
        (ROLL, 25.0, 91.65, 1.27),
        (f"{ENCODER}/data32.csv", 10.14, 150.8, 0.53),
        (f"{ENCODER}/data2_12.csv", 8.6, 233.9, 0.73),
        ("jiarui-phy180/AAAtAmp3.txt", 0.0, 331.57, 1.1),
        ("tylertian-phy180/lab1_data.txt", 0.0, 116.41, 0.85),
        ("nielsskov-cartpend/test1pend1.csv", 4.4, 71.3, 0.6),
        (SPRING, 1.0, 119.85, 0.37),
        (TAIL, 60.0, 65.7, 0.39),
        ("martin8ner-pohl-eddy/1.3_100mA.csv", 0.0, 153.0, 0.96),
    ],
)
def test_cuts_lie_within_half_a_cycle_of_what_is_known(
    name: str, start: float, stop: float, half_cycle: float
) -> None:
    found = find_free_decay(read(SHARED / name))
    assert found.start_s == pytest.approx(start, abs=half_cycle)
    assert found.stop_s == pytest.approx(stop, abs=half_cycle)


@pytest.mark.parametrize("name", ["dataset1_no_clip", "dataset2_clip", "dataset3"])
def test_clamping_and_repositioning_are_cut_and_said(name: str) -> None:
    recording = read(SHARED / FURUTA / f"{name}.txt")
    found = find_free_decay(recording)
    assert "moved by hand before release" in " ".join(cut.reason for cut in found.cuts)
    assert found.stop_s < recording.time_s[-1] - 4.0
    left = sum(cut.stop_s - cut.start_s for cut in found.cuts)
    whole = recording.time_s[-1] - recording.time_s[0]
    assert left + found.stop_s - found.start_s == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize(
    "name",
    [
        "windaq-windaq3/DI-2108_sine_sample.WDH",
        "windaq-vendor-sample/SAMPLE.WDQ",
        "windaq-pytool/march_30_2026__sn1in.WDH",
        "windaq-pylle-di149-ascii/00000044.cso",
    ],
)
def test_what_is_no_pendulum_is_refused(name: str) -> None:
    with pytest.raises(NotAnalysableError):
        find_free_decay(motion_of(read(SHARED / name), 1.0))


@pytest.mark.parametrize(
    ("name", "form", "channels", "rate", "scans", "marks"),
    [
        ("vendor-sample/SAMPLE.WDQ", "windaq", 4, 250.0, 5000, [0, 591, 3002]),
        ("vendor-sample/SAMPLE.WDH", "windaq-hires", 2, 100.0, 2208, [0, 860, 1116]),
        ("vendor-sample/SAMPLE.WHC", "windaq-hires-circular", 1, 200.0, 2000, [0]),
        ("windaq3/AUTO.WDQ", "windaq", 6, 9.375, 4067, [198, 779, 1084, 1503, 1806, 2571]),
        ("windaq3/DI-2108_sine_sample.WDH", "windaq-hires", 1, 1000.0, 1000, [0]),
        ("vendor-broken/SAMPLE.WDQ", "windaq", 4, 250.0, 5000, [0, 591, 3002]),
    ],
)
def test_windaq_files_decode_to_their_scans_and_markers(
    name: str, form: str, channels: int, rate: float, scans: int, marks: list[int]
) -> None:
    found = inspect(SHARED / f"windaq-{name}")
    assert (found.format, len(found.channels), found.samples) == (form, channels, scans)
    assert found.sample_rate_hz == pytest.approx(rate)
    # The broken copy has lost nothing but bits of its header; its marks may start later.
    assert [mark.sample for mark in found.markers] == marks


def test_windaq_values_and_the_pause_are_those_known() -> None:
    first = read(SHARED / "windaq-vendor-sample/SAMPLE.WDQ", ReadOptions(channel="1"))
    assert first.values[0] == pytest.approx(-0.25635, abs=1e-5)
    circular = read(SHARED / "windaq-vendor-sample/SAMPLE.WHC")
    assert circular.values[0] == pytest.approx(0.408923, abs=1e-6)
    paused = inspect(SHARED / "wdq-peter-t-ruehr/example_0.WDQ")
    assert paused.samples == 943
    assert [gap.after_sample for gap in paused.gaps] == [885]
    assert paused.gaps[0].missing_s == pytest.approx(113, abs=1)


def test_a_table_without_a_time_is_refused_and_says_so() -> None:
    with pytest.raises(InputError, match="no time column"):
        read(SHARED / "jiarui-phy180/PeriodVsAngleData.txt")


with Path(__file__).with_name("shared_files.tsv").open(encoding="utf-8", newline="") as stream:
    FILES = list(csv.DictReader(stream, delimiter="\t", quoting=csv.QUOTE_NONE))
    """What each holds, taken by hand from its README and from the file; 0 where nobody knows."""
NO_RECORDINGS = {"README.md", "LICENSE", ".commit", "DataExplanation.md", "description.txt"}


def test_each_shared_recording_is_in_the_table() -> None:
    files = (path for path in SHARED.rglob("*") if path.is_file())
    here = {path.relative_to(SHARED).as_posix() for path in files if path.name not in NO_RECORDINGS}
    assert here == {row["file"] for row in FILES if not row["file"].startswith("inputs/")}


@pytest.mark.slow
@pytest.mark.parametrize("row", FILES, ids=lambda row: row["file"])
def test_a_shared_file_is_read_right_or_refused_for_its_reason(row: dict[str, str]) -> None:
    """Any unit will do where a file gives none away, provided that the answer calls it a guess."""
    path = (SHARED.parent if row["file"].startswith("inputs/") else SHARED) / row["file"]
    if not path.is_file():
        pytest.skip("it is not beside this clone")
    column, unit = row["column"], row["unit"]
    if column.startswith("refused: "):
        with pytest.raises(InputError) as fault:
            read(path)
        assert all(words in str(fault.value) for words in column[9:].split("; "))
        return
    recording, found = read(path), inspect(path)
    swing, rate, duration, level = (
        float(row[key] or "nan") for key in ("swing", "rate_hz", "duration_s", "level")
    )
    stem = column.removesuffix("(*)")
    assert found.chosen == column or (stem != column and stem in found.chosen)
    usable = recording.values[recording.usable]
    centre = float(np.median(usable))
    largest = float(np.abs(usable - centre).max())
    sure = recording.unit == unit and (not swing or abs(largest / swing - 1.0) < 0.15)
    guessed = any("unit" in guess for guess in recording.weak_guesses)
    assert sure or (guessed and (unit == "any" or recording.unit in ("1", "rad")))
    assert not rate or found.sample_rate_hz == pytest.approx(rate, rel=0.01)
    assert found.duration_s == pytest.approx(duration, rel=0.12 if duration < 11.0 else 0.02)
    assert not (sure and abs(centre - level) > 0.03)
