"""Make the two recordings of this folder: ``python examples/make.py``.

They are simulated, with a seed, and written as a laboratory would export them: the string
pendulum in degrees with three decimals, the rod in volts beside the sensor's constant.
"""

from pathlib import Path

import numpy as np

from pendpipe.files import writing
from pendpipe.recording import Recording, write_plain
from pendpipe.simulation.model import read_model, simulate

HERE = Path(__file__).parent


def simulated(name: str) -> Recording:
    """Simulate the pendulum that NAME.toml describes."""
    model = HERE / f"{name}.toml"
    return simulate(read_model(model), f"simulated: {model.name}", place=model.name)


def main() -> None:
    """Write both recordings."""
    string = simulated("string-pendulum")
    rows = zip(string.time_s, np.degrees(string.values), strict=True)
    lines = ["time (s),angle (deg)", *(f"{time:.4f},{angle:.3f}" for time, angle in rows)]
    (HERE / "string-pendulum.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with writing(force=True):
        write_plain(HERE / "rod-pendulum.csv", simulated("rod-pendulum"))


if __name__ == "__main__":
    main()
