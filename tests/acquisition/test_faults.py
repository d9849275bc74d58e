"""Every fault that a simulated device can have: what the recording then says."""

from collections.abc import Callable
from io import BytesIO
from typing import Any, TypeAlias

import numpy as np
import pytest
from benchmarks.faulty_device import Fault, acquire_faulty

import pendpipe.acquisition.recorder
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.raw import RawWriter
from pendpipe.arrays import FloatArray
from pendpipe.recording import GOOD, MISSING, SUSPECT, Recording

from .stepped import STEP_S, recorded_in_steps

FAMILIES = ["di154", "di149", "di245", "di2108"]
SYNC_BIT = FAMILIES[:3]
SCALE, RATE_HZ = 100.0, 100.0
STAMP_S = 0.05 * SCALE
"""A twentieth of a second of a host that is busy with other tests."""
POLL_S = pendpipe.acquisition.recorder._LONGEST_POLL_S
"""The recorder's pause between two looks at the line."""
Recorded: TypeAlias = Callable[..., Recording]


def slow(time_s: FloatArray) -> FloatArray:
    """Rises by less than 0.1 V a second, so that a reading tells its time."""
    return np.asarray(5.0 * np.sin(0.02 * time_s))


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> Recorded:
    """Record a device with a fault, in a time that no other process takes part in."""

    def record(kind: str, fault: Fault, duration_s: float = 60.0) -> Recording:
        return recorded_in_steps(
            kind, slow, fault, monkeypatch, rate_hz=RATE_HZ, duration_s=duration_s
        )

    return record


def recorded_from_a_line(kind: str, fault: Fault, duration_s: float, **wish: Any) -> Recording:
    """Record from a terminal or socket, whose plug can be pulled."""
    return acquire_faulty(
        kind, slow, fault, rate_hz=RATE_HZ, duration_s=duration_s, clock_scale=SCALE, **wish
    )


def missing(recording: Recording) -> int:
    return 0 if recording.quality is None else int(np.sum(recording.quality == MISSING))


def error_steps(recording: Recording, late_s: float = 0.0) -> float:
    """The worst error of the good samples, in steps, if times may be wrong by `late_s`."""
    good = np.ones(len(recording), dtype=bool)
    if recording.quality is not None:
        good = recording.quality == GOOD
    error = np.abs(recording.values - slow(recording.time_s))[good]
    return float((error.max() - 0.1 * late_s) / recording.resolution)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A device is silent after a quarter of a second of the host."""
    monkeypatch.setattr(pendpipe.acquisition.recorder, "_SILENCE_S", 0.25)


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        ("di245", Fault("junk")),
        ("di245", Fault("no echo")),
        ("di2108", Fault("wrong echo")),
        ("di2108", Fault("late echo", duration_s=0.05)),
        # NULs behind the last answer would be the first byte of the first word.
        ("di149", Fault("padded echo", count=3, times=99)),
        ("di2108", Fault("padded echo", count=3, times=99)),
        ("di4108", Fault("no echo", command=b"encode", times=99)),  # seen on one
    ],
    ids=lambda value: value if isinstance(value, str) else value.kind,
)
def test_a_spoilt_answer_costs_no_sample(kind: str, fault: Fault, recorded: Recorded) -> None:
    """After an answer was missed, the start waits as long as one may be late."""
    recording = recorded(kind, fault, duration_s=20.0)
    assert missing(recording) == 0
    assert not recording.notes
    assert error_steps(recording) <= 0.51


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_stale_stream_is_ended_before_the_recording(kind: str, recorded: Recorded) -> None:
    recording = recorded(kind, Fault("stale stream"), duration_s=10.0)
    assert not recording.notes
    # The signal's zero is that of the stale stream: its own time is read off the first sample.
    began_s = np.arcsin(recording.values[0] / 5.0) / 0.02
    assert began_s > 0.0
    later = slow(began_s + recording.time_s)
    assert np.abs(recording.values - later).max() < 3 * (recording.resolution or 0.0)


@pytest.mark.parametrize("kind", SYNC_BIT)
@pytest.mark.parametrize("place", [1000, 1001])
@pytest.mark.parametrize("name", ["drop", "duplicate", "flip"])
def test_what_breaks_the_frame_mark_costs_one_scan(
    kind: str, name: str, place: int, recorded: Recorded
) -> None:
    recording = recorded(kind, Fault(name, at=place), 15.0)
    assert missing(recording) == 1
    assert any("1 scans lost at 1 places" in note for note in recording.notes)
    assert np.sum(recording.quality == SUSPECT) <= 1
    assert abs(np.flatnonzero(recording.quality) - 500).max() <= 1
    # A byte too many costs a row that was never lost: a hundredth of a second.
    assert error_steps(recording, late_s=1 / RATE_HZ) <= 0.51


def test_a_lost_byte_of_the_unmarked_family_makes_what_follows_suspect(
    recorded: Recorded,
) -> None:
    """No mark tells it; the words are cut across from there on, and nothing is moved."""
    recording = recorded("di2108", Fault("drop", at=1001), 15.0)
    assert any("bytes were lost without a mark" in note for note in recording.notes)
    assert np.all(recording.quality[500:] == SUSPECT)
    assert np.all(recording.quality[:400] == GOOD)
    assert error_steps(recording) <= 0.51


def arrivals(kind: str, lost: int) -> bytes:
    """A raw recording of 150 s in which scans are lost after 40 s; delays of 2 ms and more."""
    device, random = DEVICES[kind](), np.random.default_rng(6)
    driver = find_driver(kind)
    step_volts = driver.range_volts / 2 ** (driver.bits - 1)
    numbers = np.arange(15_000)
    numbers = numbers[(numbers < 4000) | (numbers >= 4000 + lost)]
    codes = np.rint(slow(numbers / RATE_HZ) / step_volts).astype(np.int64)[:, None]
    stream = BytesIO()
    header = {
        "model": driver.model,
        "port": "COM3",
        "channels": [1],
        "rate_hz": RATE_HZ,
        "recorded_at": "2026-01-01T00:00:00+00:00",
    }
    writer, arrived_s = RawWriter(stream, header), 0.0
    for part in np.array_split(np.arange(len(numbers)), len(numbers) // 2):
        delay_s = 0.002 + random.exponential(0.003)
        arrived_s = max(arrived_s, numbers[part[-1]] / RATE_HZ + delay_s)
        writer.data(arrived_s, device.encode(codes[part]))
    writer.event(arrived_s, event="stopped", reason="time")
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["di154", "di2108"])
@pytest.mark.parametrize("lost", [5, 1500])
def test_whole_scans_lost_are_said_and_move_nothing(kind: str, lost: int) -> None:
    """Without a trace in the bytes, the clock alone tells where."""
    recording = decode_recording(arrivals(kind, lost))
    said = next(note for note in recording.notes if "come late for good" in note)
    assert float(said.partition("(by ")[2].partition(" s")[0]) == pytest.approx(
        0.01 * lost, abs=0.02
    )
    assert missing(recording) == 0
    assert np.allclose(np.diff(recording.time_s), 1 / RATE_HZ)
    assert recording.metadata["time_base"] == "nominal"
    suspect = np.flatnonzero(recording.quality == SUSPECT)
    assert suspect[0] <= 4000 <= suspect[-1]
    assert len(suspect) < 250
    assert np.abs(recording.values - slow(recording.time_s))[: suspect[0]].max() < 0.003


def test_whole_scans_lost_on_a_line_are_said(recorded: Recorded) -> None:
    """2 s of 60, as the recorder stamps them: too short to be a silence."""
    recording = recorded("di2108", Fault("lost scans", at=4000, count=200), 60.0)
    assert any("come late for good" in note for note in recording.notes)
    assert missing(recording) == 0


@pytest.mark.parametrize("code", [1, 2, 3])
def test_a_stop_code_is_no_data_and_the_stream_resumes(code: int, recorded: Recorded) -> None:
    recording = recorded("di2108", Fault("overflow", at=4000, code=code), 60.0)
    assert f"the device's buffer overflowed ('stop 0{code}')" in recording.notes
    assert any("broken off and resumed" in note for note in recording.notes)
    assert missing(recording) > 0
    # The next stream is placed by its arrivals: to a scan, and to the recorder's own pause.
    assert error_steps(recording, late_s=1 / RATE_HZ + POLL_S) <= 0.51
    assert recording.time_s[-1] == pytest.approx(60.0, abs=1 / RATE_HZ + POLL_S + STEP_S)


@pytest.mark.parametrize("kind", ["di154", "di2108"])
def test_a_stall_loses_nothing(kind: str, recorded: Recorded) -> None:
    """The device had kept what it could not send."""
    recording = recorded(kind, Fault("stall", at=4000, duration_s=0.5))
    assert missing(recording) == 0
    assert error_steps(recording) <= 0.51


@pytest.mark.parametrize(
    ("kind", "link"), [("di154", "pty"), ("di149", "pty"), ("di2108", "socket")]
)
def test_unplugged_and_plugged_in_again_is_a_gap_of_its_true_extent(
    kind: str, link: str, impatient: None
) -> None:
    # A busy machine, too, finds the device again before the recording's end.
    recording = recorded_from_a_line(
        kind, Fault("unplug", at=4000, duration_s=15.0), 400.0, link=link, reconnect_s=10.0
    )
    assert any("broken off and resumed: the line was lost" in note for note in recording.notes)
    gap = np.flatnonzero(recording.quality == MISSING)
    assert np.all(np.diff(gap) == 1)
    assert len(gap) >= 14.0 * RATE_HZ
    # What the host had not yet read goes with the plug, and on a busy machine that is some.
    assert gap[0] <= 2000 + STAMP_S * RATE_HZ
    # What was read behind the gap stands at the time at which it was so.
    assert error_steps(recording, late_s=STAMP_S) <= 0.51


def test_a_device_that_stays_away_ends_the_recording(impatient: None) -> None:
    recording = recorded_from_a_line("di2108", Fault("unplug", at=4000), 60.0, reconnect_s=0.3)
    assert any(note.startswith("ended early: the line was lost") for note in recording.notes)
    assert len(recording) <= 2000
    assert error_steps(recording) <= 0.51


def test_a_silent_spell_is_a_gap(recorded: Recorded) -> None:
    recording = recorded("di2108", Fault("silence", at=4000, duration_s=10.0))
    assert any("resumed: the device fell silent" in note for note in recording.notes)
    assert missing(recording) == pytest.approx(10.0 * RATE_HZ, abs=3.0 * RATE_HZ)
    assert error_steps(recording, late_s=1 / RATE_HZ + POLL_S) <= 0.51


@pytest.mark.parametrize("kind", ["di154", "di2108"])
@pytest.mark.parametrize("factor", [0.75, 1.0, 1.25])
def test_the_rate_is_measured(kind: str, factor: float, recorded: Recorded) -> None:
    """A device whose clock is wrong, by far more than the error of its rate, is not believed."""
    recording = recorded(kind, Fault("wrong rate", factor=factor))
    measured, sd, nominal, used = (
        recording.number(f"sample_rate{name}_hz")
        for name in ("_measured", "_measured_sd", "_nominal", "")
    )
    assert measured is not None
    assert sd is not None
    assert nominal == pytest.approx(RATE_HZ, rel=1e-3)
    assert sd < 0.03 * RATE_HZ
    assert measured == pytest.approx(nominal * factor, abs=6 * sd)
    assert used == (nominal if factor == 1.0 else measured)
    # As long as was asked by the recorder's clock.
    assert recording.time_s[-1] > 0.9 * 60.0
