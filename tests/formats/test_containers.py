"""MATLAB and Excel files hold the same swing as the text beside them."""

from __future__ import annotations

import tracemalloc
import zipfile
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
from scipy.io import savemat

from pendpipe.errors import InputError
from pendpipe.formats import ReadOptions, inspect, read, table, trees

from .decays import swing

TIME, ANGLE = swing()


def test_matlab_arrays_go_by_their_names(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"t": TIME, "theta2": ANGLE[:, None], "u": np.zeros(5), "note": "free"})
    recording = read(path)
    np.testing.assert_allclose(recording.time_s, TIME)
    np.testing.assert_allclose(recording.values, ANGLE)
    assert any("another length" in note for note in recording.notes)


def test_simulink_logs_with_pi_below_are_counted_from_below(tmp_path: Path) -> None:
    def log(values: object) -> dict[str, object]:
        return {"time": TIME[:, None], "signals": {"values": values, "dimensions": 1}}

    path = tmp_path / "a.mat"
    savemat(path, {"Distance": log(np.zeros((800, 1))), "Theta1": log((ANGLE + np.pi)[:, None])})
    recording = read(path)
    np.testing.assert_allclose(recording.values, ANGLE, atol=1e-12)
    assert any("1 half turn" in note for note in recording.notes)
    assert inspect(path).format == "matlab-v5"


def test_a_matrix_with_time_in_front_and_a_rate_beside_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"data": np.column_stack([TIME, ANGLE])})
    np.testing.assert_allclose(read(path).values, ANGLE)
    savemat(path, {"angle": ANGLE, "fs": 50.0})
    np.testing.assert_allclose(read(path).time_s, TIME)


@pytest.mark.parametrize("member", ["experiment.cap", "Main.xml", "data/17.tmp"])
def test_a_project_of_capstone_is_to_be_exported_first(tmp_path: Path, member: str) -> None:
    path = tmp_path / "project.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, "x")
        archive.writestr("notes.csv", "t,x\n0,1\n1,2\n2,3\n")
    with pytest.raises(InputError, match="Capstone; export its data"):
        read(path)


@pytest.mark.filterwarnings("error")
def test_a_clock_that_is_infinite_twice_is_left_out_without_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    clock = TIME.copy()
    clock[1:3] = np.inf
    savemat(path, {"t": clock, "theta": ANGLE})
    np.testing.assert_allclose(read(path).time_s, np.delete(TIME, [1, 2]))


def test_matlab_73_and_junk_are_refused_clearly(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform" + b" " * 200)
    with pytest.raises(InputError, match="file of arrays can't be read"):
        read(path)
    savemat(path, {"t": TIME, "theta": ANGLE})
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InputError, match="can't be read"):
        read(path)


def test_what_unpacks_to_more_than_any_recording_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"t": TIME, "theta": ANGLE, "more": np.zeros(20_000)}, do_compression=True)
    book = openpyxl.Workbook()
    book.active.append(["t", "angle"])
    book.save(tmp_path / "a.xlsx")
    assert len(read(path)) == len(TIME)
    monkeypatch.setattr(trees, "most_unpacked", lambda _: 9_000)
    with pytest.raises(InputError, match="its compressed data are more than 0 MB"):
        read(path)
    monkeypatch.setattr(table, "most_unpacked", lambda _: 9_000)
    with pytest.raises(InputError, match="it unpacks to 0 MB"):
        read(tmp_path / "a.xlsx")


@pytest.mark.parametrize("form", ["npz", "h5"])
def test_arrays_are_counted_before_they_are_unpacked(tmp_path: Path, form: str) -> None:
    """Three hundred megabytes of zeros pack into three hundred kilobytes."""
    path, zeros = tmp_path / f"a.{form}", np.zeros(40_000_000)
    if form == "npz":
        np.savez_compressed(path, time_s=TIME, angle_rad=zeros)
    else:
        with h5py.File(path, "w") as file:
            file.create_dataset("angle_rad", data=zeros, chunks=(10**6,), compression="gzip")
    del zeros
    tracemalloc.start()
    with pytest.raises(InputError, match="it unpacks to 305 MB"):
        read(path)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 50e6


@pytest.mark.parametrize("header", [None, ["Zeit [s]", "Winkel [°]"], ["t", "theta (deg)"]])
def test_excel_with_or_without_a_header(tmp_path: Path, header: list[str] | None) -> None:
    book = openpyxl.Workbook()
    notes, sheet = book.active, book.create_sheet("swing")
    assert notes is not None
    notes.append(["measured on a Monday"])
    if header:
        sheet.append(["Experiment 3"])
        sheet.append(header)
    for t, x in zip(TIME.tolist(), np.degrees(ANGLE).tolist(), strict=True):
        sheet.append([t, x])
    path = tmp_path / "a.xlsx"
    book.save(path)
    recording = read(path)
    np.testing.assert_allclose(recording.values, ANGLE)
    assert recording.notes[0] == "sheet 'swing'"
    assert inspect(path).format == "excel"


def test_a_cell_of_text_is_named_by_its_row(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row, (t, x) in enumerate(zip(TIME.tolist(), ANGLE.tolist(), strict=True), start=1):
        sheet.append([t, "lost" if row % 42 == 0 else x])
    path = tmp_path / "a.xlsx"
    book.save(path)
    with pytest.raises(InputError, match="line 42: 'lost' is no number"):
        read(path)


def test_a_broken_archive_and_an_old_workbook_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    path.write_bytes(b"PK\x03\x04 nothing of use")
    with pytest.raises(InputError, match="archive can't be read"):
        read(path)
    path.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 600)
    with pytest.raises(InputError, match="workbook can't be read"):
        read(path, ReadOptions())
