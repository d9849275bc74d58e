# What all campaigns share, before their configuration is known. No rule, no physics.
import os

from snakemake.exceptions import WorkflowError

from pendpipe.configuration import jobs
from pendpipe.configuration.load import read_configuration
from pendpipe.errors import InputError
from pendpipe.provenance import code_version

jobs.prepare_environment()


def checked(call, *arguments):
    """Call what may find the user's input wrong; an error is one line, without a traceback."""
    try:
        return call(*arguments)
    except InputError as error:
        raise WorkflowError(str(error)) from None


# Snakemake itself takes the last of two keys of one name.
for path in filter(os.path.isfile, workflow.configfiles):
    checked(read_configuration, path)
PLACE = ", ".join(map(str, workflow.configfiles)) or "--config"
OURS = ".snakemake/pendpipe"
CODE = code_version()
TEMPLATE = workflow.source_path("../envs/pendpipe.yaml")


def environment(_wildcards):
    """The environment of a job: Snakemake's own, unless `--sdm conda` asks for another.

    So `--archive` and `--summary` need no conda where the jobs need none.
    """
    asked = workflow.deployment_settings.deployment_method
    return (
        checked(jobs.environment, OURS, TEMPLATE)
        if "conda" in {*map(str, asked)}
        else None
    )


def doubled(number):
    """A resource, MB or minutes, that is doubled where a cluster ended the first attempt."""
    return lambda wildcards, attempt: number * attempt
