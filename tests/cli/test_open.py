"""The page of `pendpipe open` answers itself alone, as `fit` does, and leaves nothing behind."""

import http.client
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import quote

import pytest

from pendpipe.cli import main
from pendpipe.commands import open as opening
from pendpipe.commands.open import Door

ROOT = Path(__file__).parents[2]
EXAMPLES = ("rod-pendulum.csv", "string-pendulum.csv")


class Browser:
    """What a browser sends to a door, and what anybody else might."""

    def __init__(self, door: Door) -> None:
        self.door = door

    def ask(
        self, path: str, body: bytes | None = None, **headers: str
    ) -> tuple[int, bytes, dict[str, str]]:
        """Ask for a path behind the token; a header's name has _ for -."""
        return self.send(f"/{self.door.token}/{path}", body, **headers)

    def send(
        self, path: str, body: bytes | None = None, **headers: str
    ) -> tuple[int, bytes, dict[str, str]]:
        line = http.client.HTTPConnection("127.0.0.1", self.door.server_port, timeout=60)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        line.request("GET" if body is None else "POST", path, body, named)
        answer = line.getresponse()
        found = answer.status, answer.read(), dict(answer.headers)
        line.close()
        return found

    def drop(self, file: Path) -> int:
        return int(self.ask(f"files/{quote(file.name)}", file.read_bytes())[1])

    def read(self, number: int, **options: str) -> dict[str, Any]:
        body = json.dumps(options).encode() if options else b""
        return dict(json.loads(self.ask(f"read/{number}", body)[1]))


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Door(0, tmp_path_factory.mktemp("open")) as door:
        threading.Thread(target=door.serve_forever, daemon=True).start()
        yield Browser(door)
        door.end()


def test_nobody_else_is_answered(browser: Browser) -> None:
    """No token, a wrong one, a name that was made to point here, the page of somebody else."""
    host = browser.door.host
    assert browser.ask("files")[0] == 200
    assert browser.ask("files", Origin=f"http://{host}")[0] == 200
    for path in ("/", "/files", f"/{browser.door.token[:-1]}/files", f"/x/{browser.door.token}/"):
        status, body, _ = browser.send(path)
        assert (status, browser.door.token.encode() in body) == (403, False)
    for name, value in (
        ("Host", "evil.example"),
        ("Host", f"evil.example:{browser.door.server_port}"),
        ("Host", f"localhost.evil.example:{browser.door.server_port}"),
        ("Origin", "http://evil.example"),
        ("Origin", "null"),
        ("Origin", f"https://{host}"),
    ):
        assert browser.ask("files", **{name: value})[0] == 403
        assert browser.ask("files/a.csv", b"1,2\n", **{name: value})[0] == 403
    assert json.loads(browser.ask("files")[1]) == []


def test_what_is_no_upload_is_refused_before_it_is_read(browser: Browser) -> None:
    for length in (str(opening._LARGEST + 1), "-1", "many", "", "9" * 5000):
        line = http.client.HTTPConnection("127.0.0.1", browser.door.server_port, timeout=10)
        line.putrequest("POST", f"/{browser.door.token}/files/a.csv")
        line.putheader("Content-Length", length)
        line.endheaders()
        assert line.getresponse().status == 413
        line.close()
    for path in ("sheet/99", "sheet/..%2f", "read", "class.pdf", "../files", "answer/1"):
        assert browser.ask(path)[0] == 404
    for path in ("read/99", "files/", "files/..", "files/%00", "forget/99", "nothing/1"):
        assert browser.ask(path, b"1,2\n")[0] == 404


def test_what_is_no_question_is_refused(browser: Browser, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"1,2\n")
    number = browser.drop(tmp_path / "a.csv")
    for body in (b"[]", b"1", b'"unit"', b"{", b"\xff", b"[" * 100_000):
        assert browser.ask(f"read/{number}", body)[0] == 404
    browser.ask(f"forget/{number}", b"")


def test_two_files_of_one_name_are_told_apart(browser: Browser, tmp_path: Path) -> None:
    numbers = list[int]()
    for name in ("swing.csv", "swing.csv", "-a", "-a", "swing.csv"):
        (tmp_path / name).write_bytes(b"no\nnumbers\n")
        numbers.append(browser.drop(tmp_path / name))
    names = [browser.door._files[number][1] for number in numbers]
    assert names == ["swing.csv", "swing (2).csv", "./-a", "./-a (2)", "swing (3).csv"]
    for number in numbers:
        browser.ask(f"forget/{number}", b"")


def test_its_answers_load_nothing_from_elsewhere(browser: Browser) -> None:
    _, page, headers = browser.ask("")
    assert b"default-src 'none'" in page
    assert re.findall(rb"""(?:src|href)=["']?(?:https?:)?//""", page) == []
    assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert headers["Referrer-Policy"] == "no-referrer"


@pytest.mark.slow
def test_a_dropped_file_is_answered_as_by_fit_and_by_page(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Byte for byte: the sheet, and the table in every form of text."""
    monkeypatch.chdir(tmp_path)
    for name in EXAMPLES:
        Path(name).write_bytes((ROOT / "examples" / name).read_bytes())
    numbers = [browser.drop(Path(name)) for name in EXAMPLES]
    choice = {"column": "2", "unit": "deg", "length": "1.0", "start": "10", "stop": "50"}
    answers = [browser.read(numbers[0]), browser.read(numbers[1], **choice)]
    assert [answer["refusal"] for answer in answers] == ["", ""]
    assert answers[1]["columns"] == [[2, "angle (deg)"]]
    assert len(answers[1]["picture"]["points"]) > 500
    assert answers[1]["picture"]["points"][0][0] < 10, "the part is chosen from the whole"
    for number, answer, name in zip(numbers, answers, EXAMPLES, strict=True):
        words = shlex.split(answer["command"])
        assert words[:2] == ["pendpipe", "page"]
        assert main(words[1:]) == 0
        assert Path(name).with_suffix(".html").read_bytes() == browser.ask(f"sheet/{number}")[1]
        assert answer["sheet"].count("<svg") > 1
    browser.read(numbers[1], column="")
    assert main(["fit", *EXAMPLES, "--out", "class.csv"]) == 0
    assert browser.ask("class.csv")[1] == Path("class.csv").read_bytes()
    assert (
        json.loads(browser.ask("commands")[1])
        == f"pendpipe page --no-diagnosis {' '.join(EXAMPLES)}"
    )


@pytest.mark.slow
def test_what_is_wrong_is_said_and_no_more(browser: Browser, tmp_path: Path) -> None:
    """A file that is none, a bad option, a name that looks like an option or like a module."""
    for name, content, said in (
        ("-.csv", b"no\nnumbers\n", "./-.csv"),
        ("matplotlibrc", b"backend: nonsense\n", ""),
        ("a b.csv", b"\x89PNG", "this is a picture"),
    ):
        (tmp_path / name).write_bytes(content)
        number = browser.drop(tmp_path / name)
        answer = browser.read(number)
        assert answer["sheet"] == ""
        assert answer["refusal"]
        assert said in answer["refusal"] + answer["command"]
        assert str(browser.door._folder) not in json.dumps(answer)
        assert browser.ask(f"forget/{number}", b"")[0] == 200
    number = browser.drop(ROOT / "examples" / EXAMPLES[0])
    assert "--length" in browser.read(number, length="none")["refusal"]
    assert "no sample" in browser.read(number, start="900")["refusal"]
    assert browser.read(number, command="rm")["refusal"] == "", "an option that is not offered"


def test_a_late_answer_to_an_earlier_question_takes_the_place_of_none(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A diagnosis that was given up for a quick reading; a file that was taken out."""
    begun, go = threading.Event(), threading.Event()

    def made(_: Any, words: list[str], file: str) -> opening.Answer:
        if "--unit=deg" in words:
            begun.set()
            assert go.wait(30)
        return opening.Answer(opening.Sheet(opening.Fitted(file, None, "none"), ""))

    monkeypatch.setattr(browser.door, "_made", made)
    (tmp_path / "slow.csv").write_bytes(b"1,2\n")
    one, other = browser.drop(tmp_path / "slow.csv"), browser.drop(tmp_path / "slow.csv")
    for number, then in ((one, "rad"), (other, "")):
        begun.clear()
        go.clear()
        slow = threading.Thread(target=browser.read, args=(number,), kwargs={"unit": "deg"})
        slow.start()
        assert begun.wait(30)
        if then:
            browser.read(number, unit=then)
        else:
            assert browser.ask(f"forget/{number}", b"")[0] == 200
            assert not (browser.door._folder / str(number)).exists(), "its copy goes with it"
        go.set()
        slow.join()
    assert browser.read(one)["options"] == {"unit": "rad"}
    assert other not in browser.door._answers
    browser.ask(f"forget/{one}", b"")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limit", "said"), [("_SECONDS", "more than 0 s"), ("_MEMORY", "broke off|more than 0 GB")]
)
def test_an_analysis_that_takes_too_much_is_ended(
    browser: Browser, monkeypatch: pytest.MonkeyPatch, limit: str, said: str
) -> None:
    """Whatever a limit does to it, the page goes on."""
    number = browser.drop(ROOT / "examples" / EXAMPLES[0])
    with monkeypatch.context() as patch:
        patch.setattr(opening, limit, 1 << 20 if limit == "_MEMORY" else 0.0)
        assert re.search(said, browser.read(number, start="0")["refusal"])
    assert browser.read(number, start="0")["refusal"] == ""
    assert browser.door._running == set()


def test_a_limit_of_memory_that_cannot_be_set_stops_no_analysis(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As where the user has set a lower one, and on macOS."""
    resource = pytest.importorskip("resource")
    fault = ValueError("not allowed to raise maximum limit")
    monkeypatch.setattr(resource, "setrlimit", lambda *_: (_ for _ in ()).throw(fault))
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    said = list[opening.Answer]()
    opening._work(SimpleNamespace(send=said.append), 1 << 32, None, [], "absent.csv")
    assert "no such file" in said[0].sheet.fitted.refusal.lower()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_it_and_its_copies_and_so_do_two(name: str, tmp_path: Path) -> None:
    """While a file is analysed, and whatever is sent while it ends; a closed terminal hangs up."""
    if sys.platform == "win32":
        pytest.skip("signals end no process there as they do elsewhere")
    number = getattr(signal, name)
    process = subprocess.Popen(
        [sys.executable, "-m", "pendpipe", "open"],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        # A suite that runs under nohup hands down that a hangup is ignored.
        preexec_fn=partial(signal.signal, number, signal.SIG_DFL),
    )
    assert process.stderr is not None
    found = re.search(r"http://(127\.0\.0\.1:(\d+))/(\S+)/", process.stderr.readline())
    assert found
    line = http.client.HTTPConnection(found[1], timeout=60)
    file = ROOT / "examples" / EXAMPLES[0]
    line.request("POST", f"/{found[3]}/files/{file.name}", file.read_bytes())
    assert line.getresponse().read() == b"1"
    assert [each.name for each in tmp_path.rglob("*.csv")] == [file.name]
    line.request("POST", f"/{found[3]}/read/1", b"")
    for _ in range(5):
        process.send_signal(number)
    assert process.wait(30) == 0
    assert list(tmp_path.glob("pendpipe-*")) == []
    assert process.stderr.read() == ""
    process.stderr.close()
    line.close()


@pytest.mark.slow
def test_a_signal_ends_it_whichever_thread_it_comes_to(tmp_path: Path) -> None:
    """The system chooses among those of a process."""
    if sys.platform == "win32":
        pytest.skip("signals end no process there as they do elsewhere")
    code = """if True:
        import os, signal, sys, threading
        from pendpipe.cli import main

        def sent():
            os.read(0, 1)
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)

        threading.Thread(target=sent, daemon=True).start()
        sys.exit(main(["open"]))"""
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    ) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        assert "http://127.0.0.1" in process.stderr.readline()
        try:
            process.stdin.write("\n")
            process.stdin.flush()
            assert process.wait(20) == 0
        finally:
            process.kill()
    assert list(tmp_path.glob("pendpipe-*")) == []


def test_a_port_that_is_taken_is_refused_in_a_line(
    browser: Browser, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert main(["open", "--port", str(browser.door.server_port)]) == 2
    assert re.fullmatch(r"pendpipe: --port \d+: .*leave it out\n", capsys.readouterr().err)
