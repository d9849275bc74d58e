"""What a campaign's model may lack: each an effect of its own, declared once by its function.

A function takes the equation of motion of every record (`Terms`), or the inputs it is made of,
and a size of shape (..., 1), and returns them with the effect in it; it may ask for the `design`,
and for the `shape` where the effect has a discrete property (a branch, a mode's frequency).
Patterns, fits and the statement follow from it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from inspect import signature
from itertools import product
from typing import Any, Final, Literal

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design, Inputs, Terms
from pendpipe.effects.effect import Parameter

Acts = Callable[..., Any]
Shapes = Sequence[Any] | Callable[[Any], Sequence[Any]]


@dataclass(frozen=True)
class CampaignEffect:
    """One thing that a campaign's model may lack.

    Parameters
    ----------
    identifier, name, equation
        As in the contract, in words, and in LaTeX.
    parameter
        Its size, with bounds.
    expected
        The standard deviation that its size has beforehand: it weighs the rivals of one class.
    on
        Whether it changes the inputs or the terms.
    acts
        The function.
    shapes
        The discrete shapes that are tried, or how they follow from a design.
    drag_law
        Whether the fluid's drag follows another law of the frequency with it: what such a law has
        left over in the fluid is no measure of the loss torque.
    finer
        Whether a shape is of positive numbers, to be sought between those that are tried.
    """

    identifier: str
    name: str
    equation: str
    parameter: Parameter
    expected: float
    on: Literal["nuisances", "inputs", "terms"]
    acts: Acts
    shapes: Shapes = (None,)
    drag_law: bool = False
    finer: bool = False

    def shapes_in(self, design: Any) -> Sequence[Any]:
        """Return the shapes that are tried in a design."""
        return self.shapes(design) if callable(self.shapes) else self.shapes

    def put(self, what: Any, size: FloatArray, design: Any, shape: Any) -> Any:
        """Return inputs or terms with the effect in them."""
        given = {"design": design, "shape": shape}
        asked = {name: given[name] for name in given if name in signature(self.acts).parameters}
        return self.acts(what, size, **asked)


CATALOGUE: Final[dict[str, CampaignEffect]] = {}
"""All campaign effects by identifier, or by `key`, in the order of their declaration."""


def campaign_effect(
    on: Literal["inputs", "terms"],
    identifier: str,
    name: str,
    equation: str,
    parameter: Parameter,
    expected: float,
    shapes: Shapes = (None,),
    drag_law: bool = False,
    finer: bool = False,
    key: str = "",
) -> Callable[[Acts], CampaignEffect]:
    """Declare a campaign effect by the function through which it enters.

    One that enters in two ways is declared twice, the second time by a `key` of its own.
    """

    def declare(function: Acts) -> CampaignEffect:
        found = CATALOGUE[key or identifier] = CampaignEffect(
            identifier, name, equation, parameter, expected, on, function, shapes, drag_law, finer
        )
        return found

    return declare


def _dragged(terms: Terms, factor: FloatArray) -> Terms:
    return replace(terms, steady=terms.steady * factor, history=terms.history * factor)


@campaign_effect(
    "terms",
    "uniform-drag-excess",
    "drag larger by one factor",
    r"D \to (1 + \epsilon) D",
    Parameter("excess", "", -0.5, 1.0),
    0.1,
)
def uniform(terms: Terms, size: FloatArray) -> Terms:
    """More wetted area than the sphere's.

    Roughness thinner than the boundary layer, swollen wood, bubbles. Area, radius and lever
    beyond their errors look the same.
    """
    return _dragged(terms, 1.0 + size)


@campaign_effect(
    "terms",
    "history-term",
    "another history coefficient",
    r"a/\delta \to C_H\, a/\delta",
    Parameter("C_H - 1", "", -0.5, 1.0),
    0.1,
    drag_law=True,
)
def history(terms: Terms, size: FloatArray) -> Terms:
    """Only the part of Eq. 2 that grows as the square root of the frequency."""
    return replace(terms, history=terms.history * (1.0 + size))


@campaign_effect(
    "inputs",
    "viscosity-temperature",
    "another viscosity than the temperature gives",
    r"\eta \to (1 + \epsilon)\, \eta(T)",
    Parameter("viscosity_excess", "", -0.5, 1.0),
    0.05,
)
def viscosity(inputs: Inputs, size: FloatArray) -> Inputs:
    """A viscosity beyond the thermometer's error: what is dissolved, or a wrong temperature.

    One kelvin is 2.4 % of water's viscosity at 20 C.
    """
    return replace(inputs, thicker=inputs.thicker + size)


@campaign_effect(
    "inputs",
    "temperature-trend",
    "a temperature that changes over the day",
    r"T \to T + \dot T\, (t - \bar t)",
    Parameter("change_over_the_day", "K", -15.0, 15.0),
    1.0,
)
def trend(inputs: Inputs, size: FloatArray, design: Design) -> Inputs:
    """A steady change of temperature in the order of the records."""
    order = np.array([run.order for run in design.runs])
    wet = design.wet > 0.0
    order = order - order[wet].mean() if wet.any() else order
    return replace(inputs, warmer_k=inputs.warmer_k + size * order)


@campaign_effect(
    "inputs",
    "stem-drag",
    "more of the screw under water",
    r"D \mathrel{+}= 4 \pi \eta\, \ell\, z^2 (r/\delta + 1/2)",
    Parameter("length", "m", 0.0, 0.1),
    0.006,
    drag_law=True,
)
def stem(inputs: Inputs, size: FloatArray) -> Inputs:
    """The drag of a longer immersed part of the screw, a cylinder."""
    return replace(inputs, screw_m=inputs.screw_m + size)


@campaign_effect(
    "inputs",
    "wall-confinement",
    "walls other than those that are told",
    r"D \to K(s, \delta/a)\, D, \quad C_m \to C_m(s, \delta/a), \quad s = 2 a/H",
    Parameter("closeness", "", -0.5, 0.5),
    0.1,
    lambda design: (None,) if design.tank is not None else (),
    drag_law=True,
)
def walls(inputs: Inputs, size: FloatArray) -> Inputs:
    """Walls, floor and surface that are nearer or farther than those of the told tank.

    The closeness is s^3, with H the depth of a tank of the given one's proportions; its size is
    what is added to that of the told tank.
    """
    return replace(inputs, closer=inputs.closer + size)


@campaign_effect(
    "terms",
    walls.identifier,
    walls.name,
    r"D \to (1 + \epsilon) D, \quad C_m \to C_m + \rho\, \epsilon",
    Parameter("drag_excess", "", -0.5, 1.0),
    0.1,
    (0.3, 0.45, 0.6),
    drag_law=True,
    key="walls-of-any-shape",
)
def walls_of_any_shape(terms: Terms, size: FloatArray, design: Design, shape: float) -> Terms:
    """Walls and surface of other proportions than the told tank's, in thin layers.

    Where ``C_m`` grows by e the fluid passes the sphere faster, so that its drag grows by 4 e/3
    (the loss in a layer goes as the change of (1 + C_m) V with the sphere's size), and the wall has
    a layer of its own: e is 0.5 of a plane that nearly touches to 0.75 of a drag's excess. A free
    surface takes of both, so that beside a wall e is less.
    """
    more = size * np.array([float(run.tank and run.fluid is not None) for run in design.runs])
    return replace(
        terms,
        steady=terms.steady * (1.0 + more),
        history=terms.history * (1.0 + more),
        inertia=terms.inertia + shape * more * terms.displaced,
    )


_ADDED_PER_DRAG = 0.6
"""Added mass, in units of the displaced fluid, for each unit of drag that a wall adds."""


@campaign_effect(
    "terms",
    "free-surface",
    "a free surface that sloshes",
    r"a/\delta \to (1 + \epsilon g)\, a/\delta, \quad g = \omega^2/(\omega_s^2 - \omega^2)",
    Parameter("excess", "", -1.0, 2.0),
    0.3,
    (1.15, 1.28, 1.42),
    drag_law=True,
)
def free_surface(terms: Terms, size: FloatArray, design: Design, shape: float) -> Terms:
    """The response of the tank's first sloshing mode, which lies above the records.

    Drag and added mass rise towards it.
    """
    open_surface = np.array([float(run.tank and run.open_surface) for run in design.runs])
    omega2 = terms.angular_frequency**2
    own = (2.0 * np.pi * shape) ** 2
    more = size * open_surface * omega2 / np.maximum(own - omega2, 0.05 * own)
    return replace(
        terms,
        history=terms.history * (1.0 + more),
        inertia=terms.inertia + _ADDED_PER_DRAG * more * terms.displaced,
    )


@campaign_effect(
    "terms",
    "sloshing-mode",
    "a mode of the water's surface",
    r"C_m \mathrel{-}= \kappa s^2/(s^2 + 2 \zeta \omega_s s + \omega_s^2)",
    Parameter("coupling", "", 0.0, 2.0),
    0.05,
    tuple(product(np.geomspace(0.35, 1.5, 26).tolist(), (0.02, 0.06))),
    drag_law=True,
    finer=True,
)
def sloshing_mode(
    terms: Terms, size: FloatArray, design: Design, shape: tuple[float, float]
) -> Terms:
    """A mode of frequency and damping ratio that the sphere drives, among the records or beside.

    The water that moves in it takes energy near its frequency, and carries the sphere along below,
    against it above. What it adds to the inertia and to the drag is taken at the complex rate s of
    the decay, which it shifts.
    """
    open_surface = np.array([float(run.tank and run.open_surface) for run in design.runs])
    coupled = size * open_surface * terms.displaced
    own, ratio = 2.0 * np.pi * shape[0], shape[1]
    inertia, drag = np.zeros_like(terms.inertia), np.zeros_like(terms.inertia)
    for _ in range(_SHIFTS):
        moved = replace(terms, inertia=terms.inertia + inertia, steady=terms.steady + drag)
        omega = moved.angular_frequency
        memory = (terms.history + terms.screw_history) * np.sqrt(omega / 2.0)
        rate = 0.5 * (moved.steady + terms.screw + memory) / moved.inertia
        s = -rate + 1j * omega
        per_rate = -coupled * s**3 / (s**2 + 2.0 * ratio * own * s + own**2)
        inertia = per_rate.imag / omega
        drag = per_rate.real + inertia * rate
    return replace(terms, inertia=terms.inertia + inertia, steady=terms.steady + drag)


_SHIFTS: Final = 3
"""Rounds in which a mode shifts the rate at which it acts: a fourth changes b by 1e-4 at most."""


@campaign_effect(
    "terms",
    "drag-law-transition",
    "a drag between linear and quadratic",
    r"b \mathrel{+}= \phi\, a\, y_0",
    Parameter("share", "", -1.0, 1.0),
    0.2,
    drag_law=True,
)
def transition(terms: Terms, size: FloatArray, design: Design) -> Terms:
    """A share of the quadratic drag at the release that a y^2 + b y puts into b.

    It grows as the velocity, and falls with the amplitude of the release.
    """
    started = np.array([run.release_rad for run in design.runs])
    started = np.where(np.isfinite(started), started, 0.068) * design.wet * design.spheres
    omega = terms.angular_frequency
    density, _ = design.fluids(terms.inputs.warmer_k)
    radius, lever = terms.inputs.radius_m, terms.inputs.lever_m
    # Eq. 13's a for C_d = 1/2: (4/(3 pi)) omega rho C_d pi R^2 L^3/(2 I), as a drag 2 I a y.
    quadratic = 2.0 / 3.0 * omega * density * radius**2 * lever**3 * started
    return replace(terms, steady=terms.steady + size * quadratic)


@campaign_effect(
    "terms",
    "added-mass",
    "another added mass",
    r"\tfrac12 \to \tfrac12 + \Delta C_m",
    Parameter("added_mass", "", -0.5, 20.0),
    0.1,
)
def added_mass(terms: Terms, size: FloatArray) -> Terms:
    """More fluid that swings along than the potential flow about a free sphere has."""
    return replace(terms, inertia=terms.inertia + size * terms.displaced)


@campaign_effect(
    "terms",
    "buoyancy",
    "another buoyancy",
    r"K \to K - \epsilon \rho g V L",
    Parameter("excess", "", -0.5, 1.0),
    0.02,
)
def buoyancy(terms: Terms, size: FloatArray) -> Terms:
    """A density of the fluid, or a displaced volume, beyond its error."""
    lift = terms.inputs.gravity * terms.displaced / terms.inputs.lever_m
    return replace(terms, torque=terms.torque - size * lift)


@campaign_effect(
    "inputs",
    "hysteresis-inertia-scaling",
    "a loss torque with another dependence on the inertia",
    r"Q_h = k f^2 (I/I_0)^{1 - p}",
    Parameter("exponent_excess", "", -3.0, 3.0),
    1.0,
)
def inertia_scaling(inputs: Inputs, size: FloatArray) -> Inputs:
    """Internal friction has Q_h = I omega^2/kappa''.

    K f^2 only where the moment of inertia stays the same, or kappa'' grows with it.
    """
    return replace(inputs, inertia_exponent=inputs.inertia_exponent + size)


@campaign_effect(
    "inputs",
    "hysteretic-damping",
    "another loss torque in the fluid's assembly",
    r"k \to k\, e^{-\epsilon} \text{ in the fluid}",
    Parameter("log_ratio", "", -3.0, 3.0),
    0.2,
)
def other_hysteresis(inputs: Inputs, size: FloatArray, design: Design) -> Inputs:
    """The pendulum in the fluid is assembled anew, with a loss torque unlike the benchmark's."""
    return replace(inputs, log_coefficient=inputs.log_coefficient - size * design.wet)


@campaign_effect(
    "inputs",
    "air-drag-in-benchmark",
    "the drag of the air",
    r"D \mathrel{+}= \epsilon D_\mathrm{air}",
    Parameter("share", "", -1.0, 30.0),
    1.0,
)
def air_drag(inputs: Inputs, size: FloatArray) -> Inputs:
    """Eq. 2 for weights and rod in the air, in the benchmark and above the water alike."""
    return replace(inputs, air_drag=inputs.air_drag + size)


@campaign_effect(
    "terms",
    "grease-drag",
    "viscous friction in the bearing",
    r"\tau = -\gamma \dot x",
    Parameter("gamma", "N m s", 0.0, 1.0),
    1e-4,
)
def grease(terms: Terms, size: FloatArray) -> Terms:
    """A torque proportional to the angular velocity, the same in every record."""
    return replace(terms, steady=terms.steady + size)


@campaign_effect(
    "terms",
    "support-loss",
    "a support that takes energy along",
    r"b \mathrel{+}= C'' S^2 \omega^3/(2 I), \quad S = K/g",
    Parameter("compliance_loss", "m/N", 0.0, 1.0),
    1e-5,
)
def support(terms: Terms, size: FloatArray) -> Terms:
    """A support that flexes and dissipates, C'' being the imaginary part of its compliance.

    The pendulum pulls at its axis with S theta'', S its mass times its centre's distance.
    """
    static = terms.torque / terms.inputs.gravity
    more = size * static**2 * terms.angular_frequency**3
    return replace(terms, steady=terms.steady + more)


def _branches_and_weights(design: Design) -> Sequence[Any]:
    branches = [("branch", name) for name in dict.fromkeys(run.branch for run in design.runs)]
    return [*branches, *(("weight", name) for name in design.weights)]


@campaign_effect(
    "terms",
    "moment-of-inertia",
    "a moment of inertia that was not counted",
    r"I \to I + \Delta I",
    Parameter("inertia", "kg m^2", -0.1, 0.1),
    1e-3,
    _branches_and_weights,
)
def moment_of_inertia(
    terms: Terms, size: FloatArray, design: Design, shape: tuple[str, str]
) -> Terms:
    """The same in all records of one branch, or with one weight.

    A clamp, the weight's own size.
    """
    what, name = shape
    there = [
        run.branch == name if what == "branch" else name in run.weights_m for run in design.runs
    ]
    return replace(terms, inertia=terms.inertia + size * np.array(there, dtype=np.float64))


def _wet_branches(design: Design) -> Sequence[str]:
    runs = zip(design.runs, design.wet, strict=True)
    found = list(dict.fromkeys(run.branch for run, wet in runs if wet))
    return found if len(found) > 1 else []


@campaign_effect(
    "terms",
    "branch-loss",
    "another drag in the records of one branch",
    r"D \to (1 + \epsilon) D \text{ in one branch}",
    Parameter("excess", "", -0.5, 1.0),
    0.1,
    _wet_branches,
)
def branch_loss(terms: Terms, size: FloatArray, design: Design, shape: str) -> Terms:
    """One factor for all records of a branch: taken in another fluid, or on another day."""
    there = np.array([run.branch == shape for run in design.runs], dtype=np.float64)
    return _dragged(terms, 1.0 + size * there)


@campaign_effect(
    "terms",
    "drag-exponent",
    "a drag that grows with another power of the frequency",
    r"D \to D\, (\omega/\bar\omega)^n",
    Parameter("exponent_excess", "", -1.0, 1.0),
    0.2,
    drag_law=True,
)
def drag_exponent(terms: Terms, size: FloatArray, design: Design) -> Terms:
    """A body that is no smooth sphere, or a flow that is not laminar, about the records' middle."""
    log = np.log(terms.angular_frequency)
    log = log - np.mean(log[..., design.wet > 0.0], axis=-1, keepdims=True)
    return _dragged(terms, np.exp(size * log))


WRONG: Final = 10.0
"""Stated errors by which a wrong input is off, or factor of errors that are stated: a digit."""


def _offset(moved: FloatArray, size: FloatArray, design: Any, shape: str) -> FloatArray:
    there = np.array([each.name == shape for each in design.nuisances], dtype=np.float64)
    return np.asarray(moved + size * there / design.sds)


def wrong_inputs(design: Design) -> list[CampaignEffect]:
    """Every input that was measured, freed of its prior."""
    return [
        CampaignEffect(
            "input-" + each.name.replace(" ", "-"),
            f"another {each.name} than was measured",
            r"x \to x + \Delta x",
            Parameter("error", each.unit, -np.inf, np.inf),
            WRONG * each.sd,
            "nuisances",
            _offset,
            (each.name,),
        )
        for each in design.nuisances
        if each.measured
    ]


def _drag_of_one(terms: Terms, size: FloatArray, design: Design, shape: str) -> Any:
    there = np.array([run.record == shape for run in design.runs], dtype=np.float64)
    return _dragged(terms, 1.0 + size * there)


DRAG_OF_ONE_RECORD: Final = CampaignEffect(
    "drag-of-one-record",
    "drag of one record",
    r"D \to (1 + \epsilon_i) D",
    Parameter("excess", "", -10.0, 1e3),
    0.1,
    "terms",
    _drag_of_one,
)
"""With one for each record in the fluid the fit says what every record measures by itself."""
RATE_EXPONENT: Final = CampaignEffect(
    "rate-exponent",
    "a loss torque that depends on the rate",
    r"\kappa'' \to \kappa'' \omega^n",
    Parameter("exponent", "", -3.0, 3.0),
    0.1,
    "inputs",
    lambda inputs, size: replace(inputs, rate_exponent=inputs.rate_exponent + size),
)
"""Internal friction has none (Kimball and Lovell): Q_hys then goes as f^2 at one inertia."""
