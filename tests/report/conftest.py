"""The example campaign of the figures' tests, with its page rendered once."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest


def load_example() -> ModuleType:
    """Load the figures' example, under whatever folder the tests run."""
    name = "pendpipe_example_campaign"
    if name not in sys.modules:
        place = Path(__file__).parents[1] / "figures" / "example"
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
    """A finished campaign of 27 records with a figure drawn, and one record's decay."""
    from pendpipe.figures.campaign import draw_fig09
    from pendpipe.figures.decays import draw_decay, read_decay
    from pendpipe.figures.style import save

    made = load_example().make_example(tmp_path_factory.mktemp("campaign"))
    save(draw_fig09(made.content), made.folder / "figures" / "fig09")
    for entry in made.content["records"][:2]:
        found = read_decay(made.folder, entry)
        save(draw_decay(found), made.folder / entry["record"] / "figures" / "decay", dpi=80)
    return made


@pytest.fixture(scope="session")
def page(example: Any) -> str:
    """The example's page."""
    import json

    from pendpipe.report.page import render

    configuration = json.loads(example.campaign.read_text())
    return render(
        configuration,
        example.content,
        {"schema_version": 1},
        example.folder,
        example.folder / "figures",
    )
