"""Files of recordings: any supported layout to a `Recording`, with every guess that was made."""

from pendpipe.formats.inspection import Inspection, inspect
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.reading import read

__all__ = ["Inspection", "ReadOptions", "inspect", "read"]
