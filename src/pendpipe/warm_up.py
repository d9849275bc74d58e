"""Compile what is compiled: ``python -m pendpipe.warm_up``, ``python -m pendpipe.warm_up ship``.

The second is what ``pip install`` runs (`setup.py`): it puts the machine code into the package.
The first compiles where such code is not made for the processor, lest the first jobs of a campaign
all do it at once.
Python's own byte code is written for the same reason: pip does so for what it copies, not
for an editable installation, and where PYTHONDONTWRITEBYTECODE is set nobody else would.
"""

import compileall
import sys
from pathlib import Path

from pendpipe.dynamics.kernel import SHIPPED, Kernel, shipped


def kernels() -> list[Kernel]:
    """Return the kernels that Python calls."""
    from pendpipe import solve
    from pendpipe.analysis import demodulation, free_decay, half_cycles, noise
    from pendpipe.analysis.fit import rounding
    from pendpipe.analysis.turning_points import find, long_records, measure
    from pendpipe.dynamics import any_law, eq8, march
    from pendpipe.effects import catalogue, two_planes
    from pendpipe.physics import lengthening

    fits = (noise, half_cycles, free_decay, find, measure, long_records, demodulation, rounding)
    modules = (march, eq8, any_law, *fits, two_planes, catalogue.losses, solve, lengthening)
    own = [each for module in modules for each in vars(module).values() if isinstance(each, Kernel)]
    called = {id(part) for each in own for part in each.parts()[1:]}
    return [each for each in own if id(each) not in called]


def warm_up() -> None:
    """Make the code for this machine, where the installation brought none."""
    assert all(callable(each.machine_code) for each in kernels())


def ship() -> None:
    """Put the machine code into the package, and take out what older sources left there."""
    for each in kernels():
        each.ship()
    current = [path for each in kernels() for path in shipped(each.file_name()).values()]
    for path in SHIPPED.glob("*.bin"):
        if path not in current:
            path.unlink()


if __name__ == "__main__":
    if sys.argv[1:] == ["ship"]:
        ship()
    else:
        compileall.compile_dir(Path(__file__).parent, quiet=2)
        warm_up()
