"""The rows of the table on estimators: precision against the bound, time against peers.

``python -m benchmarks.estimators [REALISATIONS]``, with OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import importlib.util
import itertools
import math
import statistics
import sys
import time
from typing import TYPE_CHECKING, Final

import numpy as np

import pendpipe as pp
from benchmarks.table import Row, at_least, at_most, cpu_seconds, within, write
from pendpipe.analysis.fit import fit_recording
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian
from pendpipe.recording import Recording

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics import Eq8
if TYPE_CHECKING:
    from collections.abc import Callable

    from pendpipe.analysis.fit.result import Method
    from pendpipe.arrays import FloatArray


def eq_14(t: FloatArray, y0: float, a: float, b: float, c: float) -> FloatArray:
    """The paper's Eq. 14 as printed, complex root included."""
    r = np.sqrt(complex(b * b - 4.0 * a * c))
    p = (2.0 * a * y0 + b - r) / (2.0 * a * y0 + b + r) * np.exp(-r * t)
    return np.real((b * (p - 1.0) + r * (p + 1.0)) / (2.0 * a * (1.0 - p)))


def law_through(
    time_s: FloatArray, amplitude: FloatArray, sd: float
) -> tuple[FloatArray, FloatArray]:
    """y0, a, b, c of Eq. 14 and their standard deviations, from good starting values."""
    from scipy.optimize import curve_fit

    start, sigma = [amplitude[0], 0.4, 0.01, 1e-6], np.full(len(amplitude), sd)
    value, covariance = curve_fit(
        eq_14, time_s - time_s[0], amplitude, start, sigma=sigma, absolute_sigma=True
    )
    return np.asarray(value), np.sqrt(np.diag(covariance))


def prominent_peaks(
    time_s: FloatArray, values: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """find_peaks told of the noise (a prominence of five of it), and curve_fit."""
    from scipy.signal import find_peaks

    size = np.abs(values - np.median(values))
    index, _ = find_peaks(size, prominence=5.0 * noise)
    return law_through(time_s[index], size[index], noise)


def spaced_peaks(
    time_s: FloatArray, values: FloatArray, noise: float, half_period: float, *, quartic: bool
) -> tuple[FloatArray, FloatArray]:
    """find_peaks told of the half period (in readings) and the noise, and curve_fit.

    With `quartic` the amplitude is that of a quartic through each peak.
    """
    from scipy.signal import find_peaks

    size = np.abs(values - np.median(values))
    index, _ = find_peaks(size, distance=int(0.8 * half_period))
    if not quartic:
        return law_through(time_s[index], size[index], noise)
    reach = int(0.25 * half_period)
    u = np.arange(-reach, reach + 1) / reach
    polynomial = np.linalg.pinv(np.vander(u, 5, increasing=True))
    index = index[(index > reach) & (index < len(size) - reach)]
    fitted = size[index[:, None] + np.arange(-reach, reach + 1)] @ polynomial.T
    amplitude = fitted[:, 0] - fitted[:, 1] ** 2 / (4.0 * fitted[:, 2])
    return law_through(time_s[index], amplitude, noise * float(np.linalg.norm(polynomial[0])))


def lmfit_waveform(
    model: Eq8, angle_rad: float, start_s: float, time_s: FloatArray, values: FloatArray
) -> FloatArray:
    """a, b, c by lmfit over solve_ivp (DOP853, rtol 1e-8), finite differences with tuned steps."""
    import lmfit
    from scipy.integrate import solve_ivp

    scale = np.array([1e-2, 1e-4, 1e-6, 1e-4, 1e-3, 1e-2, 1e-3])
    guess = np.array(
        [
            model.quadratic,
            model.hysteretic + model.viscous,
            model.coulomb,
            model.angular_frequency,
            angle_rad,
            start_s,
            0.0,
        ]
    )

    def curve(values_of: FloatArray) -> FloatArray:
        a, b, c, omega, angle, begin, offset = values_of

        def rates(_t: float, z: FloatArray) -> tuple[float, float]:
            square = omega**2 * z[0] ** 2 + z[1] ** 2
            friction = (
                0.5 * math.pi * (omega * c + 0.5 * b * math.sqrt(square) + a / omega * square)
            )
            return z[1], -friction * np.sign(z[1]) - b * z[1] - omega**2 * z[0]

        run = solve_ivp(
            rates,
            (begin, time_s[-1] + 1e-9),
            (angle, -1e-12),
            method="DOP853",
            t_eval=time_s,
            rtol=1e-8,
            atol=1e-12,
        )
        return np.asarray(run.y[0] + offset)

    def residual(parameters: lmfit.Parameters) -> FloatArray:
        steps = np.array([parameters[f"p{k}"].value for k in range(7)])
        return values - curve(guess + (steps - 1.0) * scale)

    parameters = lmfit.Parameters()
    for k in range(7):
        # From 1, so that lmfit's relative steps of 1e-3 are steps of 1e-3 of the scale.
        parameters.add(f"p{k}", value=1.0)
    fitted = lmfit.minimize(residual, parameters, epsfcn=1e-6)
    return np.array([guess[k] + scale[k] * (fitted.params[f"p{k}"].value - 1.0) for k in range(3)])


OMEGA = 2.0 * math.pi * 0.516
REFERENCE = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
RELEASE = Release(-0.3, 0.068, 0.003)
TIME_S = np.arange(32768) * (300.0 / 32768)
NOISE = 1e-4
METHODS: Final[tuple[Method, ...]] = ("waveform", "turning-points")
TRUTH = {"a": 0.45, "b": 0.01192, "c": 1.4e-6, "Q": math.pi * 0.516 / 0.01192}


def recording(seed: int) -> Recording:
    """One realisation of the reference record."""
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(TIME_S))
    return Recording(TIME_S, sample(REFERENCE, RELEASE, TIME_S) + noise, "angle_rad")


def _known_share() -> FloatArray:
    """The Jacobian with b as one parameter, half of it hysteretic."""
    columns = sample_with_jacobian(REFERENCE, RELEASE, TIME_S)[1]
    return np.column_stack([columns[:, 0], 0.5 * (columns[:, 1] + columns[:, 2]), columns[:, 3:]])


def bound() -> FloatArray:
    """Cramer-Rao bound of a, b, c, Q (b's share given; with it free it is the same)."""
    jacobian = _known_share()
    sd = NOISE * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))[:3]
    return np.array([*sd, sd[1] * TRUTH["Q"] / TRUTH["b"]])


def linear_estimates(realisations: int) -> FloatArray:
    """Errors of a, b, c, Q by one linear step from the truth; efficient by definition."""
    jacobian = _known_share()
    inverse = np.linalg.inv(jacobian.T @ jacobian)[:3] @ jacobian.T
    errors = np.array(
        [
            inverse @ (NOISE * np.random.default_rng(seed).standard_normal(len(TIME_S)))
            for seed in range(realisations)
        ]
    )
    return np.column_stack([errors, -errors[:, 1] * TRUTH["Q"] / TRUTH["b"]])


def precision(method: Method, realisations: int) -> list[Row]:
    """Standard deviation over the bound, bias in standard deviations, coverage."""
    values, inside = [], []
    truth = np.array(list(TRUTH.values()))
    for seed in range(realisations):
        result = fit_recording(recording(seed), method=method)
        limit = result.quality_factor_limit
        assert limit is not None
        found = [*(result.parameters[name] for name in "abc"), limit]
        values.append([estimate.value for estimate in found])
        sd = np.array([estimate.sd for estimate in found])
        ends = np.array([estimate.interval95 for estimate in found])
        off = np.abs(np.array(values[-1]) - truth)
        inside.append([off < sd, (ends[:, 0] <= truth) & (truth <= ends[:, 1])])
    error = np.array(values) - truth
    cover = 100.0 * np.mean(inside, axis=0)
    limits = (1.05, 0.1) if method == "waveform" else (1.15, 0.5)
    ratio, bias = error.std(axis=0) / bound(), error.mean(axis=0) / bound()
    head = f"{method}, {realisations} realisations"
    # What the bound's own linear estimate makes of the very same noise: the draw's own scatter.
    own = linear_estimates(realisations).std(axis=0) / bound()
    known = 100.0 / math.sqrt(2.0 * realisations)
    return [
        Row(
            f"{head} (which tell an sd to {known:.1f} %): the linear estimate at the truth, on the"
            " same noise: sd over the bound",
            ", ".join(f"{value:.4g}" for value in own),
        ),
        Row(
            f"{head}: sd over that of the linear estimate",
            ", ".join(f"{value:.4g}" for value in ratio / own),
        ),
        at_most(f"{head}: sd over the bound of a, b, c, Q", ratio.tolist(), limits[0]),
        at_most(f"{head}: bias in sd", bias.tolist(), limits[1]),
        within(f"{head}: 68 % intervals cover, %", cover[0].tolist(), 68.3, 3.0),
        within(f"{head}: 95 % intervals cover, %", cover[1].tolist(), 95.0, 3.0),
    ]


def speed(rounds: int = 100) -> list[Row]:
    """Time of the fits against find_peaks and curve_fit, and lmfit over solve_ivp."""
    records = [recording(seed) for seed in range(10)]
    half_period = len(TIME_S) / 309.6

    def by_turns(fit: Callable[[Recording], object]) -> tuple[Callable[[], object], int]:
        """Fit the same records in the same order, one a call."""
        turn = itertools.cycle(records)
        return lambda: fit(next(turn)), 1

    def spaced(one: Recording, *, quartic: bool) -> object:
        return spaced_peaks(TIME_S, one.values, NOISE, half_period, quartic=quartic)

    t = cpu_seconds(
        {
            "prominent": by_turns(lambda one: prominent_peaks(TIME_S, one.values, NOISE)),
            "spaced": by_turns(lambda one: spaced(one, quartic=False)),
            "quartic": by_turns(lambda one: spaced(one, quartic=True)),
            "points": by_turns(lambda one: pp.fit(one, method="turning-points")),
            "waveform": by_turns(pp.fit),
        },
        rounds,
        statistic=statistics.median,
    )
    shown = ", ".join(f"{1e3 * t[name]:.2f} ms" for name in t)
    ours = t["waveform"]
    found = [
        Row(
            "time from array to a, b, c with errors: `find_peaks` by prominence; by distance;"
            " by distance, with quartics; `pp.fit` of the turning points; `pp.fit`",
            shown,
        ),
        at_most("`pp.fit`, warm", 1e3 * ours, 5.0, " ms"),
        at_most("`pp.fit` over `find_peaks(prominence)`, `curve_fit`", ours / t["prominent"], 1.0),
        at_most(
            "`pp.fit` over `find_peaks(distance)`, quartics, `curve_fit` (told the period)",
            ours / t["quartic"],
            1.0,
        ),
        at_most(
            "`pp.fit` over `find_peaks(distance)`, `curve_fit` (told the period; c biased"
            " by -180 %)",
            ours / t["spaced"],
            1.0,
        ),
    ]
    if importlib.util.find_spec("lmfit"):
        found += against_lmfit(t["waveform"])
    return found


def against_lmfit(ours: float) -> list[Row]:
    """One run of lmfit over solve_ivp (half a minute and more)."""
    one = recording(0)
    began = time.process_time()
    found = lmfit_waveform(REFERENCE, 0.068, -0.3, TIME_S, one.values)
    spent = time.process_time() - began
    result = fit_recording(one)
    apart = [
        (result.value(name) - value) / result.parameters[name].sd
        for name, value in zip("abc", found, strict=True)
    ]
    return [
        at_least("`pp.fit` over lmfit with `solve_ivp`", spent / ours, 5000.0),
        at_most("the two apart, in sd of a, b, c", apart, 0.1),
    ]


def main() -> None:
    """Measure, and write the part of the page (the argument: how many realisations)."""
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    found = speed()
    for method in METHODS:
        found += precision(method, numbers[0] if numbers else 4000)
    write("The estimates: 32768 readings over 300 s, noise 0.1 mrad", found)


if __name__ == "__main__":
    main()
