"""A byte lost in a stream without marks is told by the signal, or left alone; never invented."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pendpipe.acquisition import slips
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.raw import RawWriter
from pendpipe.acquisition.slips import find_slips
from pendpipe.recording import MISSING, SUSPECT

Codes = NDArray[np.int64]


def swing(
    scans: int = 4000, amplitude: float = 9000.0, noise: float = 3.0, channels: int = 1
) -> Codes:
    """Codes of a slowly decaying swing (0.5 Hz at 100 Hz), each channel at a level of its own."""
    time_s = np.arange(scans)[:, None] / 100.0
    level = 3000.0 * np.arange(channels)
    motion = amplitude * np.exp(-0.01 * time_s) * np.cos(np.pi * time_s + np.arange(channels))
    random = np.random.default_rng(4)
    return np.rint(motion + level + random.normal(0.0, noise, motion.shape)).astype(np.int64)


def stream(codes: Codes) -> bytes:
    return codes.astype("<i2").tobytes()


def recorded(data: bytes, channels: list[int]) -> bytes:
    """A raw recording of the stream, in pieces of a tenth of a second."""
    stream = BytesIO()
    header = {
        "model": "DI-2108",
        "port": "COM3",
        "channels": channels,
        "rate_hz": 100.0,
        "recorded_at": "2026-01-01T00:00:00+00:00",
    }
    writer = RawWriter(stream, header)
    step = 20 * len(channels)
    for number, at in enumerate(range(0, len(data), step)):
        writer.data(0.1 * (number + 1), data[at : at + step])
    writer.event(0.1, event="stopped", reason="scans")
    return stream.getvalue()


@settings(deadline=None, max_examples=25)
@given(at=st.integers(400, 7500), lost=st.sampled_from([1, 3]))
def test_behind_a_lost_byte_every_good_sample_is_true(at: int, lost: int) -> None:
    codes = swing()
    data = stream(codes)
    recording = decode_recording(recorded(data[:at] + data[at + lost :], [1]))
    assert any("bytes slipped at 1 places" in note for note in recording.notes)
    assert recording.quality is not None
    assert np.any(recording.quality == MISSING)
    assert np.any(recording.quality == SUSPECT)
    good = recording.quality == 0
    before = recording.time_s < at / 200.0 - 0.1
    # Three bytes may take two scans with them, of which the bytes tell of one only.
    truth = codes[:, 0] * 10.0 / 32768
    kept = recording.values[good & before]
    assert np.array_equal(kept, truth[: len(kept)])
    after = recording.values[good & ~before]
    assert np.array_equal(after[-200:], truth[-200:])
    assert set(recording.values[good].tolist()) <= set(truth.tolist())
    assert abs(len(recording) - len(codes)) <= 1


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_the_channels_stay_in_their_places(channels: int) -> None:
    codes = swing(channels=channels)
    data = stream(codes)
    at = 4000 * channels + 1
    raw = recorded(data[:at] + data[at + 1 :], list(range(1, channels + 1)))
    for channel in range(channels):
        recording = decode_recording(raw, channel + 1)
        truth = codes[:, channel] * 10.0 / 32768
        assert np.array_equal(recording.values[-1000:], truth[-1000:])


def test_channels_that_read_alike_are_said_to_be_a_guess() -> None:
    codes = np.hstack([swing(), swing()])
    data = stream(codes)
    (slip,) = find_slips(data[:8001] + data[8002:], 2)
    assert slip.reason == "slip, channels unsure"
    notes = decode_recording(recorded(data[:8001] + data[8002:], [1, 2])).notes
    assert any("behind 1 of them which channel is which is a guess" in note for note in notes)


def test_a_byte_too_many_and_a_second_slip_are_found() -> None:
    data = stream(swing(8000))
    slipped = data[:5001] + b"\x55" + data[5001:11000] + data[11001:]
    first, second = find_slips(slipped, 1)
    assert first.last_byte <= 5001 <= first.next_byte
    assert second.last_byte <= 11001 <= second.next_byte


@settings(deadline=None)
@given(
    amplitude=st.floats(0, 32000),
    noise=st.floats(0, 300),
    rate=st.floats(2e-3, 1.0),
    bits=st.sampled_from([12, 14, 16]),
    clip=st.floats(100, 32767),
)
def test_a_whole_stream_is_left_alone(
    amplitude: float, noise: float, rate: float, bits: int, clip: float
) -> None:
    step = 1 << (16 - bits)
    random = np.random.default_rng(5)
    motion = amplitude * np.sin(rate * np.arange(3000)) + random.normal(0.0, noise, 3000)
    codes = np.rint(np.clip(motion, -clip, clip) / step).astype(np.int64) * step
    assert not list(find_slips(stream(np.clip(codes, -32768, 32768 - step)[:, None]), 1))


@pytest.mark.parametrize(
    "codes",
    [
        np.random.default_rng(1).integers(-32768, 32768, 6000),
        np.where(np.arange(6000) // 50 % 2, 256, 0),
        np.rint(256 * np.rint(100 * np.sin(np.arange(6000) / 30))),
        np.clip(40000 * np.sin(np.arange(6000) / 50), -32768, 32767),
        np.where(np.random.default_rng(2).random(6000) < 0.01, 30000, 0),
        np.zeros(6000),
    ],
    ids=["white", "square", "multiples of 256", "clipped", "spikes", "still"],
)
def test_odd_signals_are_no_slips(codes: NDArray[np.float64]) -> None:
    assert not list(find_slips(stream(np.rint(codes).astype(np.int64)[:, None]), 1))


def test_whole_words_and_short_streams_are_not_told() -> None:
    data = stream(swing())
    assert not list(find_slips(data[:3000] + data[3002:], 1))
    assert not list(find_slips(data[:60], 1))
    assert not list(find_slips(b"", 1))


@pytest.mark.parametrize("slope", [-40.0, 0.0, 7.0])
def test_words_on_a_straight_line_go_on_along_it_behind_a_gap(slope: float) -> None:
    """Eight words, six scans thrown away about the slip, and the mean of the eight behind."""
    ahead = slope * np.arange(8 + 6 + 8)[:, None]
    assert slips._onwards(ahead[:8]) == pytest.approx(ahead[14:].mean(axis=0))
