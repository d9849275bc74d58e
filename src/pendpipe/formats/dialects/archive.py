"""Workbooks, zip archives, and the XML of CASSY Lab, Logger Pro and Tracker."""

from pendpipe.formats import containers
from pendpipe.formats.plugin import Dialect

WORKBOOK = Dialect("workbook", containers.is_old_workbook, containers.read_old_workbook)
ARCHIVE = Dialect("zip archive", containers.is_archive, containers.read_table)
PROJECT = Dialect("XML", containers.is_project, containers.read_project)
