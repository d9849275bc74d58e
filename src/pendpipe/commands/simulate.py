"""Make a recording from a described pendulum and measurement chain.

MODEL.toml has the sections pendulum, sampling and, where wanted, sensor, converter and
[[effects]] (what is left out of Eq. 8: see docs/effects.md); config/model.toml is an example
with every key.
"""

from pathlib import Path
from typing import Final

from pendpipe.arguments import INPUT, OUTPUT, Arguments, Flags, natural, tell_written

ARGUMENTS: Final[Flags] = {
    "model": {"metavar": "MODEL.toml", "help": "what to simulate"} | INPUT,
    "out": {"metavar": "OUT.csv", "type": Path, "help": "the recording, plain form"} | OUTPUT,
    "--seed": {"type": natural, "help": "seed of the noise, instead of the model's"},
}


def run(arguments: Arguments) -> None:
    """Simulate and write."""
    from pendpipe import api
    from pendpipe.recording import write_plain

    recording = api.simulate(arguments.model, seed=arguments.seed)
    write_plain(arguments.out, recording)
    tell_written(arguments.out, f"{len(recording)} samples in {recording.unit}")
