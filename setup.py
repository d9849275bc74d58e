"""Compile the engine while the package is built, so that nobody's first fit waits for it."""

import os
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithMachineCode(build_py):
    """Put machine code beside the sources, for processors that it can be made for."""

    def run(self) -> None:
        """Compile, in a process of its own; then build as ever."""
        # sys.path holds pip's own environment for the build, and the compiler with it.
        source = str(Path(__file__).parent / "src")
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([source, *sys.path])}
        command = [sys.executable, "-m", "pendpipe.warm_up", "ship"]
        if subprocess.run(command, env=environment, check=False).returncode:
            print("no machine code was made: the first fit will compile", file=sys.stderr)
        super().run()


setup(cmdclass={"build_py": BuildWithMachineCode})
