"""The command `acquire` and what it says."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from serial import SerialException

from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.drivers import without_port
from pendpipe.acquisition.line import Line, cannot_open
from pendpipe.acquisition.raw import read_raw
from pendpipe.analysis.readings import motion_of
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.recording import read_plain

# ``pendpipe acquire`` as a user calls it.


@pytest.mark.parametrize(("kind", "bits"), [("di154", 12), ("di2108", 16)])
def test_all_a_newcomer_needs(
    kind: str, bits: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, raw = tmp_path / "decay.csv", tmp_path / "decay.raw"
    call = f"acquire --device simulated:{kind} --rate 100 --duration 120 --clock-scale 1000"
    assert main([*call.split(), "--out", str(out), "--raw", str(raw)]) == 0
    recording = read_plain(out)
    assert recording.quantity == "volts"
    assert recording.number("bits") == bits
    assert recording.number("range_volts") == 10.0
    assert recording.metadata["source"].startswith("simulated DI-")
    assert recording.resolution == 20.0 / 2**bits
    # 0.3 rad at 3.85 V/rad, and at 120 s down by exp(-pi 60/150).
    values = motion_of(recording).values
    half_s = round(0.5 / recording.interval_s)
    assert np.abs(values[: 2 * half_s]).max() == pytest.approx(0.3, rel=0.02)
    assert np.abs(values[-2 * half_s :]).max() == pytest.approx(
        0.3 * np.exp(-np.pi * 60 / 150), rel=0.03
    )
    assert np.array_equal(decode_recording(raw).values, recording.values)
    assert f"{len(recording)} samples" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--port /dev/no-such-port --model di2108 --out {}", "there is no such port"),
        ("--port /dev/no-such-port --out {}", "there is no such port"),
        ("--device simulated:di700 --out {}", "there is no such simulated device"),
        ("--device di2108 --out {}", "give simulated:di2108"),
        ("--device simulated:di2108 --rate 1e9 --out {}", "can't scan at 1e+09 Hz"),
        ("--device simulated:di2108 --clock-scale 0 --out {}", "must be positive"),
        ("--device simulated:di2108 --duration nan --out {}", "duration_s: nan"),
        ("--device simulated:di2108", "give --out"),
        ("--device simulated:di2108 --samples 0 --out {}", "--samples: it must be positive"),
        ("--device simulated:di2108 --range-volts 11 --out {}", "no range of +-11 V"),
        ("--recover nowhere.raw --out {}", "can't be read"),
        ("--out {}", "no instrument is named"),
    ],
)
def test_a_users_fault_is_one_line_and_status_two(
    words: str, message: str, tmp_path: Path, refusal_of: Any
) -> None:
    out = tmp_path / "never.csv"
    assert message in refusal_of(["acquire", *words.format(out).split()])
    assert not out.exists()


def test_a_length_in_samples_and_a_range(tmp_path: Path) -> None:
    out = tmp_path / "short.csv"
    call = "acquire --device simulated:di4108 --rate 100 --samples 250 --range-volts 1.5"
    assert main([*call.split(), "--clock-scale", "20", "--out", str(out)]) == 0
    recording = read_plain(out)
    assert len(recording) == 250
    assert recording.number("range_volts") == 2.0
    # The bytes off the wire are kept beside, whether asked for or not.
    assert np.array_equal(decode_recording(tmp_path / "short.raw").values, recording.values)


QUICK = "acquire --device simulated:di2108 --rate 100 --duration 20 --clock-scale 100 --out"


def raw_files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.raw")}


def test_a_second_call_records_beside_the_first(tmp_path: Path) -> None:
    out = tmp_path / "decay.csv"
    assert main([*QUICK.split(), str(out)]) == 0
    first = raw_files(tmp_path)
    assert list(first) == ["decay.raw"]
    assert main([*QUICK.split(), str(out), "--force"]) == 0
    both = raw_files(tmp_path)
    assert first.items() < both.items()
    assert len(both) == 2
    newer = next(name for name in both if name != "decay.raw")
    assert read_plain(out).metadata["raw_file"] == newer


def test_a_csv_that_could_not_be_written_is_made_at_the_next_call(
    tmp_path: Path, refusal_of: Any, answer_of: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "decay.csv"

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pendpipe.formats.writing.write", full)
        assert "No space left on device" in refusal_of([*QUICK.split(), str(out)])
    kept = read_raw(tmp_path / "decay.raw").data
    # Nothing is recorded now, although another length is asked for.
    assert (
        "nothing was recorded now" in answer_of([*QUICK.split(), str(out), "--duration", "1"]).err
    )
    assert len(read_plain(out)) == 2000
    assert list(raw_files(tmp_path)) == ["decay.raw"]
    assert read_raw(tmp_path / "decay.raw").data == kept
    # That call has written it: the next one records again, even where the CSV has gone.
    out.unlink()
    assert main([*QUICK.split(), str(out), "--duration", "1"]) == 0
    assert len(read_plain(out)) == 100


def test_a_place_where_nothing_can_be_written_is_refused_before_the_recording(
    tmp_path: Path, refusal_of: Any
) -> None:
    for out in (tmp_path, tmp_path / "a-file/decay.csv", Path("/dev/null/decay.csv")):
        (tmp_path / "a-file").touch()
        refusal_of([*QUICK.split(), str(out)])
    assert not raw_files(tmp_path)


LISTENING = """
import signal, sys
from pendpipe.cli import main
# Whoever runs the tests in the background, or under nohup, lets their children ignore these.
signal.signal(signal.SIGINT, signal.default_int_handler)
for name in ("SIGTERM", "SIGHUP"):
    signal.signal(getattr(signal, name), signal.SIG_DFL)
sys.exit(main())
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_a_recording_and_what_was_recorded_is_written(
    name: str, tmp_path: Path
) -> None:
    """A closing terminal sends several: those that come while it is written change nothing."""
    number = getattr(signal, name, None)
    if number is None or not hasattr(os, "mkfifo"):
        pytest.skip("this system has no such signal")
    out, raw = tmp_path / "decay.csv", tmp_path / "decay.raw"
    os.mkfifo(out)  # nothing is written to it before it is read
    command = "acquire --device simulated:di2108 --rate 100 --duration 600 --raw"
    process = subprocess.Popen(
        [sys.executable, "-c", LISTENING, *command.split(), str(raw), "--out", str(out)]
    )
    until(process, lambda: recorded_bytes(raw) > 200)
    os.kill(process.pid, number)
    until(process, lambda: bool(read_raw(raw).event("stopped")))
    if name != "SIGINT":
        os.kill(process.pid, number)
    written = b""
    with os.fdopen(os.open(out, os.O_RDONLY | os.O_NONBLOCK), "rb", buffering=0) as pipe:
        while process.poll() is None:
            written += pipe.read() or b""
            time.sleep(0.01)
        written += pipe.read() or b""
    assert process.returncode == 0
    assert read_raw(raw).event("stopped")["reason"] == "interrupted by the user"
    recording = read_plain(out, written)
    assert len(recording) > 10
    assert "interrupted by the user" in recording.metadata["notes"]


def recorded_bytes(raw: Path) -> int:
    """How many bytes off the wire a raw file holds: none before its head is whole."""
    try:
        return len(read_raw(raw).data)
    except InputError:
        return 0


def until(process: subprocess.Popen[bytes], met: Callable[[], bool]) -> None:
    """Wait for what a process does; if it ends before, that is the answer."""
    while not met():
        assert process.poll() is None
        time.sleep(0.01)


def test_make_clean_spares_what_an_instrument_has_recorded(tmp_path: Path) -> None:
    make = shutil.which("make")
    if make is None or sys.platform == "win32":
        pytest.skip("there is no make")
    shutil.copy(Path(__file__).parents[2] / "Makefile", tmp_path)
    raw = tmp_path / "results/live/raw/1.raw"
    raw.parent.mkdir(parents=True)
    for path in (raw, raw.parents[1] / "recording.csv", tmp_path / "results/README.md"):
        path.touch()
    subprocess.run([make, "-s", "clean"], cwd=tmp_path, check=True)
    left = [path.name for path in (tmp_path / "results").rglob("*") if path.is_file()]
    assert sorted(left) == ["1.raw", "README.md"]


def test_a_simulated_record_is_the_same_whenever_it_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer_of: Any
) -> None:
    """Date and measured rate are the run's: they go to the log, not into the result."""
    made = []
    for year in (2026, 2027):
        then = SimpleNamespace(now=lambda zone, year=year: datetime(year, 1, 1, tzinfo=zone))
        monkeypatch.setattr("pendpipe.acquisition.recorder.datetime", then)
        out = tmp_path / str(year) / "recording.csv"
        call = ["--campaign", "config/config.yaml", "--record", "air-12"]
        assert f"recorded_at: {year}-01-01" in answer_of(["acquire", *call, "--out", str(out)]).err
        made.append(out.read_bytes())
    assert made[0] == made[1]


# What a user is told about ports: who holds them, who may open them, which driver is missing.
#
# The faults are pyserial's own: on Linux and macOS it is made to raise them; those of Windows are
# written as ``serialwin32.py`` writes them (its text, no number; the words in any language).

posix = pytest.mark.skipif(sys.platform == "win32", reason="pyserial's POSIX part")


@posix
@pytest.mark.parametrize(
    ("number", "problem"),
    [
        (errno.ENOENT, "there is no such port"),
        (errno.EACCES, "you may not open the port"),
        (errno.EPERM, "you may not open the port"),
        (errno.EBUSY, "the port is busy"),
        (errno.ENXIO, "no working device is behind the port"),
        (errno.ENODEV, "no working device is behind the port"),
        (errno.EIO, "no working device is behind the port"),
        (errno.EMFILE, "the port can't be opened"),
    ],
)
def test_every_fault_of_opening_is_named(
    number: int, problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: str, *_: object) -> int:
        raise OSError(number, os.strerror(number), path)

    monkeypatch.setattr("serial.serialposix.os.open", refuse)
    with pytest.raises(InputError) as caught:
        Line("/dev/ttyUSB7", 4800)
    assert caught.value.place == "/dev/ttyUSB7"
    assert problem in caught.value.problem


@posix
def test_a_port_that_another_program_has_locked_is_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    def locked(*_: object) -> None:
        raise BlockingIOError(errno.EWOULDBLOCK, "Resource temporarily unavailable")

    _, end = os.openpty()
    monkeypatch.setattr("serial.serialposix.fcntl.flock", locked)
    with pytest.raises(InputError, match=r"busy; close the program .* \(lsof /dev"):
        Line(os.ttyname(end), 4800)


@pytest.mark.parametrize(
    ("original", "problem", "remedy"),
    [
        ("PermissionError(13, 'Access is denied.', None, 5)", "the port is busy", "WinDaq"),
        ("PermissionError(13, 'Zugriff verweigert', None, 5)", "the port is busy", "terminal"),
        (
            "FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)",
            "there is no such port",
            "--list",
        ),
        (
            "OSError(22, 'A device attached to the system is not functioning.', None, 31)",
            "no working device",
            "Device Manager",
        ),
        (
            "OSError(22, 'The semaphore timeout period has expired.', None, 121)",
            "no working device",
            "plug it in again",
        ),
        # Seen with a DI-245: SetCommState fails with 87, and that is no missing port.
        ("OSError(22, 'The parameter is incorrect.', None, 87)", "driver refuses", "install its"),
    ],
)
def test_windows_says_it_in_the_text_alone(original: str, problem: str, remedy: str) -> None:
    fault = SerialException(f"could not open port 'COM3': {original}")
    said = cannot_open("COM3", fault)
    assert problem in said.problem
    assert remedy in said.remedy


def plugged(devices: Path, name: str, product: str, *parts: str) -> None:
    """A USB device as the kernel shows it."""
    folder = devices / name
    for part in parts:
        (folder / part).mkdir(parents=True)
    folder.mkdir(exist_ok=True)
    (folder / "idVendor").write_text("0683\n")
    (folder / "idProduct").write_text(product + "\n")


def test_a_device_without_a_driver_is_found_on_linux(tmp_path: Path) -> None:
    plugged(tmp_path, "1-1", "2450", "1-1:1.0")
    plugged(tmp_path, "1-2", "1110", "1-2:1.0")
    plugged(tmp_path, "1-3", "4109", "1-3:1.0/tty/ttyACM0")
    plugged(tmp_path, "1-4", "2450", "1-4:1.0/ttyUSB0/tty/ttyUSB0")
    (tmp_path / "usb1").mkdir()
    (tmp_path / "usb1" / "idVendor").write_text("1d6b\n")
    said = [str(device) for device in without_port(tmp_path)]
    assert len(said) == 2
    assert "DI-245 (0683:2450) without a serial port: sudo modprobe ftdi_sio" in said[0]
    assert "new_id" in said[0]
    assert "DI-1110" in said[1]
    assert "hold its button" in said[1]
    assert without_port(tmp_path / "nowhere") == []
