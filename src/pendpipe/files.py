"""Files that are whole or absent, and that replace nothing that is not ours to replace.

Everything that is written passes `check_output`, the one place that decides. An input is never
replaced, nor an instrument's raw file; what pendpipe did not make, only with ``--force``. What
it makes says so inside (`MADE_BY`), and that is how it is known again.
"""

import hashlib
import io
import json
import math
import os
import re
import secrets
import shutil
import sys
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, partial
from itertools import islice
from pathlib import Path, PurePath
from typing import IO, Any, Final, NamedTuple

from pendpipe.errors import DamagedError, InputError, UnwritableError, refuse_if
from pendpipe.version import __version__

_BLANK: Final = 16 * "0"
MADE_BY: Final = f"pendpipe {__version__} sha256:{_BLANK}"
"""What stands in every file that can be made again. In the place of the zeros `replaced` writes the
first digits of the hash of all other bytes: so it is seen when somebody has edited the file."""
MARK: Final = "made_by"
"""Its key in JSON and in the head of a table."""
RECORDED_BY: Final = "recorded_by"
"""The key in a recording that an instrument has made: it is the user's own, as its raw file is."""
_BY: Final = r'pendpipe(?: [^\s"<>)\0:]+)?(?: sha256:([0-9a-f]{16}))?'
"""Files of earlier versions have no digest."""
_IN_TEXT: Final = rf'{_BY}(?=[\r\n"<])'
"""Nothing else stands behind it: what is left of a damaged digest makes no earlier version."""
_SVG: Final = r"\A(?:<\?xml[^>]*>\s*)?(?:<!DOCTYPE svg[^>]*>\s*)?<svg[^>]*>\s*"
_HTML: Final = (
    r'\A<!doctype html>(?:\s*<(?:html|head|meta)[^<>]*>)*?\s*<meta name="generator" content="'
)
_BEGINNINGS: Final = (
    rf'\A\ufeff?\{{\s*"made_by": ?"{_IN_TEXT}"',  # JSON
    rf"\A\ufeff?(?:#.*\r?\n)*# made_by: {_IN_TEXT}",  # a table
    # One for spreadsheets, which know no remarks: the last cell of its first row.
    rf'\A(?:record|file),[^\n]*,made_by\n(?:"(?:[^"]|"")*"|[^"\n])*,{_IN_TEXT}',
    rf"\A% made_by: {_IN_TEXT}",  # LaTeX
    rf"{_HTML}{_IN_TEXT}",
    rf"{_SVG}<metadata>(?s:.){{0,600}}?<dc:title>{_IN_TEXT}",
    rf"\A\x89PNG(?s:.){{0,200}}?tEXtSoftware\0{_BY}(?=(?s:.){{8}}[A-Za-z]{{4}})",
    # Of earlier versions alone.
    r'\A\{\n "schema_version": 1,\n "',
    r"\A\ufeff?# refused: ",
    r'\A"record","fluid","branch","pendulum","T0_s",',
    r"\A\ufeff?file,light,T0_s,T0_sd_s,[^\n]*,remark\r?\n",
    rf"{_SVG}<desc>pendpipe\b",
)
_ENDINGS: Final = (
    rf"/Creator \({_BY}\)(?s:.)*%%EOF\s*\Z",  # PDF
    rf"\0made by {_BY}\0\Z",  # behind the last comment of WinDaq, or the remark of an archive
    rf"\x07made_by\x18.{_BY}(?s:.)*PAR1\Z",
)
_ENDS: Final = 1 << 15
"""So many bytes at either end are searched for marks."""
_BLOCK: Final = 1 << 20
"""So many are hashed at a time."""
_RAW: Final = re.compile(rb'\A\{"format": "pendpipe-raw"')
_RECORDED: Final = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:#.*\r?\n)*?# recorded_by: pendpipe ")
_OUT: Final = ("-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")
_STREAM: Final = re.compile(r"/dev/stderr|(/dev|/proc/self)/fd/\d+")


@dataclass(frozen=True)
class _Call:
    """What one call reads, and whether it may replace files of others."""

    inputs: tuple[str | Path, ...] = ()
    force: bool = False


_NOTHING: Final = _Call()
_CALL: Final[ContextVar[_Call]] = ContextVar("_CALL", default=_NOTHING)


@contextmanager
def writing(*, inputs: Iterable[str | Path] = (), force: bool = False) -> Iterator[None]:
    """Name what a call reads, for as long as it writes.

    Parameters
    ----------
    inputs
        Files that no output may be, beside those of an outer call; ``-`` is standard input.
    force
        Replace files that pendpipe did not make.
    """
    outer = _CALL.get()
    token = _CALL.set(_Call((*outer.inputs, *inputs), outer.force or force))
    try:
        yield
    finally:
        _CALL.reset(token)


def check_output(path: str | Path) -> None:
    """Refuse an output that is not ours to replace.

    Streams, devices and pipes are no files, and nothing of them is lost. An empty file may be
    replaced as well.

    Raises
    ------
    InputError
        If it is one of the inputs by any name or link, the raw file of an instrument, or,
        without ``--force``, a file that pendpipe did not make.
    """
    call, target = _CALL.get(), Path(path)
    if is_stream(path) or not target.is_file():
        return
    refuse_if(
        any(_same_file(target, given) for given in call.inputs),
        target,
        "this output is one of the inputs",
        "name another file",
    )
    with _named(target), target.open("rb") as stream:
        head = stream.read(_ENDS)
        found = _seal(stream)
        edited = found is not None and found.stated not in ("", _BLANK, found.digest)
    refuse_if(
        _RAW.search(head),
        target,
        "it holds the raw bytes of an instrument, which nothing replaces",
        "name another file",
    )
    remedy = "name another one, or add --force to replace it"
    if head and not call.force:
        refuse_if(
            _RECORDED.match(head),
            target,
            "it is a recording",
            "name another file; --force replaces this table, its raw file stays",
        )
        refuse_if(found is None, target, "pendpipe did not make this file", remedy)
        refuse_if(edited, target, "it was edited since pendpipe made it", remedy)
        if found is not None and found.stated in ("", _BLANK):
            _tell_of_earlier_versions(target)


_TOLD: Final = list[Path]()


def _tell_of_earlier_versions(target: Path) -> None:
    """Say, once a process, that what somebody may have edited in a file is replaced."""
    if not _TOLD:
        _TOLD.append(target)
        problem = "an earlier version made it, which cannot tell whether it was edited since"
        print(f"pendpipe: {target}: {problem}; it is replaced, as are others", file=sys.stderr)


@cache
def _compiled(patterns: tuple[str, ...]) -> re.Pattern[bytes]:
    """Compile them as one for bytes, when a file is first looked at."""
    return re.compile("|".join(patterns).encode().replace(rb"\ufeff", rb"(?:\xef\xbb\xbf)"))


class _Seal(NamedTuple):
    """The digest in a file that says who made it."""

    stated: str
    """What stands there; empty where there is no place for it."""
    digest: str
    """What should, by all other bytes."""
    start: int
    """Where."""
    check: bytes
    """In a PNG the checksum of the chunk, which stands behind it."""


def _seal(stream: IO[bytes]) -> _Seal | None:
    """Find who made a file, and hash it without that digest; None where nothing says so."""
    size = stream.seek(0, os.SEEK_END)
    for start, patterns in ((0, _BEGINNINGS), (max(0, size - _ENDS), _ENDINGS)):
        stream.seek(start)
        part = stream.read(_ENDS)
        if (match := _compiled(patterns).search(part)) is not None:
            break
    else:
        return None
    if match.lastindex is None:
        return _Seal("", "", 0, b"")
    begin, end = (start + at for at in match.span(match.lastindex))
    chunk = part[part.rindex(b"tEXt", 0, match.end()) : match.end()] if part[1:4] == b"PNG" else b""
    summed = hashlib.sha256()
    rest = end + (4 if chunk else 0)
    for first, last in ((0, begin), (rest, size)):
        stream.seek(first)
        while block := stream.read(min(_BLOCK, last - stream.tell())):
            summed.update(block)
    digest = summed.hexdigest()[: len(_BLANK)]
    sealed = chunk.removesuffix(_BLANK.encode()) + digest.encode()
    check = zlib.crc32(sealed).to_bytes(4) if chunk else b""
    return _Seal(match[match.lastindex].decode(), digest, begin, check)


def _fill_in(stream: IO[bytes]) -> None:
    """Write the digest into a file where its place is still blank."""
    found = _seal(stream)
    if found is not None and found.stated == _BLANK:
        stream.seek(found.start)
        stream.write(found.digest.encode() + found.check)


SET_ASIDE: Final = ".damaged-"
"""Stands in the name of a damaged file, before the first digits of its hash."""


class Damage(NamedTuple):
    """A result that is not as it was written."""

    path: Path
    problem: str
    found: str
    """First digits of the hash of what is there now."""

    def __str__(self) -> str:
        return f"{self.path}: {self.problem}; a run sets it aside and makes it again"

    def set_aside(self) -> str:
        """Give the file another name beside its own, and say which."""
        kept = self.path.with_name(f"{self.path.name}{SET_ASIDE}{self.found}")
        try:
            self.path.replace(kept)
        except FileNotFoundError:
            return "it is made again"
        except OSError as fault:
            problem = f"{self.problem}, and it can't be renamed ({fault.strerror})"
            raise InputError(self.path, problem, "make the folder writable") from None
        return f"set aside as {kept.name}"


def damage_of(path: Path) -> Damage | None:
    """What is wrong with a result, by the digest in it; None where it is sound or nobody can tell.

    Nobody can of a recording that an instrument has made, nor of what an earlier version wrote.
    """
    with _named(path), path.open("rb") as stream:
        found = _seal(stream)
        stream.seek(0)
        recorded = found is None and _RECORDED.match(stream.read(_ENDS))
    if recorded or (found and found.stated in ("", found.digest)):
        return None
    problem = "it is torn or altered" if path.stat().st_size else "it is empty"
    return Damage(path, problem, (sha256(path) or "")[:8])


def sealed(text: str) -> str:
    """Write the digest into a text that says who made it."""
    stream = io.BytesIO(text.encode("utf-8", "replace"))
    _fill_in(stream)
    return stream.getvalue().decode()


def is_stream(path: str | Path) -> bool:
    """Whether a name stands for a stream: ``-`` and ``/dev/stdout`` are no files."""
    return str(path) in _OUT or _STREAM.fullmatch(str(path)) is not None


def _same_file(target: Path, given: str | Path) -> bool:
    """Whether two names mean the same file."""
    try:
        status = os.fstat(0) if str(given) in ("-", "/dev/stdin") else Path(given).stat()
    except (OSError, ValueError):
        return False
    return os.path.samestat(status, target.stat())


@contextmanager
def replaced(path: str | Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a temporary file that takes the place of `path` only when all went well.

    Parameters
    ----------
    path
        The file to write; its folder is made where it is missing.
    mode
        ``"w"`` for text (UTF-8, line feeds on every system) or ``"wb"``.

    Raises
    ------
    InputError
        Where no file can be written: no folder, no right to it, a folder of that name, no
        room on the disk, or a file that is not ours to replace (`check_output`).
    """
    # A name of a file may be no UTF-8; where it is quoted, the bytes that are none become "?".
    text: dict[str, Any] = (
        {} if "b" in mode else {"encoding": "utf-8", "errors": "replace", "newline": "\n"}
    )
    if str(path) in _OUT:
        # Kept until its digest is known.
        with tempfile.TemporaryFile(mode + "+", **text) as stream:
            yield stream
            stream.flush()
            _fill_in(getattr(stream, "buffer", stream))
            stream.seek(0)
            shutil.copyfileobj(stream, sys.stdout.buffer if "b" in mode else sys.stdout)
        return
    target = Path(path)
    make_folder(target.parent)
    try:
        refuse_if(target.is_dir(), target, "this is a folder", "name a file in it")
        check_output(target)
        if is_stream(target) or (target.exists() and not target.is_file()):
            # A device or a pipe is written to: it is not for us to replace it.
            with target.open(mode, **text) as stream:
                yield stream
            return
        temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
        beside = temporary.open(mode.replace("w", "x") + "+", **text)
    except OSError as fault:
        raise _cannot_write(target, fault) from None
    try:
        with beside:
            yield beside
            beside.flush()
            _fill_in(getattr(beside, "buffer", beside))
        temporary.replace(target)
    except BaseException as fault:
        with suppress(OSError):  # on a disk that has gone, say
            temporary.unlink(missing_ok=True)
        if isinstance(fault, OSError) and fault.filename in (None, str(temporary)):
            raise _cannot_write(target, fault) from None
        raise


def is_file(path: Path) -> bool:
    """Whether there is such a file, whatever stands in its name."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, a folder that nobody may enter
        return False


_MOST_NAMES: Final = 10_000
"""Of files among which a misspelt one is looked for."""


def names_in(folder: Path) -> list[str]:
    """The names in a folder; none where it can't be read."""
    try:
        return [path.name for path in islice(folder.iterdir(), _MOST_NAMES)]
    except (OSError, ValueError):
        return []


def make_folder(path: str | Path) -> None:
    """Make a folder for results, with those above it.

    Raises
    ------
    InputError
        Where it can't be made: a file has its name, or the user has no right to it.
    """
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(path, "this is a file, not a folder", "name another folder") from None
    except OSError as fault:
        raise _cannot_write(path, fault) from None


def check_writable(folder: str | Path) -> None:
    """Make a folder for results and see that files can be made in it.

    Raises
    ------
    InputError
        If they can't: no right to write, or a disk that is only read.
    """
    make_folder(folder)
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as fault:
        raise _cannot_write(folder, fault) from None


def _cannot_write(path: str | Path, fault: OSError) -> UnwritableError:
    reason = fault.strerror or str(fault)
    return UnwritableError(path, f"it can't be written ({reason})", "name another place")


def plain(value: Any, *, only_finite: bool = False) -> Any:
    """Return what JSON has for a value, at any depth: dictionaries, lists, numbers and strings.

    A dataclass and a named tuple become their fields (`fields_of`), what has ``as_json`` what that
    returns, numpy scalars and arrays numbers and lists; of finite numbers only, others are None.

    >>> plain({"sizes": (2.5, math.nan)}, only_finite=True)
    {'sizes': [2.5, None]}
    """
    if hasattr(value, "as_json"):
        value = value.as_json()
    elif is_dataclass(value) or hasattr(value, "_asdict"):
        value = fields_of(value)
    elif hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(each, only_finite=only_finite) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each, only_finite=only_finite) for each in value]
    lacks = only_finite and isinstance(value, float) and not math.isfinite(value)
    return None if lacks else value


finite: Final = partial(plain, only_finite=True)


def fields_of(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass or a named tuple by the names that they have in JSON.

    A field's metadata may hold another name than its own (``json``); of None it is left out, and
    of "" its own fields stand among the others.
    """
    if not is_dataclass(value):
        return dict(value._asdict())
    found: dict[str, Any] = {}
    for each in fields(value):
        there, own = each.metadata.get("json", each.name), getattr(value, each.name)
        found |= fields_of(own) if there == "" else {there: own} if there else {}
    return found


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file of which all is there, or nothing."""
    with replaced(path, "wb" if isinstance(content, bytes) else "w") as stream:
        stream.write(content)


def json_text(content: Mapping[str, Any]) -> str:
    """Return `content` as indented JSON that says who made it; what is not finite is null."""
    marked = {MARK: MADE_BY, **plain(content, only_finite=True)}
    return json.dumps(marked, indent=1, ensure_ascii=False, allow_nan=False)


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write `content` as indented JSON; a number without a finite value becomes null."""
    write_whole(path, json_text(content) + "\n")


def read_json(path: str | Path) -> Any:
    """Read a JSON file that a stage has written.

    Raises
    ------
    InputError
        If there is no such file.
    DamagedError
        If it is no JSON: empty, torn or altered.
    """
    place = Path(path)
    try:
        content = json.loads(place.read_bytes())
    except FileNotFoundError:
        raise InputError(place, "there is no such file", "run the stage that makes it") from None
    except OSError as fault:
        raise InputError(place, f"it can't be read ({fault.strerror})", "check the path") from None
    except (ValueError, RecursionError) as fault:
        problem = f"this is no JSON ({fault})" if place.stat().st_size else "it is empty"
        raise DamagedError(place, problem, "delete it and run again") from None
    if isinstance(content, dict):
        content.pop(MARK, None)
    return content


def read_text(path: str | Path, remedy: str, *, absent: str = "file", form: str = "a table") -> str:
    """Read a text file: UTF-8, with a byte-order mark or without.

    Raises
    ------
    InputError
        If there is none, or it is no text.
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, f"there is no such {absent}", remedy) from None
    except (OSError, UnicodeDecodeError) as fault:
        reason = getattr(fault, "strerror", fault)
        raise InputError(path, f"it can't be read ({reason})", f"give {form} in UTF-8") from None


def digest(content: Any) -> str:
    """Hash any JSON-like content, the same on every machine and in any order of its keys.

    Short enough for a parameter of a rule, or a file's name.

    >>> digest({"a": 1, "b": [2, 3]}) == digest({"b": [2, 3], "a": 1}) != digest({"a": 1})
    True
    """
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def sha256(path: str | Path) -> str | None:
    """Hash a file's content; None where it can't be read, as the job that reads it says."""
    with suppress(OSError), Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
    return None


@contextmanager
def _named(path: str | Path) -> Iterator[None]:
    """Let an error of reading name its file, as one of opening does."""
    try:
        yield
    except OSError as fault:
        fault.filename = fault.filename or str(path)
        raise


_PATH: Final = re.compile(r"(?<![\w./\\])(?:[A-Za-z]:[\\/]|~?/|\.{1,2}/)[^\s'\"(),;]+")
"""An absolute path, or one that begins at a dot; not the slash of V/rad."""


def without_folders(text: str) -> str:
    """Keep the names of files and drop the folders: they are the user's own business.

    >>> without_folders("/home/rdp/data/run 7.csv, line 3: no number")
    'run 7.csv, line 3: no number'
    """
    return _PATH.sub(lambda found: PurePath(found.group().replace("\\", "/")).name, text)


def told_apart(files: Sequence[str | Path]) -> list[str]:
    """Return the names of files, with as many of their folders as tell them apart.

    >>> told_apart(["runs/a/decay.csv", "runs/b/decay.csv", "runs/b/swing.csv"])
    ['a/decay.csv', 'b/decay.csv', 'swing.csv']
    """
    ends = [
        [PurePath(*parts[-n:]).as_posix() for n in range(1, len(parts) + 1)]
        for parts in (Path(file).parts for file in files)
    ]
    counts = Counter(end for one in ends for end in set(one))
    return [next((end for end in one if counts[end] == 1), one[-1]) for one in ends]


def distinct_names(files: Sequence[str | Path]) -> list[str]:
    """Return what tells files apart: their paths without the folders and the name they share.

    >>> distinct_names(["runs/a/decay.csv", "runs/b/decay.csv"])
    ['a', 'b']
    """
    rows = [Path(file).parts for file in files]
    for end, rest in ((0, slice(1, None)), (-1, slice(None, -1))):
        while min(map(len, rows)) > 1 and len({row[end] for row in rows}) == 1:
            rows = [row[rest] for row in rows]
    return ["/".join(row) for row in rows]
