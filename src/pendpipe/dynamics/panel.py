"""The phase clock: one panel of a half cycle of Eq. 8.

Time is counted in radians, tau = omega t, and u = dx/dtau. The place is s, with C = ds/dx
(`curve`): s = x and C = 1 for the linear torque, s = 2 sin(x/2) and C = cos(x/2) =
sqrt(1 - s^2/4) for the sine. The restoring torque is then s C, twice its potential s^2, and in
a half cycle in which the pendulum moves towards negative x, Eq. 8 reads

    ds/dtau = C u,    du/dtau = -s C + delta + h R + q D - 2 g u,    R = sqrt(s^2 + u^2),
    delta = pi c/(2 omega), h = pi b_h/(2 omega), q = pi a/(2 omega), g = b_v/omega,

where the drag is D = R^2 in the energy's form (f = 0), and D = 3/2 u^2 where it follows the
speed (f = 1).
Counted in C dtau the sine is therefore the linear pendulum with its friction divided by C.
m, the smallest root of delta + h m + (1 - f) q m^2 = m C(m), is where the sliding pendulum would
be in equilibrium (delta if h = q = 0 and C = 1), and the amplitude at and below which it sticks.
About this centre, s = m + r cos(psi), u = -r sin(psi), and with k = 0 (linear) or 1 (sine)

    dr/dpsi   = -r nu sin(psi)/(1 - nu cos(psi)),     dtau/dpsi = 1/[C (1 - nu cos(psi))],
    C nu = (r + 2 m cos(psi)) h/(R + m) + q E + 2 g sin(psi)
           + k m cos(psi) (s + m)/(4 [C + C(m)]),
    E = r + 2 m cos(psi)   (f = 0),    3/2 r sin(psi)^2   (f = 1),

so the turning points (u = 0) are exactly psi = 0 and pi, and everything between them is smooth.
delta itself has dropped out: the difference to m is taken analytically.

Where the sine's pendulum is released near the top it dwells there, and C has a zero at the
complex phase psi = i arctanh(C) about. The nodes therefore lie evenly not in psi but in w,

    dpsi/dw = W = (2 K/pi) sqrt(1 - k~^2 cos(psi)^2),     0 <= w <= pi,

which for k~ = sin(y/2) is the time of the motion without losses (psi by Jacobi's elliptic
functions); w = psi for the linear torque, and at small amplitudes.
"""

from __future__ import annotations

import math

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.chebyshev import ANALYSIS_T, INTEGRATION_T, NODES, POWERS_T
from pendpipe.dynamics.kernel import kernel
from pendpipe.dynamics.layout import DEGREE, NODE_COUNT

# Where in the flat workspace `node` the 17 values of each quantity begin. Flat, and the places
# known to the compiler, so that it sees that they do not overlap and can vectorise.
COS, SIN, WEIGHT, BEND, LEAN, LOSS, BEFORE, EARLIER = range(0, 160, 20)
SLIP, LATE, EXCESS, SLOPE, COLUMN, ZETA, VALUE, SCRATCH = range(160, 320, 20)
BY_RADIUS, BY_CENTRE, BY_H, BY_Q, GROWTH, FORCING = range(320, 440, 20)  # half_cycle.py
PULL, LAG, TILT = range(440, 500, 20)
PLACED = 500  # start, half width and complementary modulus of the panel that it holds

PHASE_BELOW = -1.2
"""Up to this `log_amplitude` (0.3 rad) w = psi."""
CENTRE, HYSTERETIC, QUADRATIC, VISCOUS, CURVATURE, SPEED = range(6)
"""m, h, q, g, k and f in the array `shape`."""


def _product(a: FloatArray, x: FloatArray, p: int, out: FloatArray, to: int) -> None:
    out[to : to + NODE_COUNT] = x[p : p + NODE_COUNT] @ a


@kernel(inline=True, arrays=_product)
def multiply(transposed: FloatArray, x: FloatArray, p: int, out: FloatArray, to: int) -> None:
    """Write the product of a matrix, given transposed, and the 17 values x[p:] to out[to:].

    Written out, because a product of this size is the engine's innermost work, and as a double
    loop it takes six times as long.
    """
    a = transposed
    x0, x1, x2, x3, x4, x5 = x[p], x[p + 1], x[p + 2], x[p + 3], x[p + 4], x[p + 5]
    x6, x7, x8, x9, x10, x11 = x[p + 6], x[p + 7], x[p + 8], x[p + 9], x[p + 10], x[p + 11]
    x12, x13, x14, x15, x16 = x[p + 12], x[p + 13], x[p + 14], x[p + 15], x[p + 16]
    for i in range(NODE_COUNT):
        out[to + i] = (
            (a[0, i] * x0 + a[1, i] * x1 + a[2, i] * x2 + a[3, i] * x3)
            + (a[4, i] * x4 + a[5, i] * x5 + a[6, i] * x6 + a[7, i] * x7)
        ) + (
            (a[8, i] * x8 + a[9, i] * x9 + a[10, i] * x10 + a[11, i] * x11)
            + (a[12, i] * x12 + a[13, i] * x13 + a[14, i] * x14 + a[15, i] * x15 + a[16, i] * x16)
        )


@kernel(inline=True)
def unresolved(values: FloatArray, at: int) -> float:
    """Return the estimated size of the Chebyshev coefficients left out, extrapolated."""
    c13, c14, c15, c16 = 0.0, 0.0, 0.0, 0.0
    for j in range(NODE_COUNT):
        value = values[at + j]
        c13 += ANALYSIS_T[j, DEGREE - 3] * value
        c14 += ANALYSIS_T[j, DEGREE - 2] * value
        c15 += ANALYSIS_T[j, DEGREE - 1] * value
        c16 += ANALYSIS_T[j, DEGREE] * value
    before = max(abs(c13), abs(c14)) + 1e-300
    last = max(abs(c15), abs(c16))
    return last * min(1.0, last / before)


@kernel(inline=True)
def curve(shape: FloatArray, s: float) -> float:
    """Return C at s."""
    # |.| because rounding can make the square negative at the top
    return math.sqrt(abs(1.0 - 0.25 * shape[CURVATURE] * s * s))


@kernel(inline=True)
def angle_of(shape: FloatArray, s: float) -> float:
    """Return x at s."""
    return 2.0 * math.asin(0.5 * s) if shape[CURVATURE] > 0.0 else s


@kernel()
def log_amplitude(shape: FloatArray, s: float) -> float:
    """Return ln(s/C) of the amplitude s, the ln of x or of 2 tan(x/2); -inf if s is negative."""
    return math.log(s / curve(shape, s)) if s > 0.0 else -math.inf


@kernel()
def amplitude_at(shape: FloatArray, log_y: float) -> float:
    """Return the amplitude s from its `log_amplitude`."""
    tangent = math.exp(log_y)
    if shape[CURVATURE] > 0.0:
        return tangent / math.sqrt(1.0 + 0.25 * tangent * tangent)
    return tangent


@kernel()
def place(node: FloatArray, start: float, half_width: float, complement: float) -> None:
    """Set a panel's nodes and forget the last guess, if it is another panel.

    `complement` is the complementary modulus sqrt(1 - k~^2); 1 for w = psi.
    """
    here = node[PLACED:]
    if here[0] == start and here[1] == half_width and here[2] == complement:
        return
    here[0], here[1], here[2] = start, half_width, complement
    # Jacobi's amplitude by the arithmetic-geometric mean: with its last term a = pi/(2 K), the
    # phases are 2^count w, ..., and in the end am(2 K w/pi).
    a, b, count = 1.0, complement, 0
    while a - b > 1e-14:
        a, b, c = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        node[SCRATCH + count] = c / a
        count += 1
    for j in range(NODE_COUNT):
        phase = (start + half_width * (1.0 + NODES[j])) * (1 << count)
        for n in range(count - 1, -1, -1):
            phase = 0.5 * (phase + math.asin(node[SCRATCH + n] * math.sin(phase)))
        cos, sin = math.cos(phase), complement * math.sin(phase)
        scale = 1.0 / math.sqrt(cos * cos + sin * sin)
        node[COS + j] = cos * scale
        node[SIN + j] = sin * scale
        node[WEIGHT + j] = complement * scale / a
        node[BEND + j], node[LEAN + j] = 1.0, 0.0
        node[LOSS + j], node[BEFORE + j], node[EARLIER + j] = 0.0, 0.0, 0.0


@kernel()
def complement_for(shape: FloatArray, log_y: float) -> float:
    """Return the complementary modulus for amplitudes up to this one, rounded to a few values."""
    if shape[CURVATURE] == 0.0 or log_y < PHASE_BELOW:
        return 1.0
    tangent = math.exp(0.5 * math.ceil(2.0 * log_y)) / 2.0
    return 1.0 / math.sqrt(1.0 + tangent * tangent)


@kernel(inline=True)
def _bend(node: FloatArray, shape: FloatArray, radius: float) -> None:
    """Write 1/C, and what the sine adds to C nu about a shifted centre."""
    if shape[CURVATURE] == 0.0:
        return
    m, centre = shape[CENTRE], curve(shape, shape[CENTRE])
    for j in range(NODE_COUNT):
        cos = node[COS + j]
        s = m + radius * (1.0 + node[LOSS + j]) * cos
        c = math.sqrt(abs(1.0 - 0.25 * s * s))
        node[BEND + j] = 1.0 / c
        node[LEAN + j] = 0.25 * m * cos * (s + m) / (c + centre)


@kernel(inline=True)
def _renew(node: FloatArray, half_width: float) -> tuple[float, float]:
    """Take over the iterate; return the sums of its changes and of its values.

    Every fourth node stands for all: an error of Picard's iteration is smooth.
    """
    change, size = 0.0, 1e-300
    for j in range(4, NODE_COUNT, 4):
        value = half_width * node[SCRATCH + j]
        change += abs(value - node[LOSS + j])
        size += abs(value)
    for j in range(NODE_COUNT):
        node[LOSS + j] = half_width * node[SCRATCH + j]
    return change, size


@kernel(inline=True)
def drag_lever(shape: FloatArray, lever: float, r: float, sin: float) -> float:
    """Return E, the drag's part of C nu over q."""
    return lever + float(shape[SPEED]) * (1.5 * r * sin * sin - lever)


@kernel(inline=True)
def quadratic_at_rest(shape: FloatArray) -> float:
    """Return what of q holds a pendulum at rest: none where the drag follows the speed."""
    return float(shape[QUADRATIC] * (1.0 - shape[SPEED]))


@kernel(inline=True)
def _force(node: FloatArray, shape: FloatArray, radius: float, j: int) -> tuple[float, float]:
    """Return R + m, and nu (R + m), at a node."""
    m, cos = shape[CENTRE], node[COS + j]
    r = radius * (1.0 + node[LOSS + j])
    # |.| because rounding can make the square negative where s and u vanish together
    reach = m + math.sqrt(abs(r * r + m * (2.0 * r * cos + m)))
    lever, sin = r + 2.0 * m * cos, node[SIN + j]
    force = (
        lever * shape[HYSTERETIC]
        + (
            shape[QUADRATIC] * drag_lever(shape, lever, r, sin)
            + (2.0 * shape[VISCOUS] * sin + node[LEAN + j])
        )
        * reach
    )
    return reach, force * node[BEND + j]


@kernel()
def solve(
    node: FloatArray, shape: FloatArray, radius: float, half_width: float, tolerance: float
) -> bool:
    """Solve the phase clock on a panel by Picard's iteration, and return whether it is resolved.

    Parameters
    ----------
    node
        The workspace: cos and sin as `place` left them. LOSS, BEFORE and EARLIER hold the
        solutions of the last three half cycles on this panel: the first guess extrapolates them.
        On return LOSS holds r/radius - 1, SLOPE its derivative by psi,
        SLIP 1/(1 - nu cos psi), and EXCESS tau - psi since the start of the panel.
    shape
        m, h, q, g, k, f.
    radius
        r at the start of the panel.
    """
    for j in range(NODE_COUNT):
        latest, before, earlier = node[LOSS + j], node[BEFORE + j], node[EARLIER + j]
        node[EARLIER + j], node[BEFORE + j] = before, latest
        node[LOSS + j] = 3.0 * (latest - before) + earlier
    before = 0.0
    for _ in range(60):
        _bend(node, shape, radius)
        for j in range(NODE_COUNT):
            reach, force = _force(node, shape, radius, j)
            slope = -(1.0 + node[LOSS + j]) * force * node[SIN + j] * node[WEIGHT + j]
            node[SLOPE + j] = slope / (reach - force * node[COS + j])
        multiply(INTEGRATION_T, node, SLOPE, node, SCRATCH)
        change, size = _renew(node, half_width)
        # The error left is the change times the rate at which changes shrink, once that is known.
        if change <= 1e-12 * size or change * change <= 1e-12 * size * before:
            return _finish(node, shape, radius, half_width, tolerance)
        before = change
    return False


@kernel()
def _finish(
    node: FloatArray, shape: FloatArray, radius: float, half_width: float, tolerance: float
) -> bool:
    """Integrate tau - w, and return whether the panel is resolved to `tolerance`."""
    _bend(node, shape, radius)
    turned_back = 0
    for j in range(NODE_COUNT):
        cos = node[COS + j]
        reach, force = _force(node, shape, radius, j)
        scale = 1.0 / (reach - force * cos)
        still = node[WEIGHT + j] * node[BEND + j]
        node[SLIP + j] = reach * scale
        node[SCRATCH + j] = still * force * cos * scale
        node[LATE + j] = node[SCRATCH + j] + (still - 1.0)
        turned_back += node[SLIP + j] <= 0.0
    if turned_back > 0:
        return False
    multiply(INTEGRATION_T, node, LATE, node, EXCESS)
    for j in range(NODE_COUNT):
        node[EXCESS + j] *= half_width
    # What the losses do is small, and judged by its own size; what the sine does is not.
    if shape[CURVATURE] > 0.0 and unresolved(node, LATE) * half_width > 2e-3 * tolerance:
        return False
    error = max(unresolved(node, SLOPE), unresolved(node, SCRATCH))
    strength = max(abs(node[SLOPE + DEGREE // 2]), abs(node[SCRATCH]), abs(node[SCRATCH + DEGREE]))
    return bool(error * half_width <= tolerance * strength)


@kernel()
def time_nodes(node: FloatArray, half_width: float, chebyshev: FloatArray) -> float:
    """Find where in the panel the Chebyshev nodes of *time* lie.

    Writes T_k at those places to ``chebyshev[k]`` and returns the panel's duration (radians).
    Newton's iteration on tau(zeta) = half_width (1 + zeta) + excess(zeta), all nodes at once.
    """
    duration = 2.0 * half_width + node[EXCESS + DEGREE]
    multiply(ANALYSIS_T, node, EXCESS, node, COLUMN)  # the coefficients of tau - w
    for j in range(NODE_COUNT):
        node[VALUE + j] = half_width * node[LATE + j]
    multiply(ANALYSIS_T, node, VALUE, node, SCRATCH)  # those of its derivative
    for i in range(NODE_COUNT):
        late = node[EXCESS + i] - 0.5 * node[EXCESS + DEGREE] * (1.0 + NODES[i])
        node[ZETA + i] = NODES[i] - late / half_width
    for _ in range(20):
        _tabulate_chebyshev(node, chebyshev)
        multiply(chebyshev, node, COLUMN, node, VALUE)
        multiply(chebyshev, node, SCRATCH, node, SLOPE)
        worst = 0.0
        for i in range(NODE_COUNT):
            zeta = node[ZETA + i]
            late = half_width * (1.0 + zeta) - 0.5 * duration * (1.0 + NODES[i]) + node[VALUE + i]
            step = late / (half_width + node[SLOPE + i])
            node[ZETA + i] = min(1.0, max(-1.0, zeta - step))
            worst = max(worst, abs(step))
        if worst < 1e-8:  # quadratic convergence: the next step would be below 1e-15
            break
    _tabulate_chebyshev(node, chebyshev)
    return float(duration)


def _cosines(node: FloatArray, chebyshev: FloatArray) -> None:
    zeta = node[ZETA : ZETA + NODE_COUNT]
    chebyshev[:] = np.cos(np.outer(np.arange(NODE_COUNT), np.arccos(zeta)))


@kernel(arrays=_cosines)
def _tabulate_chebyshev(node: FloatArray, chebyshev: FloatArray) -> None:
    """Write T_k(zeta) to ``chebyshev[k]``."""
    for i in range(NODE_COUNT):
        chebyshev[0, i] = 1.0
        chebyshev[1, i] = node[ZETA + i]
    for k in range(2, NODE_COUNT):
        for i in range(NODE_COUNT):
            chebyshev[k, i] = 2.0 * node[ZETA + i] * chebyshev[k - 1, i] - chebyshev[k - 2, i]


@kernel()
def polynomial(
    node: FloatArray, values: FloatArray, chebyshev: FloatArray, out: FloatArray, to: int
) -> None:
    """Turn values at the phase nodes into a polynomial in time, in powers of theta in [-1, 1].

    `values` is replaced by the values at the time nodes; the 17 coefficients go to out[to:].
    """
    multiply(ANALYSIS_T, values, 0, node, COLUMN)
    multiply(chebyshev, node, COLUMN, values, 0)
    multiply(POWERS_T, values, 0, out, to)


def _powers(c: FloatArray, theta: FloatArray, out: FloatArray) -> None:
    out[:] = np.vander(theta, NODE_COUNT, increasing=True) @ c


@kernel(arrays=_powers)
def horner(c: FloatArray, theta: FloatArray, out: FloatArray) -> None:
    """Evaluate the polynomial of degree 16 with coefficients `c` at `theta`.

    Written out, so that the compiler keeps the coefficients in registers.
    """
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    c9, c10, c11, c12, c13, c14, c15, c16 = c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16]
    for i in range(theta.size):
        z = theta[i]
        upper = ((((((((c16 * z + c15) * z + c14) * z + c13) * z + c12) * z) + c11) * z) + c10) * z
        lower = ((((((upper + c9) * z + c8) * z + c7) * z + c6) * z + c5) * z + c4) * z
        out[i] = (((lower + c3) * z + c2) * z + c1) * z + c0
