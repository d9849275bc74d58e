"""Workbooks, zip archives, and the XML of CASSY Lab, Logger Pro and Tracker."""

import re

from pendpipe.formats import containers
from pendpipe.formats.plugin import Dialect

_START = re.compile(rb"\s*(?:\xef\xbb\xbf)?\s*<(\?xml|cassylab|Document|object)\b")

WORKBOOK = Dialect(
    "workbook", lambda head: head.startswith(containers.OLD_EXCEL), containers.read_table
)
ARCHIVE = Dialect(
    "zip archive",
    lambda head: head.startswith(b"PK") and b".npy" not in head[:128],
    containers.read_table,
)
PROJECT = Dialect("XML", lambda h: _START.match(h[:200]) is not None, containers.read_project)
