"""Run a campaign: every recording of a table through all stages, by Snakemake.

It runs in the folder with config/config.yaml, which pendpipe init writes. What is done and has not
changed is not done again. All options of Snakemake can follow:

pendpipe campaign -n                        what would run
pendpipe campaign --record air-01           that record's own stages
pendpipe campaign -- --forcerun fit         the fits again, and what follows from them
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from pendpipe.arguments import Arguments, Flags
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.errors import InputError, refuse_if
from pendpipe.project import CONFIGURATION, PROJECT, SNAKEFILE

ARGUMENTS: Final[Flags] = {
    "--config": {
        "type": Path,
        "default": CONFIGURATION,
        "metavar": "CONFIG",
        "help": "another configuration, laid over config/config.yaml where there is one",
    },
    "--record": {
        "action": "append",
        "default": [],
        "metavar": "NAME",
        "help": "run this record's own stages alone; repeatable",
    },
    "--cores": {"type": int, "metavar": "N", "help": "jobs at once; by default a core each"},
    "--profile": {
        "default": "default",
        "metavar": "NAME",
        "help": "where the jobs run: a profile that comes with pendpipe, or a folder of your own",
    },
    "-n": {"dest": "dry_run", "action": "store_true", "help": "print what would run"},
    "snakemake": {"nargs": "...", "metavar": "-- ...", "help": "options of Snakemake"},
}


def run(arguments: Arguments) -> int:
    """Check the configuration, then let Snakemake run."""
    given: Path = arguments.config
    refuse_if(
        not given.is_file(),
        given,
        "there is no such configuration",
        "pendpipe init writes one" if given == CONFIGURATION else "check the path",
    )
    campaign = load_campaign(_merged(given), given)
    for name in arguments.record:
        campaign.record(name)
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(SNAKEFILE)]
    command += ["--workflow-profile", str(_profile(arguments.profile))]
    command += ["--cores", str(arguments.cores or "all")]
    command += ["--dry-run"] if arguments.dry_run else []
    command += [word for word in arguments.snakemake if word != "--"]
    # What may be several words comes last: what follows would be one more of them.
    command += ["--configfile", str(given)] if given != CONFIGURATION else []
    command += ["--config", f"only={json.dumps(arguments.record)}"] if arguments.record else []
    with subprocess.Popen(command) as snakemake:
        try:
            return snakemake.wait()
        except KeyboardInterrupt:
            # Snakemake was interrupted as well, and ends its jobs first.
            snakemake.wait()
            raise


def _merged(given: Path) -> dict[str, Any]:
    """Lay a configuration over the folder's own, as Snakemake does."""
    if given == CONFIGURATION or not CONFIGURATION.is_file():
        return read_configuration(given)
    from snakemake.utils import update_config

    content = read_configuration(CONFIGURATION)
    update_config(content, read_configuration(given))
    return content


def _profile(name: str) -> Path:
    for folder in (Path(name), PROJECT / "profiles" / name):
        if (folder / "config.yaml").is_file():
            return folder
    known = ", ".join(sorted(path.name for path in (PROJECT / "profiles").iterdir()))
    raise InputError(
        f"--profile {name}", "there is no such profile", f"known are {known}; or name a folder"
    )
