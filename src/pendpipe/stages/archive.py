"""Archives: what the job of a chunk leaves, one file that holds its records' results.

A zip of ``<record>/<file>``, and of each record what its stage was done with (`Made`), so that a
record that is done is not done again. As in every file of ours there is a digest of all other bytes
in it: whether it is whole is seen from the file alone.
"""

import json
import shutil
import zipfile
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from pendpipe.errors import DamagedError
from pendpipe.files import MADE_BY, damage_of, replaced, writing

FOLDER: Final = "chunks"
_INDEX: Final = "made.json"
Made = Mapping[str, Any]
"""Settings, code, and the hashes of the results that were read."""


def pack(path: Path, folder: Path, files: Iterable[Path], made: Mapping[str, Made]) -> None:
    """Write an archive of files that lie in `folder`; the same files give the same bytes."""
    with replaced(path, "wb") as stream, zipfile.ZipFile(stream, "w") as archive:
        archive.comment = f"\0made by {MADE_BY}\0".encode()
        archive.writestr(zipfile.ZipInfo(_INDEX), json.dumps(made, sort_keys=True))
        for file in sorted(files):
            entry = zipfile.ZipInfo(file.relative_to(folder).as_posix())
            archive.writestr(entry, file.read_bytes(), zipfile.ZIP_DEFLATED, compresslevel=1)


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an archive that is whole.

    Raises
    ------
    DamagedError
        If it is not; it is then set aside.
    """
    if path.is_file() and (damage := damage_of(path)):
        raise DamagedError(
            path, f"{damage.problem}, {damage.set_aside()}", "run snakemake again: it is made anew"
        )
    with zipfile.ZipFile(path) as archive:
        yield archive


def unpack(path: Path, folder: Path, wanted: Callable[[str], bool] = bool) -> None:
    """Write the files of an archive into `folder`, those whose name is wanted.

    What is damaged there is set aside.
    """
    with _opened(path) as archive, writing(force=True):
        for name in filter(wanted, _members(archive)):
            if (folder / name).is_file() and (damage := damage_of(folder / name)):
                damage.set_aside()
            with archive.open(name) as source, replaced(folder / name, "wb") as target:
                shutil.copyfileobj(source, target, 1 << 20)


def _members(archive: zipfile.ZipFile) -> list[str]:
    return [name for name in archive.namelist() if name != _INDEX]


def members(path: Path) -> list[str]:
    """The names of the files in an archive, ``<record>/<file>``; none where it is not whole."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _members(archive)
    except (OSError, zipfile.BadZipFile):
        return []


def made_in(path: Path) -> dict[str, Made]:
    """What the records of an archive were made with; nothing where there is none that is whole."""
    if not path.is_file() or damage_of(path):
        return {}
    with zipfile.ZipFile(path) as archive:
        found: dict[str, Made] = json.loads(archive.read(_INDEX))
    return found


def take_over(path: Path, folder: Path, wanted: Mapping[str, Made]) -> set[str]:
    """Write the files of the records that were made with what is wanted, and name them."""
    made = made_in(path)
    same = {name for name in wanted if made.get(name) == wanted[name]}
    if same:
        unpack(path, folder, lambda name: name.partition("/")[0] in same)
    return same


def archives(results: Path, stage: str) -> list[Path]:
    """The archives that a stage has left, the newest last."""
    found = (Path(results, FOLDER)).glob(f"{stage}-*.zip")
    return sorted(found, key=lambda path: path.stat().st_mtime_ns)


def gather(results: Path, folder: Path, names: Container[str]) -> None:
    """Write these files of all records (``fit.json``), or of one (``one/fit.json``), into `folder`.

    Of a record that is in two archives (`batch` or `only` has changed) the newest counts.
    """
    for path in archives(results, "*"):
        unpack(path, folder, lambda name: name in names or name.partition("/")[2] in names)


@contextmanager
def gathered(results: Path, *names: str) -> Iterator[Path]:
    """Yield a folder with these files of all records, while it is needed (`gather`).

    Without archives that of the results: it may be all that somebody has of a campaign.
    """
    with TemporaryDirectory(prefix="pendpipe-") as place:
        gather(results, Path(place), names)
        yield Path(place) if archives(results, "*") else results
