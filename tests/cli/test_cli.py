"""The command line: help for each command, one line and status 2 for a user's fault."""

import subprocess
import sys
from collections.abc import Callable
from inspect import signature
from pathlib import Path

import pytest

import pendpipe as pp
from pendpipe import cli
from pendpipe.options import OPTIONS


@pytest.mark.parametrize("name", cli.COMMANDS | cli.STAGES)
def test_every_command_says_what_it_does(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([name, "--help"])
    assert ended.value.code == 0
    assert cli.command_of(name).description.splitlines()[0] in capsys.readouterr().out


@pytest.mark.parametrize("verb", [pp.read, pp.acquire, pp.fit, pp.diagnose, pp.simulate])
def test_a_keyword_and_its_option_have_the_same_words(verb: Callable[..., object]) -> None:
    said = " ".join((verb.__doc__ or "").split()).lower()
    assert "{" not in said.partition("examples")[0]
    shared = {
        option.keyword or flag.lstrip("-").replace("-", "_"): option.help
        for flag, option in OPTIONS.items()
    }
    # A box's channel is its number, a model to simulate is a file, points are measured ones.
    others = {(pp.acquire, "channel"), (pp.simulate, "model"), (pp.fit, "points")}
    for keyword in signature(verb).parameters.keys() & shared.keys():
        if (verb, keyword) not in others:
            assert f"{keyword} {' '.join(shared[keyword].split())}.".lower() in said


def test_a_mistyped_command_gets_the_nearest_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["inspekt"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "did you mean 'pendpipe inspect'?" in err


def test_no_arguments_show_where_to_begin(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 0
    assert "pendpipe fit FILE" in capsys.readouterr().out


def test_a_users_fault_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = cli.main(["simulate", str(tmp_path / "none.toml"), str(tmp_path / "out.csv")])
    message = capsys.readouterr().err
    assert status == 2
    assert message.count("\n") == 1
    assert "none.toml" in message
    assert list(tmp_path.iterdir()) == []


def test_the_entry_point_imports_no_heavy_library() -> None:
    """A job's cost is its imports: the command line alone brings none of these."""
    heavy = {"numpy", "scipy", "pandas", "matplotlib", "numba", "pydantic", "serial"}
    code = "import sys, pendpipe.cli; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not heavy & set(loaded.stdout.split())


def test_the_package_itself_can_be_run() -> None:
    command = [sys.executable, "-m", "pendpipe", "inspekt"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "did you mean 'pendpipe inspect'?" in done.stderr


def test_bash_completes_commands_and_their_options() -> None:
    complete = (
        f'source <("{sys.executable}" -m pendpipe completion bash);'
        " COMP_WORDS=({}); COMP_CWORD={};"
        ' _shtab_pendpipe; echo "${{COMPREPLY[@]}}"'
    )
    for words, position, expected in (
        ("pendpipe diagn", 1, "diagnose diagnose-campaign"),
        ("pendpipe fit --restor", 2, "--restoring"),
        ("pendpipe completion z", 2, "zsh"),
    ):
        done = subprocess.run(
            ["bash", "-c", complete.format(words, position)],
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.split() == expected.split()
