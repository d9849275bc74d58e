"""Whether the band of a missing force holds the force, in decays by laws that no catalogue lists.

    python -m benchmarks.curves [--number N] [--list] [--journal FILE]

A third each has a torque, a friction of the angle and a loss of the amplitude of some form, by
scipy's DOP853. What the law takes up of a force (a constant and a multiple of sin x of a torque, or
of x where the answer's law is Eq. 8 with x, whose curve then holds sin x - x too; a y + b + c/y of
a loss; dry friction) is no part of the curve, and is fitted out of the difference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.journal import answers, judge_parser
from benchmarks.table import head, table_row
from pendpipe.arrays import FloatArray as Array
from pendpipe.estimate import Z95

CYCLES, IN_CYCLE = 60, 40
Force = Callable[[Array], Array]
ARGUMENTS: Final = {"torque": "angle, rad", "friction": "angle, rad", "loss": "amplitude, rad"}
ORDINATES: Final = {"torque": "torque", "friction": "friction", "loss": "loss rate"}
TAKEN: Final[dict[str, Callable[[Array], list[Array]]]] = {
    "torque": lambda x: [np.ones_like(x), x],
    "friction": lambda x: [np.ones_like(x)],
    "loss": lambda y: [np.ones_like(y), y, 1.0 / y],
}
"""What Eq. 8 has of each kind; of a torque the answer's own law, x or sin x."""


class Decay(NamedTuple):
    """A law and its readings."""

    kind: str
    force: Force
    time_s: Array
    angle_rad: Array


def draw(number: int) -> Decay:
    """The decay of a number, always the same."""
    rng = np.random.default_rng([20261129, number])
    kind, form = list(ARGUMENTS)[number % 3], int(rng.integers(3))
    omega, first = 2.0 * np.pi * rng.uniform(0.5, 1.2), rng.uniform(0.1, 0.6)
    time_s = np.arange(CYCLES * IN_CYCLE) * 2.0 * np.pi / omega / IN_CYCLE
    viscous = rng.uniform(0.7, 1.6) / time_s[-1]
    place, width = rng.uniform(-0.5, 0.5) * first, rng.uniform(0.15, 0.35) * first
    fallen, blur = rng.uniform(0.4, 0.7) * first, rng.uniform(0.06, 0.2) * first
    size, noise = 10.0 ** rng.uniform(-0.7, 0.3), first * 10.0 ** rng.uniform(-3.3, -2.7)
    forms = {
        "torque": (
            lambda x: 0.02 * (x - place) * np.exp(-0.5 * ((x - place) / width) ** 2),
            lambda x: 0.01 * first * np.sin(x / width),
            lambda x: 0.02 * np.maximum(np.abs(x) - 0.6 * first, 0.0) * np.sign(x),
        ),
        "friction": (
            lambda x: 0.5 * viscous * omega * first * np.exp(-0.5 * ((x - place) / width) ** 2),
            lambda x: 0.5 * viscous * omega * first * (1.0 + np.tanh((x - place) / width)),
            lambda x: 0.5 * viscous * omega * first * (1.0 + np.cos(x / width)),
        ),
        "loss": (
            lambda y: viscous / (1.0 + np.exp((fallen - y) / blur)),
            lambda y: viscous * np.exp(-0.3 * ((y - fallen) / blur) ** 2),
            lambda y: viscous * (1.0 + np.cos((y - fallen) / blur)),
        ),
    }

    def force(at: Array) -> Array:
        return np.asarray(size * forms[kind][form](at))

    def rates(_t: float, state: Array) -> list[Any]:
        x, v = state
        torque = force(x) if kind == "torque" else 0.0
        lost = viscous + (force(np.hypot(x, v / omega)) if kind == "loss" else 0.0)
        dry = force(x) * np.tanh(v / (1e-3 * omega * first)) if kind == "friction" else 0.0
        return [v, -(omega**2) * (np.sin(x) + torque) - 2.0 * lost * v - dry]

    from scipy.integrate import solve_ivp

    swing = solve_ivp(
        *(rates, (0.0, float(time_s[-1])), (first, 0.0), "DOP853", time_s),
        rtol=1e-9,
        atol=1e-12,
        max_step=0.2 / omega,
    )
    return Decay(kind, force, time_s, swing.y[0] + noise * rng.standard_normal(len(time_s)))


def answer(number: int) -> dict[str, Any]:
    """Diagnose a decay, and lay the curve of its kind beside the force."""
    import pendpipe as pp

    decay = draw(number)
    found = pp.diagnose(pp.Recording(time_s=decay.time_s, angle_rad=decay.angle_rad)).to_dict()
    curves = [each["curve"] for each in found["effects"] if each["curve"]]
    own = [
        each
        for each in curves
        if each["argument"] == ARGUMENTS[decay.kind] and ORDINATES[decay.kind] in each["ordinate"]
    ]
    shown = "; ".join(each["name"] for each in curves)
    if not own:
        return {"kind": decay.kind, "shown": shown, "pulls": []}
    at, value, sd = (np.asarray(own[0][key]) for key in ("at", "value", "sd"))
    # A formula without a constant is sure of its zero.
    inside = (np.abs(at) <= np.abs(decay.angle_rad).max()) & (sd > 0.0)
    at, value, sd = at[inside], value[inside], sd[inside]
    off, of = decay.force(at) - value, at
    if decay.kind == "torque":
        off += np.sin(at)
        of = np.sin(at) if "circular-error" in {each["id"] for each in found["effects"]} else at
    taken = np.column_stack(TAKEN[decay.kind](of))
    off -= taken @ np.linalg.lstsq(taken, off, rcond=None)[0]
    return {"kind": decay.kind, "shown": shown, "pulls": (off / sd).tolist()}


def main() -> None:
    """Answer what has not been answered yet by this code, and print the table."""
    parser = judge_parser(__doc__, "curves", 60)
    parser.add_argument("--list", action="store_true", help="print each decay")
    told = parser.parse_args()
    found = list(
        answers(told, range(told.number), answer, ("src/pendpipe/**/*.py", "benchmarks/curves.py"))
    )
    if told.list:
        print(head("decay", *HEADS[1:], "curves"))
        for number, each in enumerate(found):
            cells = figures([each])[1:]
            print(table_row(f"{each['kind']} {number}", [*cells, each["shown"]]))
        print()
    print(head("kind", *HEADS))
    for kind in (*ARGUMENTS, "all"):
        print(table_row(kind, figures([each for each in found if kind in (each["kind"], "all")])))


HEADS: Final = ("a curve of this kind", "grid within the 95 % band", "rms pull")


def figures(found: list[dict[str, Any]]) -> list[str]:
    """What is printed of some answers."""
    seen = [each for each in found if each["pulls"]]
    if not seen:
        return [f"0 of {len(found)}", "-", "-"]
    pulls = np.concatenate([each["pulls"] for each in seen])
    held, size = np.mean(np.abs(pulls) < Z95), np.sqrt(np.mean(pulls**2))
    return [f"{len(seen)} of {len(found)}", f"{100 * held:.1f} %", f"{size:.2f}"]


if __name__ == "__main__":
    main()
