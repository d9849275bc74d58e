"""The shape of a half cycle about its turning point, to second order in the losses.

About a turning point of amplitude y at phase 0 (phase = omega (t - t_k) with the frequency
observed) Eq. 8 moves as x = y h(phase):

- friction (the terms with sgn x', of size delta = pi (a y^2 + b_h y + c)/(2 omega)):
  h = cos + (sgn(phase) delta - delta delta')(1 - cos)/y, delta' = d delta/dy;
- viscous damping, e = b_v/omega: h = cos + e (sin - phase cos) + e^2 (phase^2 cos/2 - phase sin).

What is odd in the phase leaves the amplitude alone and shifts the time; what is even has
the second order. How b divides is not known to turning points: half of it is taken as
hysteretic, which leaves +-0.17 (b/omega)^2 of the amplitude open, and of the time a
constant +-b/(4 omega^2).
"""

import numpy as np

from pendpipe.arrays import FloatArray

HALF_PI = 0.5 * np.pi
HARMONICS = 3
"""How many odd harmonics above the first the shape may hold (3, 5, 7)."""


def half_cycle_shape(
    amplitude: FloatArray, angular_frequency: FloatArray, rates: FloatArray
) -> FloatArray:
    """Coefficients of the half cycles' shapes, for `measure.half_cycle_sums`.

    Parameters
    ----------
    amplitude
        y of each half cycle, shape (k,).
    angular_frequency
        Phase per second, shape (k,).
    rates
        a, b, c of Eq. 13; a negative one is taken as zero.

    Returns
    -------
    FloatArray
        Shape (k, 4 + HARMONICS): friction, viscous, second orders of both, and the odd
        harmonics 3, 5, 7 (zero).
    """
    a, b, c = np.maximum(rates, 0.0).tolist()
    least = 1e-3 * float(np.max(amplitude))
    y = np.maximum(amplitude, least)
    quadratic, linear, coulomb = (rate / angular_frequency for rate in (a * y, b, c / y))
    shape = np.zeros((len(y), 4 + HARMONICS))
    total = quadratic + linear + coulomb
    shape[:, 0] = np.minimum(HALF_PI * (total - 0.5 * linear), 0.5)
    shape[:, 1] = 0.5 * linear
    shape[:, 2] = HALF_PI**2 * (total * (2.0 * quadratic + linear) - 0.5 * linear**2)
    shape[:, 3] = 0.5 * linear**2
    return shape


def shape_error(
    amplitude: FloatArray, angular_frequency: FloatArray, rates: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What the shape leaves open: relative error of the amplitude, and of the phase in rad.

    With e = (a y + b + c/y)/omega, the third order, about 1.5 e^3 and e^3, and of the second
    what the unknown share of b leaves, 0.1 e b/omega. At Q = 136 it is 1e-6; at Q = 5, 2e-3.
    """
    y = np.maximum(amplitude, 1e-300)
    quadratic, linear, coulomb = np.maximum(rates, 0.0).tolist()
    losses = np.minimum((quadratic * y + linear + coulomb / y) / angular_frequency, 1.0)
    third = losses**3
    return 1.5 * third + 0.1 * losses * linear / angular_frequency, third


def loss_rates(time_s: FloatArray, amplitude: FloatArray, sd: FloatArray) -> FloatArray:
    """Rates of Eq. 13 in one linear step, by its integral: y0 - y = a S y^2 + b S y + c t.

    The integrals come from the amplitudes by Simpson-like cubic sums, so this is a start
    and a shape, not an estimate; the fit of Eq. 14 is `pendpipe.analysis.fit`.

    Parameters
    ----------
    time_s, amplitude, sd
        Of the turning points, shape (k,).
    """
    t = time_s - time_s[0]
    if len(t) < 4:
        fall = np.log(max(amplitude[0], 1e-300) / max(amplitude[-1], 1e-300))
        return np.array([0.0, max(float(fall / t[-1]), 0.0), 0.0])
    y = np.maximum(amplitude, 0.0)
    columns = np.stack([-_integral(t, y**2), -_integral(t, y), -t, np.ones_like(t)], axis=1)
    # Late integrals carry the errors of all before: the weights must not be sharper.
    weight = 1.0 / np.hypot(sd, 3e-4 * y[0])
    weighted = columns * weight[:, None]
    normal, right = weighted.T @ weighted, weighted.T @ (y * weight)
    scale = 1.0 / np.sqrt(np.diag(normal))
    normal = normal * scale[:, None] * scale + 1e-13 * np.eye(4)
    for held in ((), (2,), (0,), (0, 2)):
        free = [j for j in range(4) if j not in held]
        rates = np.zeros(4)
        rates[free] = np.linalg.solve(normal[np.ix_(free, free)], (right * scale)[free])
        rates *= scale
        if np.all(rates[:3] >= 0.0):
            break
    return np.maximum(rates[:3], 0.0)


def _integral(t: FloatArray, f: FloatArray) -> FloatArray:
    """Running integral: trapezoids with the end correction h^2/12 f'."""
    h = np.diff(t)
    slope = np.empty_like(f)
    slope[1:-1] = (f[2:] - f[:-2]) / (t[2:] - t[:-2])
    slope[0], slope[-1] = (f[1] - f[0]) / h[0], (f[-1] - f[-2]) / h[-1]
    steps = 0.5 * h * (f[1:] + f[:-1]) + h**2 / 12.0 * (slope[:-1] - slope[1:])
    return np.concatenate([[0.0], np.cumsum(steps)])
