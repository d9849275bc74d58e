"""The example campaign, made once for all tests of the figures."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest


def load_example() -> ModuleType:
    """Load the example beside this file, under whatever folder the tests run."""
    name = "pendpipe_example_campaign"
    if name not in sys.modules:
        place = Path(__file__).with_name("example")
        spec = importlib.util.spec_from_file_location(
            name, place / "__init__.py", submodule_search_locations=[str(place)]
        )
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture(scope="session")
def example(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A finished campaign of 27 records: its folder, files and content."""
    return load_example().make_example(tmp_path_factory.mktemp("campaign"))
