"""Where the workflow is: in the package that was installed, or in a clone of the repository."""

from pathlib import Path
from typing import Final

PROJECT: Final = next(
    folder
    for folder in (Path(__file__).parent / "project", Path(__file__).parents[2])
    if (folder / "workflow").is_dir() or folder == Path(__file__).parents[2]
)
"""The folder with ``workflow/``, ``profiles/`` and ``examples/``."""
SNAKEFILE: Final = PROJECT / "workflow" / "Snakefile"
CONFIGURATION: Final = Path("config/config.yaml")
"""A campaign's configuration, in the folder where it runs."""
