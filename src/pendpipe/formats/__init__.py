"""Files of recordings: any supported layout to a `Recording`, every guess said."""

from pendpipe.formats.inspection import Inspection
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.reading import inspect, read

__all__ = ["Inspection", "ReadOptions", "inspect", "read"]
