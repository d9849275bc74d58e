"""What all tests share: examples of hypothesis depend on the code alone, and not on its speed.

``--hypothesis-profile=untimed`` draws new ones.
"""

import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# Snakemake's plugin for Slurm asks the cluster as it is imported, and waits ten seconds for one
# that is down; with no configuration it asks none.
os.environ["SLURM_CONF"] = os.devnull
settings.register_profile("untimed", deadline=None)
settings.register_profile("same", settings.get_profile("untimed"), derandomize=True)
settings.load_profile("same")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests come first: no process waits for another, or makes a campaign twice."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


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
