"""The Eq. 8 engine against its peers, as ratios in one run: ``python -m benchmarks.engine``.

The reference record: f 0.516 Hz, y0 0.068 rad, b 0.01192 1/s (half hysteretic, half viscous),
a 0.45 1/(rad s), c 1.4e-6 rad/s, 300 s. Contenders take turns, and the medians are compared.
Peers that are not installed are left out.
"""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.table import Row, at_least, at_most, cpu_seconds, write
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian, turning_points

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics import Eq8
if TYPE_CHECKING:
    from collections.abc import Callable


def forces(model: Eq8) -> tuple[float, float, float, float]:
    """Return f_c, f_h, f_q and 2 b_v of Eq. 8."""
    omega = model.angular_frequency
    return (
        0.5 * math.pi * omega * model.coulomb,
        0.5 * math.pi * model.hysteretic,
        0.5 * math.pi * model.quadratic / omega,
        2.0 * model.viscous,
    )


def solve_ivp_turning_points(
    model: Eq8, angle_rad: float, count: int
) -> Callable[[], tuple[FloatArray, FloatArray]]:
    """Return scipy's DOP853 at rtol 1e-12 with a terminal event a half cycle."""
    from scipy.integrate import solve_ivp

    f_c, f_h, f_q, damping = forces(model)
    omega2 = model.angular_frequency**2
    longest = 2.0 * math.pi / model.angular_frequency

    def turn(_t: float, state: FloatArray, _sign: float) -> float:
        return float(state[1])

    turn.terminal = True  # type: ignore[attr-defined]

    def rates(_t: float, state: FloatArray, sign: float) -> tuple[float, float]:
        x, v = state
        square = omega2 * x * x + v * v
        friction = f_c + f_h * math.sqrt(square) + f_q * square
        return v, -omega2 * x - friction * sign - damping * v

    def run() -> tuple[FloatArray, FloatArray]:
        times, angles = [0.0], [angle_rad]
        sign = -math.copysign(1.0, angle_rad)
        while len(times) < count:
            turn.direction = -sign  # type: ignore[attr-defined]
            solution = solve_ivp(
                rates,
                (times[-1], times[-1] + longest),
                (angles[-1], 0.0),
                method="DOP853",
                rtol=1e-12,
                atol=1e-18,
                events=turn,
                args=(sign,),
            )
            times.append(solution.t_events[0][0])
            angles.append(solution.y_events[0][0][0])
            sign = -sign
        return np.array(times), np.array(angles)

    return run


def heyoka_integrators(model: Eq8, angle_rad: float, tolerance: float) -> Any:
    """Return heyoka's Taylor integrator with a terminal event where the velocity vanishes.

    The sign of the friction is the parameter 0, turned over by the event's callback.
    """
    import heyoka as hy

    f_c, f_h, f_q, damping = forces(model)
    omega2 = model.angular_frequency**2
    x, v = hy.make_vars("x", "v")
    square = omega2 * x**2 + v**2
    friction = f_c + f_h * hy.sqrt(square) + f_q * square
    system = [(x, v), (v, -omega2 * x - friction * hy.par[0] - damping * v)]
    log: list[tuple[float, float]] = []

    def turn(integrator: Any, slope: int) -> bool:
        log.append((integrator.time, integrator.state[0]))
        integrator.pars[0] = slope
        return True

    event = hy.t_event(v, callback=turn)
    integrator = hy.taylor_adaptive(
        system,
        [angle_rad, 0.0],
        pars=[-math.copysign(1.0, angle_rad)],
        tol=tolerance,
        t_events=[event],
    )
    return integrator, log


def heyoka_turning_points(
    model: Eq8, angle_rad: float, until_s: float, tolerance: float = 1e-13
) -> Callable[[], tuple[FloatArray, FloatArray]]:
    """Return a run of heyoka to a time, noting its turning points; built once, outside the run."""
    integrator, log = heyoka_integrators(model, angle_rad, tolerance)

    def run() -> tuple[FloatArray, FloatArray]:
        log.clear()
        _reset(integrator, angle_rad)
        integrator.propagate_until(until_s)
        # The release itself may count as a turning point, or not.
        turned = np.array([(0.0, angle_rad), *(entry for entry in log if entry[0] > 0.0)])
        return turned[:, 0], turned[:, 1]

    return run


def heyoka_samples(
    model: Eq8, angle_rad: float, time_s: FloatArray, tolerance: float = 1e-13
) -> Callable[[], FloatArray]:
    """Return heyoka's propagate_grid at the given times."""
    integrator, log = heyoka_integrators(model, angle_rad, tolerance)

    def run() -> FloatArray:
        log.clear()
        _reset(integrator, angle_rad)
        return np.asarray(integrator.propagate_grid(time_s)[-1])[:, 0]

    return run


def _reset(integrator: Any, angle_rad: float) -> None:
    """Put the pendulum back to its release."""
    integrator.time = 0.0
    integrator.state[:] = [angle_rad, 0.0]
    integrator.pars[0] = -math.copysign(1.0, angle_rad)
    integrator.reset_cooldowns()


ROOT = Path(__file__).parents[1]
OMEGA = 2.0 * math.pi * 0.516
MODEL = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
START = Release(0.0, 0.068)
END_S = 300.0
SINE = Eq8(OMEGA, 0.02, 0.00596, 0.00596, 1.4e-6, restoring="sine")
RELEASES_RAD = (0.3, 1.0, 2.0, 2.9)
"""Of the pendulum with sin x, whose quadratic loss is less: it would not last 300 s."""
SAMPLES = np.linspace(0.0, END_S, 32768)
FIRST_CALL = """
from pendpipe.dynamics import Eq8, Release, turning_points
turning_points(Eq8(3.0, viscous=0.01), Release(0.0, 0.1), count=100)
"""


def rows(rounds: int = 15) -> list[Row]:
    """Measure everything."""
    return [*_speeds(rounds), *_accuracies(), _first_call(rounds)]


def _speeds(rounds: int) -> list[Row]:
    """Return the ratios of times."""
    count = turning_points(MODEL, START, until_s=END_S).time_s.size
    ours: dict[str, tuple[Callable[[], object], int]] = {
        "cos": (lambda: np.cos(SAMPLES), 20),
        "map": (lambda: turning_points(MODEL, START, until_s=END_S), 60),
        "samples": (lambda: sample(MODEL, START, SAMPLES), 20),
        "jacobian": (lambda: sample_with_jacobian(MODEL, START, SAMPLES), 20),
    }
    for y in RELEASES_RAD:
        from_y = (SINE, Release(0.0, y), SAMPLES)
        ours[f"sine samples {y}"] = (partial(sample, *from_y), 10)
        ours[f"sine {y}"] = (partial(sample_with_jacobian, *from_y), 10)
    contenders = dict(ours)
    if importlib.util.find_spec("heyoka"):
        contenders["heyoka"] = (heyoka_turning_points(MODEL, START.angle_rad, END_S), 4)
        contenders["heyoka grid"] = (heyoka_samples(MODEL, START.angle_rad, SAMPLES), 2)
    t = cpu_seconds(contenders, rounds)
    slow = solve_ivp_turning_points(MODEL, START.angle_rad, count)
    t["solve_ivp"] = cpu_seconds({"solve_ivp": (slow, 1)}, 3)["solve_ivp"]
    found = [
        Row(f"time for {count} turning points", f"{1e6 * t['map']:.1f} us"),
        at_least("turning points over `solve_ivp` DOP853", t["solve_ivp"] / t["map"], 1e4),
        at_most("32768 samples over one `np.cos` of them", t["samples"] / t["cos"], 0.5),
        at_most("samples and 8-column Jacobian over one `np.cos`", t["jacobian"] / t["cos"], 3.0),
        *(
            at_most(
                f"{what} with sin x from {', '.join(map(str, RELEASES_RAD))} rad",
                [t[f"{key}{y}"] / t["cos"] for y in RELEASES_RAD],
                3.0,
            )
            for what, key in (("samples", "sine samples "), ("samples and Jacobian", "sine "))
        ),
    ]
    if "heyoka" in t:
        found += [
            at_least("turning points over heyoka", t["heyoka"] / t["map"], 30.0),
            at_least(
                "32768 samples over heyoka's `propagate_grid`",
                t["heyoka grid"] / t["samples"],
                20.0,
            ),
        ]
    return found


def _accuracies() -> list[Row]:
    """Return the errors against 40 digits, as the tests compute them, and of the samples."""
    found = []
    points = turning_points(MODEL, START, until_s=END_S)
    path = ROOT / "tests" / "dynamics" / "reference.py"
    if path.exists() and importlib.util.find_spec("heyoka") and importlib.util.find_spec("pytest"):
        reference = _reference(path)
        times = np.linspace(0.0, END_S, 3000)
        errors = [
            float(
                np.max(
                    np.abs(
                        sample(SINE, Release(0.0, y), times)
                        - reference.heyoka_samples(SINE, y, times)
                    )
                )
                / y
            )
            for y in RELEASES_RAD
        ]
        found.append(
            at_most(
                "error of the samples with sin x against heyoka, over the release", errors, 1e-9
            )
        )
    if path.exists() and importlib.util.find_spec("mpmath") and importlib.util.find_spec("pytest"):
        times, angles = _forty_digits(path, points.time_s.size)
        amplitude = float(np.max(np.abs(points.angle_rad / angles - 1.0)))
        phase = OMEGA * float(np.max(np.abs(points.time_s - times)))
        found.append(at_most("amplitudes against 40 digits (relative)", amplitude, 1e-10))
        found.append(at_most("omega t against 40 digits", phase, 1e-10, " rad"))
    return found


def _reference(path: Path) -> Any:
    """Return the module of the tests that integrates by slow and trusted ways."""
    specification = importlib.util.spec_from_file_location("pendpipe_reference", path)
    assert specification is not None
    assert specification.loader is not None
    reference = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = reference
    specification.loader.exec_module(reference)
    return reference


def _forty_digits(path: Path, count: int) -> tuple[Any, Any]:
    """Return the turning points to 40 digits, rounded."""
    reference = _reference(path)
    with reference.mp.workdps(reference.DIGITS):
        times, angles = reference.MpmathPendulum.of(MODEL).turning_points(START.angle_rad, count)
    return np.array([float(t) for t in times]), np.array([float(x) for x in angles])


def children_s() -> float:
    """CPU seconds of all ended child processes."""
    spent = os.times()
    return spent.children_user + spent.children_system


def _first_call(rounds: int) -> Row:
    """Return how much longer a process takes to call the engine than to import numpy."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}

    def process(code: str) -> Callable[[], object]:
        command = [sys.executable, "-c", code]
        return lambda: subprocess.run(command, check=True, env=environment, cwd=ROOT)

    calls = {"numpy": (process("import numpy"), 1), "call": (process(FIRST_CALL), 1)}
    t = cpu_seconds(calls, rounds, clock=children_s)
    return at_most(
        "first call in a fresh process, beyond `import numpy`", t["call"] - t["numpy"], 0.5, " s"
    )


def main() -> None:
    """Measure, and write the part of the page."""
    write("The engine of Eq. 8", rows())


if __name__ == "__main__":
    main()
