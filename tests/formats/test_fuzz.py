"""Whatever the bytes: a clean error in one line, or a valid recording."""

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from scipy.io import savemat

from pendpipe.errors import InputError
from pendpipe.formats import inspect, read
from pendpipe.recording import check

from .cases import WindaqFile, swing

TIME, ANGLE = swing(60, 10.0)
_COUNTS = np.rint(ANGLE * 8000).astype(np.int64)[:, None]
SEEDS = {
    "a.csv": "t,theta\n" + "".join(f"{t:.2f},{x:.5f}\n" for t, x in zip(TIME, ANGLE, strict=True)),
    "b.csv": "Zeit;Weg\n" + "".join(f"{t:.2f};{x:.5f}\n" for t, x in zip(TIME, ANGLE, strict=True)),
    "c.csv": "time_s,angle_rad\n" + "".join(f"{t},{x}\n" for t, x in zip(TIME, ANGLE, strict=True)),
    "d.cso": "start\n" + "sc 1 2\n" * 30 + "stop\n",
    "e.csv": "Relative Time,Date,Time Stamp UTC,Volt,Events\n"
    + "".join(f"{t:.2f},1/1/2026,1:00:00 PM,{x:.5f},\n" for t, x in zip(TIME, ANGLE, strict=True)),
}
BYTES = {name: text.encode() for name, text in SEEDS.items()}
_MATLAB = io.BytesIO()
savemat(_MATLAB, {"t": TIME, "s": {"theta": ANGLE, "name": "free"}, "c": [1, "two"]})
BYTES |= {
    "h.mat": _MATLAB.getvalue(),
    "f.WDQ": WindaqFile(_COUNTS).pack(),
    "g.WHC": WindaqFile(_COUNTS, True).pack(),
}

clean = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


def hold(path: Path) -> None:
    """Read and inspect; only an `InputError` of one line may come out."""
    for call in (read, inspect):
        try:
            result = call(path)
        except InputError as fault:
            said = str(fault)
            if "\n" in said:
                pytest.fail(f"more than one line: {said!r}")
        else:
            if call is read:
                check(path, result)  # type: ignore[arg-type]


@clean
@given(data=st.binary(max_size=3000), name=st.sampled_from(["a.csv", "a.WDH", "a.mat", "a.xlsx"]))
def test_any_bytes(tmp_path: Path, data: bytes, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    hold(path)


@clean
@given(text=st.text(alphabet='0123456789.,;- \t\ne"#tθx:', max_size=400))
def test_any_text_that_looks_like_a_table(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text, encoding="utf-8")
    hold(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", BYTES)
@clean
@given(
    changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=6),
    cut=st.none() | st.integers(0, 10**6),
)
def test_damaged_files(
    tmp_path: Path, name: str, changes: list[tuple[int, int]], cut: int | None
) -> None:
    data = bytearray(BYTES[name])
    for place, value in changes:
        data[place % len(data)] = value
    path = tmp_path / name
    path.write_bytes(bytes(data[: cut % len(data)] if cut is not None else data))
    hold(path)
