"""A result is whole or absent."""

import os
import threading
from pathlib import Path

import numpy as np
import pytest

from pendpipe.errors import DamagedError
from pendpipe.files import read_json, replaced, write_json


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_text("# made_by: pendpipe 0\n")
    with pytest.raises(RuntimeError), replaced(path) as stream:
        stream.write("half")
        raise RuntimeError
    assert path.read_text() == "# made_by: pendpipe 0\n"
    assert list(tmp_path.iterdir()) == [path]


def test_json_has_null_where_there_is_no_finite_value(tmp_path: Path) -> None:
    content = {"a": np.float64("nan"), "b": [1.0, float("inf")], "c": np.arange(2)}
    write_json(tmp_path / "x.json", content)
    assert read_json(tmp_path / "x.json") == {"a": None, "b": [1.0, None], "c": [0, 1]}


@pytest.mark.parametrize("content", ["", '{"a": 1', "[" * 100_000, "\x00"])
def test_a_torn_json_is_named_in_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "fit.json"
    path.write_text(content)
    with pytest.raises(DamagedError, match=r"fit\.json: ") as caught:
        read_json(path)
    assert "\n" not in str(caught.value)


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("this system has no named pipes")
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text(encoding="utf-8")))
    reader.start()
    with replaced(pipe) as stream:
        stream.write("time_s,volts\n")
    reader.join(10)
    assert got == ["time_s,volts\n"]
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]
