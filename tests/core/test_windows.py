"""Nothing that a Windows machine lacks is imported before it is used."""

import pkgutil
import subprocess
import sys

import pendpipe

POSIX_ONLY = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")

PROGRAM = """
import importlib, sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name in {blocked!r}:
            raise ModuleNotFoundError(f"no module named {{name!r}} on this system")
# Other people's packages take care of themselves: they stay imported, ours do not.
for name in {modules!r}:
    importlib.import_module(name)
for name in list(sys.modules):
    if name in {blocked!r} or name.split(".")[0] == "pendpipe":
        del sys.modules[name]
sys.meta_path.insert(0, Blocked())
for name in {modules!r}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        print(f"{{name}}: {{error}}")
"""


def test_every_module_imports_without_the_posix_modules() -> None:
    modules = [
        found.name
        for found in pkgutil.walk_packages(pendpipe.__path__, "pendpipe.")
        if not found.name.endswith("__main__")
    ]
    program = PROGRAM.format(blocked=POSIX_ONLY, modules=modules)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "", done.stdout + done.stderr
    assert done.returncode == 0, done.stderr
