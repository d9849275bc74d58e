"""Make a recording from a described pendulum and measurement chain.

MODEL.toml has the sections pendulum, sampling and, where wanted, sensor, converter and
[[effects]] (what is left out of Eq. 8: see docs/effects.md); config/model.toml is an example
with every key.
"""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe simulate``."""
    parser.add_argument("model", metavar="MODEL.toml", help="what to simulate")
    parser.add_argument("out", metavar="OUT.csv", type=Path, help="the recording, plain form")
    parser.add_argument("--seed", type=int, help="seed of the noise, instead of the model's")


def run(arguments: argparse.Namespace) -> None:
    """Simulate and write."""
    from pendpipe import api
    from pendpipe.recording import write_plain

    recording = api.simulate(arguments.model, seed=arguments.seed)
    write_plain(arguments.out, recording)
    print(f"{arguments.out}: {len(recording)} samples in {recording.unit}")
