"""What may stand in ``config/config.yaml`` of a campaign that is a table of published numbers."""

from pathlib import Path
from typing import Any, Final

from pydantic import Field, ValidationError

from pendpipe.configuration.load import as_input_error, check_results, read_configuration
from pendpipe.configuration.models import Section

CONFIGURATION: Final = Path("config/config.yaml")


class Case(Section):
    """One question to a table: the fluids as they are held to be, and which rows count."""

    title: str = Field(description="what is asked")
    viscosity_m2_per_s: dict[str, float] = Field(description="kinematic viscosity of each fluid")
    relative_sd: float = Field(gt=0.0, description="its relative standard deviation")
    without: list[str] = Field([], description="groups of rows that do not count")
    unverified: bool = Field(False, description="whether rows of unsure digits count")


class Published(Section):
    """A campaign without recordings: a table of printed numbers, and what is asked of it."""

    title: str = Field(description="who measured what, and when")
    source: str = Field(description="where it is printed")
    cases: list[Case] = Field(min_length=1, description="the questions")
    table: str = Field("config/table.tsv", description="table of the numbers, a row each")
    results: str = Field("results", description="folder of the results")


def load_published(place: str | Path, content: dict[str, Any] | None = None) -> Published:
    """Check a configuration of such a campaign; `content` is what Snakemake has read of it.

    Raises
    ------
    InputError
        On the first error: the place, what is wrong, what to do.
    """
    try:
        published = Published.model_validate(content or read_configuration(place))
    except ValidationError as fault:
        raise as_input_error(place, fault, Published) from None
    check_results(published.results, place)
    return published
