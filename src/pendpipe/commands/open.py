"""Open a page on this machine: drop recordings, see the sheet of each and the table of all.

The page answers at 127.0.0.1 alone, and only to its whole address, which holds a secret word. It
loads nothing from a network. Each recording is analysed as by pendpipe page and pendpipe fit, in a
process of its own with limits of time and memory. Ctrl-C ends it and removes the copies of what
was dropped; a FILE that is named is read where it lies.
"""

import importlib
import io
import json
import multiprocessing
import os
import re
import secrets
import shlex
import shutil
import signal
import socket
import sys
import threading
import webbrowser
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain, count
from math import degrees
from pathlib import Path, PurePath, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple
from urllib.parse import unquote

from pendpipe.acquisition.view import Shown, thinned
from pendpipe.arguments import Arguments, command, tell
from pendpipe.commands.main import parse
from pendpipe.commands.page import Sheet, sheet_of
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import sealed
from pendpipe.options import INPUT, Number, given
from pendpipe.process import cores
from pendpipe.report.class_table import FORMS, Fitted, class_page, together, write_fits

_LARGEST: Final = 64 << 20
"""Bytes of a dropped file, which is held in memory: an hour at 1 kHz, 16 characters a reading."""
_MEMORY: Final = 4 << 30
"""Bytes that a process may address: the hour at 1 kHz takes 2.6 GB with its sheet."""
_SECONDS: Final = 300.0
"""Until a browser gives an answer up."""
_CHOICES: Final = ("column", "unit", "length", "start", "stop")
"""Options of `pendpipe page` that the page offers."""
_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


@command(
    {
        "files": {"metavar": "FILE", "nargs": "*", "help": "recordings to begin with"} | INPUT,
        "--port": {
            "type": Number(0, whole=True),
            "metavar": "N",
            "default": 0,
            "help": "port of the page (0: any that is free)",
        },
        "--live": {
            "type": Path,
            "metavar": "RAW",
            "help": "also show a recording that is made to this raw file; the page ends with"
            " standard input (acquire --view)",
        },
    }
)
def run(arguments: Arguments) -> None:
    """Serve the page until a signal ends it."""
    # A handler that raised could end the removal of the copies halfway. Whichever thread a signal
    # comes to writes to this socket; a lock would wait on where that is another than this one.
    ended, stop = socket.socketpair()
    stop.setblocking(False)
    with ended, stop, TemporaryDirectory(prefix="pendpipe-") as folder:
        before = signal.set_wakeup_fd(stop.fileno(), warn_on_full_buffer=False)
        try:
            for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
                number = getattr(signal, name, None)
                # A terminal that is closed hangs up, unless nohup has asked for more.
                if number and not (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                    signal.signal(number, lambda *_: None)
            _serve(arguments, Path(folder), ended, stop)
        finally:
            signal.set_wakeup_fd(before)


def _serve(arguments: Arguments, folder: Path, ended: socket.socket, stop: socket.socket) -> None:
    """Serve the page until something has been written to the socket."""
    try:
        door = Door(arguments.port, folder, arguments.files, arguments.live)
    except (OSError, OverflowError) as fault:
        raise InputError(
            f"--port {arguments.port}", f"it can't be used ({fault})", "leave it out"
        ) from None
    with door:
        threading.Thread(target=door.serve_forever, daemon=True).start()
        if arguments.live:
            threading.Thread(target=_until_input_ends, args=(stop,), daemon=True).start()
        tell(f"pendpipe: {door.address} (this machine alone; Ctrl-C ends it)")
        if sys.stderr.isatty() and (os.name == "nt" or _has_screen()):
            webbrowser.open(door.address)
        ended.recv(1)
        door.end()


def _until_input_ends(stop: socket.socket) -> None:
    """End with the recorder, however it ends."""
    os.read(0, 1)
    stop.send(b"\0")


def _has_screen() -> bool:
    """Whether a browser has a window to open; without one some would take the terminal."""
    return sys.platform == "darwin" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())


class Answer(NamedTuple):
    """What is shown of a recording."""

    sheet: Sheet
    columns: Sequence[tuple[int, str]] = ()
    """Number and name of each that may hold the readings."""
    picture: Mapping[str, Any] | None = None
    """All of its readings, thinned, and their unit."""


def answer_to(words: Sequence[str], file: str) -> Answer:
    """Analyse a file as ``pendpipe page WORDS FILE`` does."""
    from pendpipe.reading import inspect, read

    with redirect_stderr(io.StringIO()) as said:
        try:
            arguments = parse(["page", *words, file])
        except SystemExit:
            return _refused(file, said.getvalue().strip().removeprefix("pendpipe page: "))
    sheet = sheet_of(arguments, file)
    arguments.start = arguments.stop = None
    columns, picture = list[tuple[int, str]](), None
    with suppress(InputError):
        found = inspect(file)
        for number, (name, unit) in zip(found.columns, found.channels, strict=True):
            columns.append((number, f"{name} ({unit})" if unit else name))
        recording = read(file, **given(arguments, read))
        usable, angle = recording.usable, recording.unit == "rad"
        points = thinned(recording.time_s[usable], recording.values[usable])
        shown = [(t, degrees(value) if angle else value) for t, value in points]
        picture = {"points": shown, "unit": "°" if angle else recording.unit}
    return Answer(sheet, columns, picture)


def _refused(file: str, reason: str) -> Answer:
    return Answer(Sheet(Fitted(file, None, reason), ""))


def _work(pipe: Any, memory: int, folder: Path | None, words: Sequence[str], file: str) -> None:
    """Answer through a pipe, in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the door ends it
    with suppress(ImportError, ValueError):  # a lower limit holds already; macOS has none
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    import pendpipe.figures.decays
    import pendpipe.report.page  # noqa: F401

    # Now that nothing is looked for there: a dropped file may be called matplotlibrc.
    if folder is not None:
        os.chdir(folder)
    try:
        pipe.send(answer_to(words, file))
    except MemoryError:
        pipe.send(_refused(file, f"it takes more than {memory >> 30} GB; give a part of it"))


class Door(ThreadingHTTPServer):
    """The page, its recordings and their answers.

    Parameters
    ----------
    port
        Where it listens; 0 takes one that is free.
    folder
        For copies of what is dropped.
    files
        Recordings to begin with.
    live
        A raw file that grows, to be shown as well. It is opened for reading alone.
    """

    daemon_threads = True

    def __init__(
        self, port: int, folder: Path, files: Sequence[str] = (), live: Path | None = None
    ) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.host = f"127.0.0.1:{self.server_port}"
        self.token = secrets.token_urlsafe(16)
        self.address = f"http://{self.host}/{self.token}/"
        self._folder, self._count = folder, len(files)
        self._files: dict[int, tuple[Path | None, str]] = {
            number: (None, file) for number, file in enumerate(files, 1)
        }
        self._answers: dict[int, tuple[dict[str, str], Answer]] = {}
        self._asked: dict[int, dict[str, str]] = {}
        """The options that a recording was last asked with; an answer to others comes too late."""
        self._live, self._shown = live, Shown(live) if live else None
        self._places = threading.BoundedSemaphore(cores())
        self._lock, self._ended, self._running = threading.Lock(), False, set[Any]()
        forks = "forkserver" in multiprocessing.get_all_start_methods()
        self._processes: Any = multiprocessing.get_context("forkserver" if forks else "spawn")
        self._processes.set_forkserver_preload(["pendpipe.commands.open", *_USED])
        if forks and not live:  # the recorder comes first
            importlib.import_module("multiprocessing.forkserver").ensure_running()

    def handle_error(self, *given: Any) -> None:
        """Say nothing of a browser that has gone."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(*given)

    def end(self) -> None:
        """Let nothing more be begun or written, and end what runs."""
        with self._lock:
            self._ended = True
            for process in self._running:
                process.kill()
        self.shutdown()

    def answer(self, path: str, body: bytes | None) -> tuple[str, bytes]:
        """Return type and content of what is asked for; KeyError where there is no such thing."""
        what, _, which = path.partition("/")
        if body is not None:
            posts = {"files": self._take, "read": self._read, "forget": self._forget}
            return _json(posts[what](which, body))
        if what == "" and not which:
            return _html(_page(self._live))
        if what == "live" and self._shown:
            with self._lock:
                return _json(self._shown.state())
        if what == "files":
            return _json(list(self._files))
        if what == "sheet":
            return _html(sealed(self._answers[int(which)][1].sheet.page))
        numbers = sorted(self._answers.keys() & self._files.keys())
        fits = [self._answers[number][1].sheet.fitted for number in numbers]
        if what == "commands":
            return _json(self._commands(numbers))
        if what == "class":
            return _html(class_page(fits, [f"sheet/{number}" for number in numbers]))
        return self._table(what, fits)

    def _take(self, name: str, body: bytes) -> int:
        """Keep what was dropped, in a folder of its own, and return its number."""
        path = PurePosixPath(unquote(name).replace("\\", "/"))
        with self._lock:
            self._count += 1
            folder, number = self._folder / str(self._count), self._count
            # A browser keeps the folders of what is dropped to itself.
            taken = {PurePath(file).name for _, file in self._files.values()}
            others = (f"{path.stem} ({n}){path.suffix}" for n in count(2))
            name = next(each for each in chain([path.name], others) if each not in taken)
            if not self._ended:
                folder.mkdir()
                (folder / name).write_bytes(body)
            self._files[number] = folder, f"./{name}" if name.startswith("-") else name
        return number

    def _read(self, which: str, body: bytes) -> dict[str, Any]:
        """Analyse a recording by the options in the body; without them show what is known."""
        number, asked = int(which), json.loads(body) if body else None
        refuse_if(not isinstance(asked, dict | None), "options", "no JSON object", "send one")
        folder, file = self._files[number]
        known = self._answers.get(number)
        if asked is not None or known is None:
            options = {name: str(value) for name, value in (asked or {}).items()}
            self._asked[number] = options
            known = options, self._made(folder, _words(options), file)
            if self._asked.get(number) is options:
                self._answers[number] = known
        options, (sheet, columns, picture) = known
        return {
            "name": file,
            "options": options,
            "columns": columns,
            "picture": picture,
            "sheet": sheet.page,
            "refusal": sheet.fitted.refusal,
            "notes": sheet.notes,
            "command": shlex.join(["pendpipe", "page", *_words(options), file]),
        }

    def _commands(self, numbers: Sequence[int]) -> str:
        """Return the commands that give the same: one for all that are read in one way."""
        ways: dict[tuple[str, ...], list[str]] = {}
        for number in numbers:
            options = self._answers[number][0]
            ways.setdefault(tuple(_words(options)), []).append(self._files[number][1])
        return "\n".join(shlex.join(["pendpipe", "page", *words, *ways[words]]) for words in ways)

    def _forget(self, which: str, _: bytes) -> None:
        """Take a recording out, with its copy."""
        folder = self._files.pop(int(which))[0]
        self._asked.pop(int(which), None)
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)  # with the rest, where somebody reads in it

    def _made(self, folder: Path | None, words: Sequence[str], file: str) -> Answer:
        """Let a process of its own answer, within its limits."""
        with self._places:
            ours, theirs = self._processes.Pipe(duplex=False)
            job = self._processes.Process(target=_work, args=(theirs, _MEMORY, folder, words, file))
            with self._lock:
                if self._ended:
                    return _refused(file, "the page has ended")
                job.start()
                self._running.add(job)
            theirs.close()
            try:
                if ours.poll(_SECONDS):
                    return ours.recv()  # type: ignore[no-any-return]
                return _refused(file, f"it takes more than {_SECONDS:.0f} s; give a part of it")
            except EOFError:
                return _refused(file, "its analysis broke off; the terminal says why")
            finally:
                job.kill()
                job.join()
                with self._lock:
                    self._running.discard(job)

    def _table(self, name: str, fits: Sequence[Fitted]) -> tuple[str, bytes]:
        """Return the table of a class in the form that its name's suffix asks for."""
        if name not in {f"class{suffix}" for suffix in FORMS}:
            raise KeyError(name)
        found = [
            {"file": each.file}
            | (each.fit.to_dict() if each.fit else {"error": f"{each.file}: {each.refusal}"})
            for each in fits
        ]
        with self._lock:
            refuse_if(self._ended, name, "the page has ended", "open it again")
            write_fits(
                self._folder / name,
                fits,
                {"schema_version": 1, "fits": found, "together": together(fits)},
            )
            return "application/octet-stream", (self._folder / name).read_bytes()


class _Handler(BaseHTTPRequestHandler):
    """Answers this page's own requests and no other."""

    server: Door
    timeout = 60.0

    def do_GET(self) -> None:
        """Give what is known."""
        if self._is_ours():
            self._answer(None)

    def do_POST(self) -> None:
        """Take a file, or do what is asked."""
        if not self._is_ours():
            return
        length = self.headers.get("Content-Length", "")
        # int() counts no more than 4,300 digits.
        if not re.fullmatch("[0-9]{1,9}", length) or int(length) > _LARGEST:
            self.send_error(413, "Too large", "give its name to pendpipe open")
            return
        body = self.rfile.read(int(length))
        if len(body) == int(length):
            self._answer(body)

    def _is_ours(self) -> bool:
        """Whether the page itself asks: its host, its origin, its token."""
        door, headers = self.server, self.headers
        own = headers.get_all("Host") == [door.host]
        own &= headers.get("Origin", f"http://{door.host}") == f"http://{door.host}"
        own &= secrets.compare_digest(self.path[1:].partition("/")[0].encode(), door.token.encode())
        if not own:
            self.send_error(403)
        return own

    def _answer(self, body: bytes | None) -> None:
        try:
            kind, content = self.server.answer(self.path[1:].partition("/")[2], body)
        except (KeyError, ValueError, OSError, InputError, RecursionError) as fault:
            self.send_error(404, "Not found", str(fault))
            return
        self.send_response(200)
        for name, value in {"Content-Type": kind, **_HEADERS}.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Say nothing: the address is a secret."""


_USED: Final = ("pendpipe.api", "pendpipe.figures.decays", "pendpipe.report.page")
"""What an analysis imports, read once for all."""


def _words(options: Mapping[str, str]) -> list[str]:
    """Return the options of `pendpipe page`, which diagnoses unless it is told not to."""
    words = [f"--{name}={options[name]}" for name in _CHOICES if options.get(name)]
    return words if options.get("diagnosis") else ["--no-diagnosis", *words]


def _page(live: Path | None) -> str:
    from pendpipe.report import own_files
    from pendpipe.templates import render

    shown = {"largest": _LARGEST, "live": live and live.name}
    return render("pendpipe.report", "open.html", **shown, **own_files("open.js"))


def _html(text: str) -> tuple[str, bytes]:
    return "text/html; charset=utf-8", text.encode()


def _json(content: Any) -> tuple[str, bytes]:
    return "application/json", json.dumps(content, allow_nan=False).encode()
