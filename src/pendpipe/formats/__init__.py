"""Files of recordings: any supported layout to a `Recording`, with every guess that was made."""

from pendpipe.formats.reading import Inspection, inspect, read
from pendpipe.formats.table import ReadOptions

__all__ = ["Inspection", "ReadOptions", "inspect", "read"]
