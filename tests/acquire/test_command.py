"""``pendpipe acquire`` as a user calls it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pendpipe.acquire.decode import decode_recording
from pendpipe.cli import main
from pendpipe.recording import read_plain


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
    values = recording.as_motion().values
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
    words: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "never.csv"
    assert main(["acquire", *words.format(out).split()]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_listing_never_fails(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["acquire", "--list"]) == 0
    assert capsys.readouterr().out


def test_a_length_in_samples_and_a_range(tmp_path: Path) -> None:
    out = tmp_path / "short.csv"
    call = "acquire --device simulated:di4108 --rate 100 --samples 250 --range-volts 1.5"
    assert main([*call.split(), "--clock-scale", "20", "--out", str(out)]) == 0
    recording = read_plain(out)
    assert len(recording) == 250
    assert recording.number("range_volts") == 2.0
    # The bytes off the wire are kept beside, whether asked for or not.
    assert np.array_equal(decode_recording(tmp_path / "short.raw").values, recording.values)
