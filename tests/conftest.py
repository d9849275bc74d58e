"""What all tests share: examples of hypothesis depend on the code alone, and not on its speed.

``--hypothesis-profile=untimed`` draws new ones. Of each test its processor time is known, that of
the processes that it has waited for as well: a busy machine makes no test slow.
"""

import importlib.util
import os
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import settings

# Snakemake's plugin for Slurm asks the cluster as it is imported, and waits ten seconds for one
# that is down; with no configuration it asks none.
os.environ["SLURM_CONF"] = os.devnull
# Here and in what tests start compiled modules are kept, as they are where users run them: without,
# tests take twice as long to be found, and each of some 200 processes half as long again to begin.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
settings.register_profile("untimed", deadline=None)
settings.register_profile("same", settings.get_profile("untimed"), derandomize=True)
settings.load_profile("same")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files slow as a whole come first: no process waits for another, or makes a campaign twice."""

    def quick(item: pytest.Item) -> bool:
        module = item.getparent(pytest.Module)
        return module is None or all(mark.name != "slow" for mark in module.own_markers)

    items.sort(key=quick)


SLOW_S: Final = 0.5
"""Processor seconds from which on a test carries the mark `slow`."""
MARGIN: Final = 2.0
"""A processor whose other thread is busy, or that is half as fast, takes so many times as long."""


def cpu_s() -> float:
    """Processor time of this process and of those that it has waited for."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """Note a test's processor time, without that of what its fixtures share."""
    began = cpu_s()
    try:
        return (yield)
    finally:
        item.user_properties.append(("cpu_s", cpu_s() - began))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that should carry the mark `slow`: ``pytest -m "not slow"`` is to be quick.

    With ``--durations=20`` also the twenty that took most processor time, on a busy machine too.
    """
    calls = [one for one in terminalreporter.getreports("passed") if one.when == "call"]
    took = {one.nodeid: dict(one.user_properties)["cpu_s"] for one in calls}
    quick = {one.nodeid for one in calls if "slow" not in one.keywords}
    asked = terminalreporter.config.getoption("durations") or 0
    for place, name in enumerate(sorted(took, key=took.__getitem__, reverse=True)):
        late = name in quick and took[name] > MARGIN * SLOW_S
        if late or place < asked:
            words = f"{name}: {took[name]:.1f} s of processor" + ": mark it slow" * late
            terminalreporter.line(words, yellow=late)


@pytest.fixture(scope="session")
def panel_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the answers of a run lie: the folders of its processes stand in one."""
    own = tmp_path_factory.getbasetemp()
    return (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "panel"


@pytest.fixture(scope="session")
def panel(panel_folder: Path) -> Callable[[str], dict[str, Any]]:
    """What is answered about a recording of `benchmarks.panel`, asked once a run."""
    from benchmarks.panel import absent, once

    def answer(name: str) -> dict[str, Any]:
        if absent(name):
            pytest.skip("no ../shared/recordings here")
        return once(panel_folder, name)

    return answer


@pytest.fixture(scope="session")
def make_example() -> Callable[..., Any]:
    """What makes the example campaign of tests/figures, under whatever folder the tests run."""
    name = "pendpipe_example_campaign"
    if name not in sys.modules:
        place = Path(__file__).parent / "figures" / "example"
        spec = importlib.util.spec_from_file_location(
            name, place / "__init__.py", submodule_search_locations=[str(place)]
        )
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name].make_example  # type: ignore[no-any-return]


@pytest.fixture
def answer_of(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """What a command prints, which has to end with that status."""

    def answer(words: list[str], status: int = 0) -> Any:
        from pendpipe.cli import main

        assert main(words) == status
        return capsys.readouterr()

    return answer


@pytest.fixture
def refusal_of(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str]], str]:
    """The one line with which a call ends, and status 2; what is indented reports progress."""

    def refusal(words: list[str]) -> str:
        from pendpipe.cli import main

        try:
            status = main(words)
        except SystemExit as ended:
            status = int(str(ended.code))
        said = [line for line in capsys.readouterr().err.splitlines() if line[:2] != "  "]
        assert (status, len(said)) == (2, 1), said
        return said[0]

    return refusal
