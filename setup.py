"""Compile the engine while the package is built, so that nobody's first fit waits for it.

The workflow, its profiles and the examples are packed beside it, from their only copy.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class Build(build_py):
    """Put machine code beside the sources, and the workflow into the package."""

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
        if not self.editable_mode:
            for name in ("workflow", "profiles", "examples"):
                packed = Path(self.build_lib, "pendpipe", "project", name)
                shutil.copytree(Path(__file__).parent / name, packed, dirs_exist_ok=True)


setup(cmdclass={"build_py": Build})
