"""Device, line, driver, recorder and decoder together, over real terminals and sockets."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices.simulated import SimulatedDevice
from pendpipe.acquisition.drivers import identify
from pendpipe.acquisition.drivers.letters import DI154RS, DI245
from pendpipe.acquisition.drivers.text import DI2108
from pendpipe.acquisition.line import Line, check_port
from pendpipe.acquisition.recorder import acquire_simulated, record
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.recording import Recording

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
        pytest.raises(InputError, match="does not answer") as caught,
    ):
        record(device.port, "di2108", rate_hz=60.0, duration_s=1.0, clock=device.clock)
    assert str(caught.value).startswith(device.port)
    assert "\n" not in str(caught.value)


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
    def refused(port: str) -> str:
        with pytest.raises(InputError) as caught:
            record(port, "di2108", rate_hz=60.0, duration_s=1.0)
        assert caught.value.place == port
        return str(caught.value)

    plain = tmp_path / "file"
    plain.touch()
    assert "there is no such port" in refused(str(tmp_path / "ttyUSB9"))
    assert "this is no serial port" in refused(str(plain))
    assert "this is no port of an instrument" in refused("nonsense://x")
    assert "nothing listens there" in refused("socket://127.0.0.1:1")
    with SimulatedDevice("di2108", swing) as device, Line(device.port, 4800):
        assert "the port is busy" in refused(device.port)


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
    with pytest.raises(InputError, match="this is no") as caught:
        record(port.format(file=file), "di2108", rate_hz=60.0, duration_s=1.0)
    assert "\n" not in str(caught.value)
    assert file.read_text() == "my readings"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"rate_hz": 0.0}, "rate_hz: 0 is no positive number"),
        ({"rate_hz": math.nan}, "rate_hz: nan is no positive number"),
        ({"duration_s": -1.0}, "duration_s: -1 is no positive number"),
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
