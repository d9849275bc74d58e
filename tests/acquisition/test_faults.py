"""Sessions with simulated instruments, faults of the line, and the rate of the clock."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest
from benchmarks.acquisition import RATES, one_swing, session
from benchmarks.faulty_device import Fault, acquire_faulty
from hypothesis import given, strategies as st
from scipy.stats import binom, t

import pendpipe.acquisition.recorder
from pendpipe.acquisition import decode
from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.decode import (
    decode_recording,
    find_changes,
    find_delays,
    measure_rate,
)
from pendpipe.acquisition.devices.simulated import SimulatedDevice
from pendpipe.acquisition.drivers import identify
from pendpipe.acquisition.drivers.letters import DI154RS, DI245
from pendpipe.acquisition.drivers.streams import exchanged, out_of_line
from pendpipe.acquisition.drivers.text import DI2108
from pendpipe.acquisition.line import Line, check_port
from pendpipe.acquisition.recorder import acquire_simulated, record
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.recording import GOOD, MISSING, SUSPECT, Recording

from ..refusals import refused
from .stepped import STEP_S, recorded_in_steps

# Every fault that a simulated device can have: what the recording then says.

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
    assert any("bytes were lost or doubled without a mark" in note for note in recording.notes)
    assert np.all(recording.quality[500:] == SUSPECT)
    assert np.all(recording.quality[:400] == GOOD)
    assert error_steps(recording) <= 0.51


def test_whole_scans_lost_on_a_line_are_said_and_move_nothing(recorded: Recorded) -> None:
    """2 s of 60, as the recorder stamps them: too short to be a silence; the clock alone tells."""
    recording = recorded("di2108", Fault("lost scans", at=4000, count=200), 60.0)
    said = next(note for note in recording.notes if "come late for good" in note)
    assert float(said.partition("(by ")[2].partition(" s")[0]) == pytest.approx(2.0, abs=0.02)
    assert missing(recording) == 0
    assert np.allclose(np.diff(recording.time_s), 1 / RATE_HZ)
    suspect = np.flatnonzero(recording.quality == SUSPECT)
    assert suspect[0] <= 2000 <= suspect[-1]
    assert np.abs(recording.values - slow(recording.time_s))[: suspect[0]].max() < 0.003


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


@pytest.mark.parametrize(("kind", "link"), [("di154", "pty"), ("di2108", "socket")])
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


# Device, line, driver, recorder and decoder together, over real terminals and sockets.

LINKS = [
    pytest.param(
        "pty",
        marks=pytest.mark.skipif(
            not hasattr(os, "openpty"), reason="this system has no pseudo-terminals"
        ),
    ),
    "socket",
]
KINDS = [("di154", 12, 4800 / 44), ("di2108", 16, 110.0)]


def swing(time_s: FloatArray) -> FloatArray:
    return np.asarray(4.0 * np.exp(-time_s / 200.0) * np.cos(math.pi * time_s))


def step_volts(recording: Recording) -> float:
    assert recording.resolution is not None
    return recording.resolution


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize(("kind", "bits", "rate_hz"), KINDS)
@pytest.mark.parametrize(("scale", "duration_s"), [(1.0, 0.2), (1000.0, 300.0)])
def test_a_recording_is_the_signal_to_half_a_step(
    link: str, kind: str, bits: int, rate_hz: float, scale: float, duration_s: float
) -> None:
    recording = acquire_simulated(
        kind, swing, rate_hz=110.0, duration_s=duration_s, clock_scale=scale, link=link
    )
    assert len(recording) == round(duration_s * rate_hz)
    assert step_volts(recording) == 20.0 / 2**bits
    assert recording.metadata["time_base"] == "nominal"
    assert not recording.notes
    error = np.abs(recording.values - swing(recording.time_s))
    # Half a step, and the slope times what the divisors miss of 110 Hz.
    assert error.max() <= 0.5 * step_volts(recording) * (1 + 1e-9) + 4 * math.pi * 1e-9


@pytest.mark.parametrize("kind", ["di154", "di2108"])
def test_every_channel_gets_its_own_signal_and_decodes_again_alike(
    kind: str, tmp_path: Path
) -> None:
    """Noise and clipping as well: they depend on the seed, and not on the pace of the host."""
    raw = tmp_path / "run" / f"{kind}.raw"

    def recorded(seed: int, path: Path | None) -> Recording:
        random = np.random.default_rng(seed)
        signals = {
            1: lambda t: random.normal(0.0, 1.0, len(t)),
            2: lambda t: np.full(len(t), 2.0),
            4: lambda t: 30.0 * swing(t),
        }
        return acquire_simulated(
            kind, signals, channels=(4, 1, 2), rate_hz=50.0, duration_s=20.0, raw_path=path
        )

    first = recorded(5, raw)
    assert np.array_equal(recorded(5, None).values, first.values)
    assert not np.array_equal(recorded(6, None).values, first.values)
    again = [decode_recording(raw, channel=number) for number in (1, 2, 4)]
    assert np.array_equal(again[0].values, first.values)
    assert again[0].metadata == first.metadata
    assert np.abs(again[1].values - 2.0).max() <= 0.5 * step_volts(again[1])
    assert again[2].values.max() == 10.0 - step_volts(again[2])
    assert again[2].values.min() == -10.0


@pytest.mark.parametrize(
    ("kind", "model"), [("di154", "DI-154RS"), ("di2108", "DI-2108")], ids=["di154", "di2108"]
)
def test_a_port_tells_who_is_there(kind: str, model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # Each family is asked in its own language; the other does not answer.
    for driver in (DI154RS, DI2108, DI245):
        monkeypatch.setattr(driver, "patience_s", 0.2)
        monkeypatch.setattr(driver, "attempts", 1)
    with SimulatedDevice(kind, swing) as device:
        assert identify(device.port).model == model


def test_a_wrong_model_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DI2108, "patience_s", 0.1)
    with (
        SimulatedDevice("di154", swing, clock_scale=100.0) as device,
        refused("does not answer", device.port),
    ):
        record(device.port, "di2108", rate_hz=60.0, duration_s=1.0, clock=device.clock)


def test_a_failing_signal_is_not_called_a_silent_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pendpipe.acquisition.recorder._SILENCE_S", 0.2)

    def failing(time_s: FloatArray) -> FloatArray:
        raise ZeroDivisionError("the signal's own fault")

    with pytest.raises(ZeroDivisionError, match="own fault"):
        acquire_simulated("di2108", failing, rate_hz=60.0, duration_s=1.0)


def test_simulated_time_stands_still_while_held() -> None:
    clock = ScaledClock(1000.0)
    clock.hold()
    before = clock.now()
    ScaledClock().sleep(0.01)
    assert clock.now() == before
    clock.release()
    assert 0 <= clock.now() - before < 10.0 + before


def test_faults_of_the_port_are_one_line_each(tmp_path: Path) -> None:
    plain = tmp_path / "file"
    plain.touch()
    with SimulatedDevice("di2108", swing) as device, Line(device.port, 4800):
        for port, said in (
            (str(tmp_path / "ttyUSB9"), "there is no such port"),
            (str(plain), "this is not a serial port"),
            ("nonsense://x", "this is not the port of an instrument"),
            ("socket://127.0.0.1:1", "nothing listens there"),
            (device.port, "the port is busy"),
        ):
            with refused(said, port):
                record(port, "di2108", rate_hz=60.0, duration_s=1.0)


@pytest.mark.parametrize(
    "port",
    [
        "spy:///dev/null?file={file}",
        "SPY://loop://?file={file}",
        "spy://socket://127.0.0.1:1?file={file}",
        "alt:///dev/null?class=PosixPollSerial",
        "hwgrep://0683",
        "loop://",
        "socket://127.0.0.1:1?logging=debug",
        "socket://user@127.0.0.1",
        "file://{file}",
        "simulated:di2108",
        "{file}",
    ],
)
def test_nothing_but_a_port_is_opened_and_no_file_is_touched(port: str, tmp_path: Path) -> None:
    """Pyserial's spy:// writes a log over any file that it is given."""
    file = tmp_path / "precious.csv"
    file.write_text("my readings")
    with refused("this is no"):
        record(port.format(file=file), "di2108", rate_hz=60.0, duration_s=1.0)
    assert file.read_text() == "my readings"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"rate_hz": 0.0}, "rate_hz: 0 is not a positive number"),
        ({"rate_hz": math.nan}, "rate_hz: nan is not a positive number"),
        ({"duration_s": -1.0}, "duration_s: -1 is not a positive number"),
        ({"channels": (9,)}, "has no channel 9"),
        ({"channels": ()}, "has no channel none"),
    ],
)
def test_impossible_wishes_are_one_line_each(asked: dict[str, object], message: str) -> None:
    wish = {"rate_hz": 60.0, "duration_s": 1.0, **asked}
    with pytest.raises(InputError, match=message):
        acquire_simulated("di2108", swing, **wish)  # type: ignore[arg-type]


def test_names_of_ports_and_links_to_devices_pass(tmp_path: Path) -> None:
    link = tmp_path / "instrument"
    link.symlink_to(os.devnull)
    for port in ("COM3", r"\\.\COM12", "rfc2217://host:4001", "socket://[::1]:9", str(link)):
        check_port(port)


# The measured scan rate: true whatever delays the arrivals, and honest about its error.


@pytest.mark.slow
@given(
    rate_hz=st.floats(1.0, 1e4),
    delay_s=st.floats(0.0, 10.0),
    origin_s=st.floats(-100.0, 100.0),
)
def test_a_constant_delay_changes_nothing(rate_hz: float, delay_s: float, origin_s: float) -> None:
    scans = np.arange(1.0, 401.0)
    found = measure_rate(origin_s + scans / rate_hz + delay_s, scans, 50.0)
    assert found.measured_hz == pytest.approx(rate_hz, rel=1e-9)


@given(scale=st.sampled_from([1.0, 1000.0]), rate_hz=st.floats(10.0, 1000.0))
def test_units_scale(scale: float, rate_hz: float) -> None:
    """A clock that runs faster measures a slower device, in proportion."""
    scans = np.arange(1.0, 401.0)
    arrival_s = scans / rate_hz + 1e-3 * np.sin(scans) ** 2
    slow = measure_rate(arrival_s, scans, rate_hz)
    fast = measure_rate(arrival_s * scale, scans, rate_hz / scale, clock_scale=scale)
    assert fast.measured_hz * scale == pytest.approx(slow.measured_hz, rel=1e-9)
    assert fast.measured_sd_hz * scale == pytest.approx(slow.measured_sd_hz, rel=1e-9)


@pytest.mark.parametrize("late_s", [1e-3, 1e-2])
def test_random_delays_leave_the_rate_within_its_error(late_s: float) -> None:
    """Exponential delays, with one in twenty a hundred times as long."""
    random = np.random.default_rng(20)
    pulls = []
    for _ in range(400):
        scans = np.arange(8.0, 8.0 * 600, 8.0)
        delay = random.exponential(late_s, len(scans))
        delay *= np.where(random.random(len(scans)) < 0.05, 100.0, 1.0)
        found = measure_rate(scans / 110.0 + delay, scans, 110.0)
        pulls.append((found.measured_hz - 110.0) / found.measured_sd_hz)
    assert abs(np.mean(pulls)) < 0.2
    assert np.std(pulls) < 1.3


@pytest.mark.parametrize(
    ("count", "told_hz", "true_hz", "used_hz"),
    [
        (500, 60.0, 120.0, 120.0),
        # A quartz is believed before the stamps: 10 parts in a million can't be seen in 5 s.
        (500, 100.0, 100.0 * (1 + 1e-5), 100.0),
        # Too few arrivals measure nothing.
        (35, 90.0, 100.0, 90.0),
    ],
)
def test_the_stamps_are_believed_where_they_know_more_than_the_device(
    count: int, told_hz: float, true_hz: float, used_hz: float
) -> None:
    scans = np.arange(1.0, count + 1.0)
    found = measure_rate(scans / true_hz, scans, told_hz)
    assert found.rate_hz == pytest.approx(used_hz, rel=1e-9)
    assert np.isnan(found.measured_hz) == (count < 36)


def steady(scans: FloatArray, rate_hz: float = 100.0) -> FloatArray:
    return scans / rate_hz + np.random.default_rng(3).exponential(1e-3, len(scans))


def slept(scans: FloatArray) -> FloatArray:
    """A second late, then everything at once."""
    arrival_s = steady(scans)
    arrival_s[2000:2100] = arrival_s[2100]
    return arrival_s


def wandering(scans: FloatArray) -> FloatArray:
    steps = np.random.default_rng(0).normal(0.0, 0.1, len(scans) // 20 + 1)
    return np.asarray(scans / 100.0 + np.repeat(np.cumsum(steps), 20)[: len(scans)])


@pytest.mark.parametrize(
    ("arrivals", "rise_s", "found"),
    [
        (steady, 0.3, True),
        (steady, 1.0, True),
        (lambda scans: steady(scans, 102.0), 0.3, True),  # not at the rate that it says
        (steady, 0.0, False),
        (slept, 0.0, False),  # a busy host is no loss: nothing stays late
        (wandering, 0.0, False),  # nor is what the usual steps explain
        (wandering, 6.0, True),
    ],
)
def test_scans_are_missing_where_the_arrivals_become_late_for_good(
    arrivals: Callable[[FloatArray], FloatArray], rise_s: float, found: bool
) -> None:
    scans = np.arange(1.0, 6001.0)
    arrival_s = arrivals(scans) + rise_s * (scans > 3000)
    delays, limit_s = find_delays(arrival_s, scans, 100.0)
    assert limit_s < 6.0
    assert len(delays) == found
    for delay in delays:
        # Within a tenth of the recording: what lies beyond it keeps its times.
        assert 3000 - 300 < delay.begin <= 3000 <= delay.end < 3000 + 300
        assert rise_s - 0.02 - 3.0 * (arrivals is wandering) < delay.late_s < rise_s + 0.02


@pytest.mark.parametrize(("drift_s", "chosen"), [(0.006, "nominal"), (0.025, "measured")])
def test_a_drift_of_a_busy_hosts_delays_is_no_rate(drift_s: float, chosen: str) -> None:
    """It does not scatter; below 10 ms of the host it is not believed, at any pace of the clock."""
    for clock_scale in (1.0, 20.0):
        scans = np.arange(1.0, 251.0) * 16.0
        arrival_s = scans / 100.0 * (1.0 + drift_s * clock_scale / 40.0)
        assert measure_rate(arrival_s, scans, 100.0, clock_scale).chosen == chosen


def test_chance_makes_a_rate_as_rarely_as_students_distribution_says() -> None:
    """Twelve stretches and a line leave ten degrees of freedom: 1 in 8,000 beyond six."""
    assert 2.0 * t.sf(decode._RATE_TRUST, 10) == pytest.approx(1.0 / 8000.0, rel=0.1)
    generator, scans = np.random.default_rng(11), np.arange(1.0, 481.0) * 16.0
    beyond = 0
    for _ in range(1000):
        # Delays of many ms: the floor of the host's ten is far below.
        arrival_s = scans / 100.0 + generator.uniform(0.0, 3.0, len(scans))
        beyond += measure_rate(arrival_s, scans, 100.0).chosen == "measured"
    assert beyond <= binom.isf(1e-3, 1000, 1.0 / 8000.0)


@pytest.mark.parametrize(("height_s", "lost"), [(1.2, 0), (1.4, 1)])
def test_a_loss_is_a_step_of_more_than_eight_spreads_of_the_others(
    height_s: float, lost: int
) -> None:
    """Delays of 0, 0.1, 0.1 s in turn: steps spread by 0.148 s, and a step loses 0.1 s in them."""
    scans = np.arange(1.0, 2049.0)
    delay_s = np.repeat(np.resize([0.0, 0.1, 0.1], 256), 8)
    arrival_s = scans / 100.0 + delay_s + height_s * (scans > 1024)
    assert len(find_delays(arrival_s, scans, 100.0)[0]) == lost


# --- rates that change, and words that are lost ---------------------------------------------------
@pytest.mark.parametrize("name", RATES)
def test_a_rate_that_changes_is_dated_and_followed(name: str) -> None:
    """The recorder's clock shows it, but for the 20 ms after which a host takes bytes."""
    content, made_s = session(np.random.default_rng(3), *RATES[name])
    found = decode_recording(content)
    said = [note for note in found.notes if "the scan rate changes" in note]
    assert len(said) == len(RATES[name]) - 1
    assert np.abs(found.time_s - made_s).max() < 0.02
    dates_s = [float(note.partition(" Hz at ")[2].split()[0]) for note in said]
    true_s = np.cumsum([span_s for _, span_s in RATES[name]])[:-1]
    # A date is known to a stretch, a 256th of the recording.
    assert dates_s == pytest.approx(true_s.tolist(), abs=450.0 / 256.0)


@pytest.mark.parametrize("lost", [1, 5, 500])
def test_lost_scans_are_no_change_of_the_rate(lost: int) -> None:
    found = decode_recording(session(np.random.default_rng(4), (60.0, 450.0), lost=lost)[0])
    assert not any("the scan rate changes" in note for note in found.notes)
    assert any("come late for good" in note for note in found.notes) == (lost > 1)


def test_a_clock_that_is_set_right_slowly_is_no_change_of_the_rate() -> None:
    """Systems slew theirs by up to 500 ppm."""
    scans = np.arange(1.0, 27_001.0)
    for ppm, found in ((400.0, 0), (700.0, 1)):
        arrival_s = scans / 60.0 + 1e-6 * ppm * np.maximum(scans / 60.0 - 225.0, 0.0)
        assert len(find_changes(arrival_s, scans, 60.0)) == found


@pytest.mark.slow
def test_delays_that_wander_are_no_change_of_the_rate() -> None:
    generator, scans, found = np.random.default_rng(5), np.arange(1.0, 6001.0), 0
    for _ in range(100):
        walk_s = np.repeat(np.cumsum(generator.normal(0.0, 0.02, 261)), 23)[: len(scans)]
        found += len(find_changes(scans / 100.0 + walk_s, scans, 100.0)) > 0
    assert found <= 2


@pytest.mark.parametrize("model", ["di154", "di2108"])
@pytest.mark.parametrize("channels", [1, 2, 4])
@pytest.mark.parametrize("bytes_", [2, -2], ids=["lost", "twice"])
def test_no_reading_made_of_two_halves_and_no_place_of_another_channel_is_called_good(
    model: str, channels: int, bytes_: int
) -> None:
    """Readings that swing show by themselves what does not belong to them."""
    generator = np.random.default_rng(6)
    assert not any(one_swing(generator, model, channels, bytes_) for _ in range(20))


@pytest.mark.parametrize("per_cycle", [4, 10, 60, 1000])
@pytest.mark.parametrize("noise", [0.0, 1.0, 30.0])
def test_swings_without_a_fault_are_in_line(per_cycle: int, noise: float) -> None:
    scan = np.arange(20_000)[:, None]
    swing = 2e4 * np.exp(-scan / 5000.0) * np.cos(2.0 * np.pi * scan / per_cycle + [0.0, 1.0])
    counts = np.rint(swing + np.random.default_rng(7).normal(0.0, noise, swing.shape))
    assert not out_of_line(counts.astype(np.int16)).any()
    assert exchanged(counts.astype(np.int16)) is None
