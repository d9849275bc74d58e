"""The example campaign, made once for all tests of the figures."""

from collections.abc import Callable
from typing import Any

import pytest


@pytest.fixture(scope="session")
def example(tmp_path_factory: pytest.TempPathFactory, make_example: Callable[..., Any]) -> Any:
    """A finished campaign of 27 records: its folder, files and content."""
    return make_example(tmp_path_factory.mktemp("campaign"))
