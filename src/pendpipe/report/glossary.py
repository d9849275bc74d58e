"""The words of the page, for students."""

from __future__ import annotations

from typing import Final

GLOSSARY: Final = (
    ("Free decay", "The motion of a pendulum that was released and is left alone."),
    ("Turning point", "Where the pendulum stands still for an instant and turns back; its distance"
     " from the level is the amplitude y."),
    ("Quality factor Q", "2π times the stored energy over the energy lost in a cycle. A pendulum"
     " of Q = 100 loses 6 % of its energy in a cycle."),
    ("a, b, c", "The rates of Eq. 13, −dy/dt = a y² + b y + c: drag that grows as the square of"
     " the velocity, exponential losses, and friction that does not depend on the amplitude."),
    ("Limiting Q", "π f/b, the Q that the exponential losses alone would give (a = c = 0)."),
    ("Coulomb friction", "Dry friction of constant size, as in a bearing. It stops a pendulum in"
     " finite time."),
    ("Hysteretic damping", "Internal friction of the structure: the energy lost in a cycle does"
     " not depend on how fast the cycle is. Its Q grows as the square of the frequency."),
    ("Viscous damping", "Friction proportional to the velocity, in a fluid."),
    ("Penetration depth δ", "How far an oscillating surface drags the fluid along: √(2η/(ωρ)),"
     " about half a millimetre to two millimetres in water here."),
    ("History term a/δ", "What oscillation adds to Stokes' drag on a sphere of radius a: the fluid"
     " remembers the motion before."),
    ("Added mass", "The water that swings with the sphere and adds to its moment of inertia."),
    ("Moment of inertia I", "The resistance to angular acceleration, in kg m²."),
    ("Residual", "Data minus fit, always in this order."),
    ("χ² per degree of freedom", "The mean square of residuals over the noise: 1 when the model"
     " misses nothing, more when it does."),
    ("Standard deviation (sd)", "The ± of a number: in two of three cases the truth lies within"
     " it. 3.84950(74) means 3.84950 ± 0.00074."),
    ("Pull", "The found value less the hidden truth, in standard deviations; it should rarely"
     " exceed 2."),
)  # fmt: skip
