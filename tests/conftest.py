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
