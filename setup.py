"""Compile the engine while the package is built, so that nobody's first fit waits for it."""

import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithMachineCode(build_py):
    """Put machine code beside the sources, for processors that it can be made for."""

    def run(self) -> None:
        """Compile, in a process of its own; then build as ever."""
        # sys.path holds pip's own environment for the build, and the compiler with it. Given as
        # PYTHONPATH it would lose the sources where an editable installation names them as well.
        paths = [str(Path(__file__).parent / "src"), *sys.path]
        code = f"import sys; sys.path[:] = {paths!r}; from pendpipe import warm_up; warm_up.ship()"
        command = [sys.executable, "-c", code]
        if subprocess.run(command, check=False).returncode:
            print("no machine code was made: the first fit will compile", file=sys.stderr)
        super().run()


setup(cmdclass={"build_py": BuildWithMachineCode})
