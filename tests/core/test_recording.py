"""A recording survives the disk unchanged, and a faulty one is refused with its line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.errors import InputError
from pendpipe.recording import Recording, read_plain, write_plain

finite = st.floats(-1e300, 1e300, allow_nan=False)


@given(values=st.lists(finite, min_size=1, max_size=50), start=st.floats(-1e6, 1e6))
@settings(max_examples=50)
def test_every_digit_survives_the_disk(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], start: float
) -> None:
    path = tmp_path_factory.mktemp("plain") / "recording.csv"
    time = start + 0.01 * np.arange(len(values))
    quality = np.arange(len(values), dtype=np.uint8) % 3
    readings = np.where(quality == 2, np.nan, values)
    metadata = {"source": "a: b", "bits": "16"}
    recording = Recording(time, readings, "volts", quality=quality, metadata=metadata)
    write_plain(path, recording)
    again = read_plain(path)
    assert again.usable.tolist() == (quality < 2).tolist()
    np.testing.assert_array_equal(again.time_s, time)
    np.testing.assert_array_equal(again.values, recording.values)
    assert again.quantity == "volts"
    assert dict(again.metadata) == dict(recording.metadata)


def test_volts_become_radians_by_the_sensor_constant(tmp_path: Path) -> None:
    """3.85 V is one radian, and the converter's step shrinks with it."""
    (tmp_path / "v.csv").write_text(
        "# volts_per_radian: 3.85\n# bits: 16\n# range_volts: 10\ntime_s,volts\n0,3.85\n1,0\n"
    )
    motion = read_plain(tmp_path / "v.csv").as_motion()
    assert motion.values.tolist() == [1.0, 0.0]
    assert motion.resolution == pytest.approx(20 / 2**16 / 3.85, rel=1e-15)


FAULTS = {
    "missing column": ("time,volts\n0,1\n", "line 1", "time_s is missing"),
    "no reading": ("time_s,current\n0,1\n", "line 1", "exactly one of"),
    "two readings": ("time_s,volts,angle_rad\n0,1,2\n", "line 1", "exactly one of"),
    "text in a number": ("time_s,volts\n0,1\n1,two\n", "line 3", "'two' is no number"),
    "short row": ("time_s,volts\n0,1\n1\n", "line 3", "1 cells, not 2"),
    "time falls": ("time_s,volts\n0,1\n2,1\n1,1\n", "line 4", "does not rise"),
    "time repeats": ("time_s,volts\n0,1\n0,1\n", "line 3", "does not rise"),
    "NaN": ("time_s,volts\n0,1\n1,nan\n", "line 3", "NaN or infinite"),
    "empty": ("", "", "is empty"),
    "only a header": ("time_s,volts\n", "", "no samples"),
    "odd quality": ("time_s,volts,quality\n0,1,7\n", "line 2", "not 0, 1 or 2"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_file_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, place, said = FAULTS[name]
    path = tmp_path / "faulty.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_plain(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert place in message
    assert said in message
    assert "\n" not in message


def test_volts_without_a_sensor_constant_stay_volts_and_say_so() -> None:
    recording = Recording(np.arange(3.0), np.zeros(3), "volts")
    motion = recording.as_motion()
    assert motion.unit == "V"
    assert "--volts-per-radian" in motion.weak_guesses[0]
    assert motion.as_motion().weak_guesses == motion.weak_guesses
    assert recording.as_motion(2.0).unit == "rad"
    with pytest.raises(InputError, match="the sensor constant is 0"):
        Recording(
            np.arange(3.0), np.zeros(3), "volts", metadata={"volts_per_radian": "0"}
        ).as_motion()


def test_arrays_in_memory_are_a_recording() -> None:
    recording = Recording(time_s=[0, 1, 2], volts=[0.1, 0.2, 0.1], volts_per_radian=2.0)
    assert recording.values.dtype == np.float64
    np.testing.assert_array_equal(recording.as_motion().values, [0.05, 0.1, 0.05])


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"angle_rad": [1.0, 2.0]}, "3 times and 2 readings"),
        ({"angle_rad": [1.0, 2.0, 3.0], "volts": [1.0, 2.0, 3.0]}, "exactly one quantity"),
        ({}, "exactly one quantity is needed, not none"),
        ({"values": [1.0, 2.0, 3.0], "quantity": "deg"}, "quantity 'deg'"),
        ({"angle_rad": ["a", "b", "c"]}, "angle_rad holds no numbers"),
        ({"angle_rad": [1.0, float("nan"), 3.0]}, "sample 1: 1 value"),
        ({"time_s": [2.0, 1.0, 0.0], "angle_rad": [1.0, 2.0, 3.0]}, "time_s does not rise"),
        ({"time_s": [[0.0, 1.0]], "angle_rad": [1.0, 2.0]}, "2 dimensions"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(arguments: dict, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        Recording(**({"time_s": [0.0, 1.0, 2.0]} | arguments))


def test_a_reading_of_any_unit_keeps_it_in_the_plain_form(tmp_path: Path) -> None:
    recording = Recording(
        np.arange(3.0),
        np.array([4.0, 5.0, 6.0]),
        "reading",
        metadata={"unit": "counts"},
        weak_guesses=("the column is a guess",),
    )
    write_plain(tmp_path / "counts.csv", recording)
    again = read_plain(tmp_path / "counts.csv")
    assert (again.quantity, again.unit) == ("reading", "counts")
    assert again.as_motion() is again
    assert again.weak_guesses == recording.weak_guesses
    assert dict(again.metadata) == {"unit": "counts"}
    np.testing.assert_array_equal(again.values, recording.values)


@given(cut=st.integers(1, 40))
def test_the_last_row_of_a_cut_file_is_no_sample(
    cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Wherever it was cut: a number without its last digits would be a wrong reading."""
    path = tmp_path_factory.mktemp("cut") / "recording.csv"
    time_s = np.arange(10) / 15.0
    write_plain(path, Recording(time_s, np.sin(time_s), "angle_rad"))
    text = path.read_text()
    path.write_text(text[:-cut])
    again = read_plain(path)
    whole = text[:-cut].count("\n") - 2  # the remark of who made it, and the header
    np.testing.assert_array_equal(again.values, np.sin(time_s[:whole]))
    assert len(again.notes) == (0 if text[:-cut].endswith("\n") else 1)


@pytest.mark.parametrize("level", [np.pi, 2 * np.pi, 0.5 * np.pi])
def test_angles_given_as_arrays_hang_at_zero_and_do_not_jump(level: float) -> None:
    time_s = np.arange(400) / 50.0
    angle = 0.8 * np.exp(-0.05 * time_s) * np.cos(4.0 * time_s)
    wrapped = (angle + level + np.pi) % (2 * np.pi) - np.pi
    motion = Recording(time_s=time_s, angle_rad=wrapped).as_motion()
    np.testing.assert_allclose(motion.values, angle, atol=1e-12)
    assert motion.as_motion() is motion
    if level != 2 * np.pi:  # so many turns leave nothing to do
        assert "hangs near 0" in motion.notes[-1]


@pytest.mark.parametrize(
    ("level", "unit", "refused"),
    [
        (9.81, "m/s^2", True),
        (-9.7, "m/s^2", True),
        (0.2, "m/s^2", False),
        (9.81, "counts", False),
    ],
)
def test_a_pull_along_the_string_is_refused(level: float, unit: str, refused: bool) -> None:
    """It swings twice in a period; an axis along the swing hangs about zero."""
    time = np.arange(0.0, 20.0, 0.01)
    pull = level + 0.3 * np.exp(-time / 20.0) * np.cos(6.0 * time)
    phone = Recording(time, pull, "reading", metadata={"unit": unit})
    if not refused:
        assert phone.as_motion() is phone
        return
    with pytest.raises(InputError, match=r"twice in a period; give the axis along the swing"):
        phone.as_motion()
