"""Snakemake's output in a line a stage: the logger of profiles/default.

Warnings, errors with the log of the job that failed, and what the jobs print themselves pass. A dry
run shows its table of jobs. ``snakemake --printshellcmds`` and ``--verbose`` bring all back;
the log in ``.snakemake/log`` has it in any case.
"""

import logging
import sys
from collections import Counter
from typing import Final

from snakemake.common import NOTHING_TO_BE_DONE_MSG
from snakemake.logging import get_event
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

_ERRORS: Final = (LogEvent.JOB_ERROR, LogEvent.GROUP_ERROR, LogEvent.ERROR)


class LogHandler(LogHandlerBase):
    """Counts the jobs of each rule, and prints a line when the last of them has ended."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        """Begin with no job."""
        self._planned: dict[str, int] = {}
        self._done: Counter[str] = Counter()
        self._rules: dict[int, str] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Print what a reader needs of it."""
        if line := self._line(record):
            print(line, file=sys.stderr, flush=True)

    def _line(self, record: logging.LogRecord) -> str | None:
        settings, event = self.common_settings, get_event(record)
        if settings.verbose or settings.printshellcmds or event in _ERRORS:
            return self.format(record)
        if event == LogEvent.RUN_INFO:
            return self._begins(record)
        if event == LogEvent.JOB_INFO:
            self._rules[record.__dict__["jobid"]] = record.__dict__["rule_name"]
        elif event == LogEvent.JOB_FINISHED:
            return self._finished(record.__dict__["job_id"])
        elif record.levelno >= logging.WARNING or record.msg == NOTHING_TO_BE_DONE_MSG:
            return self.format(record)
        return None

    def _begins(self, record: logging.LogRecord) -> str | None:
        before, self._planned = self._planned, record.__dict__["stats"]
        if self.common_settings.dryrun:  # which says it twice
            return None if before else self.format(record)
        return f"{self._planned['total']} jobs to run"

    def _finished(self, job: int) -> str | None:
        rule = self._rules.get(job, "")
        self._done[rule] += 1
        complete = self._done[rule] == self._planned.get(rule)
        told = rule != "all" and "_files_" not in rule  # these copy, a moment each
        return f"{rule}: {self._done[rule]} done" if complete and told else None
