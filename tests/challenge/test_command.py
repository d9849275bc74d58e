"""`pendpipe challenge` comes with the package beside the library, and only with it."""

import importlib.metadata
import tomllib
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from pendpipe import cli

ROOT = Path(__file__).parents[2]
GROUP = "pendpipe.commands"

Install = Callable[..., None]


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Install:
    """Have exactly these commands come from other packages."""

    def only(*found: EntryPoint) -> None:
        def entry_points(*, group: str) -> tuple[EntryPoint, ...]:
            assert group == GROUP
            return found

        monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)

    return only


def declared() -> EntryPoint:
    """The challenge's command as its own package declares it."""
    with (ROOT / "challenge" / "pyproject.toml").open("rb") as stream:
        (entry,) = tomllib.load(stream)["project"]["entry-points"][GROUP].items()
    return EntryPoint(*entry, GROUP)


def called(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    try:
        status = cli.main(words)
    except SystemExit as ended:
        status = int(str(ended.code))
    return status, *capsys.readouterr()


def test_without_its_package_the_command_says_what_installs_it(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install()
    status, _, line = called(["challenge", "make", "set"], capsys)
    assert status == 2
    assert "not installed" in line
    assert "pip install --editable ./challenge" in line
    assert line.count("\n") == 1


def test_help_lists_the_command_where_it_is_installed_and_nowhere_else(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install()
    assert "challenge" not in called(["--help"], capsys)[1]
    install(declared())
    assert "\n  challenge " in called(["--help"], capsys)[1]


def test_a_call_that_cannot_be_understood_is_one_line(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install(declared())
    words = ["challenge", "make", "d", "--sealed", "s", "--items", "x"]
    status, _, line = called(words, capsys)
    assert status == 2
    assert "'x' is no whole number" in line
    assert line.count("\n") == 1


def test_the_wheel_of_the_library_leaves_the_challenge_out() -> None:
    assert not list((ROOT / "src").rglob("*challenge*.py"))
