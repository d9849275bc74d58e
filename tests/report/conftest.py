"""The example campaign of the figures' tests, with its page rendered once."""

from collections.abc import Callable
from typing import Any

import pytest


@pytest.fixture(scope="session")
def example(tmp_path_factory: pytest.TempPathFactory, make_example: Callable[..., Any]) -> Any:
    """A finished campaign of 27 records with a figure drawn, and one record's decay."""
    from pendpipe.figures.campaign import draw_fig09
    from pendpipe.figures.data import read_decay
    from pendpipe.figures.decays import draw_decay
    from pendpipe.figures.style import save

    made = make_example(tmp_path_factory.mktemp("campaign"))
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
