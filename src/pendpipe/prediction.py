"""What another experiment on the same pendulum shows: its next decay, and its driven response.

Near its resonance a lightly damped oscillator moves as it does when it is free, with the angular
frequency omega(y) and the loss lambda(y) = -d ln y/dt of its amplitude y. Driven at Omega by a
force f per inertia it settles where the first harmonic balances,

    (omega^2 - Omega^2) y = f cos(phi),    2 lambda Omega y g = f sin(phi),

phi the angle by which it lags, and g = 1 + (13/32) d ln omega/d ln y: by the action omega y_1^2/2
the energy of a swing changes with y as omega^2 y_1 g. Both curves come from decays: by the law that
a fit found, or where that is refuted by the backbone of its turning points, with the errors of
each.
"""

import math
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np

from pendpipe.analysis.fit.backbone import SECOND_ORDER
from pendpipe.analysis.fit.decrement import loss_of
from pendpipe.analysis.fit.fitted import Fitted
from pendpipe.analysis.fit.quality import period_of, relative_loss_sd
from pendpipe.analysis.torque import period_excess
from pendpipe.analysis.turning_points import (
    TurningPoints,
    is_turning_points,
    read_turning_points,
)
from pendpipe.answer import Answer
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.dynamics import Eq8
from pendpipe.dynamics.eq8 import SHARE_MEAN, SHARE_SD
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import Z95, Estimate
from pendpipe.files import finite
from pendpipe.options import ALTERNATIVES, POSITIVE, Option, checked
from pendpipe.quantities import after_number, with_error

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

DRAWS: Final = 999
"""Of the curves: the 2.5 % of them that lie beyond a limit are then known to a fifth."""
_ROWS: Final = 48
"""Of the curves; between them they are straight in the logarithms."""
_UP: Final = 2.0
"""Times the largest amplitude seen: so far the curves are continued."""
_STEPS: Final = 600
"""In ln y, of a decay and of what may balance a force: 1 % each over a fall to 1/400."""
_FREQUENCIES: Final = 201
"""Of a response on the command line: more than a figure shows."""
_SMALL: Final = 1e-3
"""Of a loss's error, what the loss is at least: a logarithm is taken of it."""
_WORK: Final = 13.0 / 32.0
"""1/2 of the action, less what the third harmonic takes, which is 1/16 of what lengthens a swing
(`backbone`): 1/16 by its change, and 1/32 by its size where that grows as y^2."""
_PERCENT: Final = (2.5, 50.0, 97.5)
DECAY: Final = ("amplitude", "time_s", "period_s", "quality_factor")
"""What is predicted of a turning point."""
DRIVEN: Final = ("frequency_hz", "amplitude", "phase_deg")
"""Columns of a table of driven states; `drive`, the drive's size, may stand beside them."""


def band(name: str, draws: FloatArray) -> dict[str, FloatArray]:
    """Columns of the middle and the 95 % limits of draws, shape (draws, n).

    NaN where fewer than half of them are numbers.
    """
    few = np.mean(np.isfinite(draws), axis=0) < 0.5
    filled = np.where(few, 0.0, draws)
    limits = np.nanpercentile(filled, _PERCENT, axis=0) if filled.size else np.empty((3, 0))
    names = f"{name}_low", name, f"{name}_high"
    return dict(zip(names, np.where(few, math.nan, limits), strict=True))


@dataclass(frozen=True)
class Curves:
    """Frequency and loss against amplitude, as draws from what the decays leave open.

    Parameters
    ----------
    log_amplitude
        ln y, ascending in equal steps, shape (m,).
    log_omega, log_loss
        ln of the angular frequency without losses (rad/s) and of -d ln y/dt (1/s), shape
        (draws, m).
    of_law
        By how much the losses lengthen a free swing; and the powers of the drive's frequency by
        which they differ from those of a free swing: of all but b, and minus the part of b, shape
        (3, m). A force that does not depend on the rate (dry or hysteretic friction) takes 1/Omega
        of what it takes at a rate of one, a viscous one the same, v|v| Omega times it.
    seen
        The smallest and the largest amplitude of the decays.
    unit
        Of the amplitude.
    records
        How many decays they are of.
    """

    log_amplitude: FloatArray
    log_omega: FloatArray
    log_loss: FloatArray
    of_law: FloatArray
    seen: tuple[float, float]
    unit: str
    records: int = 1

    def free(self, amplitude: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angular frequency and loss of a free motion, each of shape (draws, n).

        The amplitudes are of shape (n,) or (draws, n).
        """
        omega, loss, _, (late, *_) = self._at(amplitude)
        return omega / (1.0 + late), loss

    def driven(
        self, amplitude: FloatArray
    ) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
        """The same of a motion that is driven at angular frequencies, rad/s; the loss times g.

        Which friction it is changes the frequency to the second order of the loss as well. What
        part of b is hysteretic no decay tells.
        """
        omega, loss, bent, (_, sure, of_b) = self._at(amplitude)
        late, share, rough = np.random.default_rng(1).standard_normal((3, len(loss), 1))
        power = sure + of_b * np.clip(SHARE_MEAN + SHARE_SD * share, 0.0, 1.0)
        lower = SECOND_ORDER * (loss / omega) ** 2 * late
        # As unsure as the third harmonic is large.
        longer = np.exp(self.log_omega[:, :1]) / omega - 1.0
        work = 1.0 + _WORK * np.log(bent) + longer / 16.0 * rough
        swings, takes = omega * (1.0 + lower), loss * work * omega**-power
        # (An exponential: a power takes four times as long.)
        return lambda drive: (swings, takes * np.exp(power * np.log(drive)))

    def _at(self, amplitude: FloatArray) -> tuple[FloatArray, ...]:
        logs = np.log(np.atleast_2d(amplitude))
        place = (logs - self.log_amplitude[0]) / (self.log_amplitude[1] - self.log_amplitude[0])
        first = np.clip(place.astype(int), 0, len(self.log_amplitude) - 2)
        draw, part = np.arange(len(self.log_loss))[:, None], place - first
        slope = np.gradient(self.log_omega, self.log_amplitude, axis=1)
        omega, loss, bent = (
            np.exp(each[draw, first] * (1.0 - part) + each[draw, first + 1] * part)
            for each in (self.log_omega, self.log_loss, slope)
        )
        own = np.stack([np.interp(logs, self.log_amplitude, each) for each in self.of_law])
        return omega, loss, bent, own

    def outside(self, amplitude: FloatArray) -> BoolArray:
        """Whether amplitudes are not among those that the decays showed."""
        return np.asarray((amplitude < self.seen[0]) | (amplitude > self.seen[1]))


def curves_of(fits: Sequence[Fitted]) -> Curves:
    """Draw frequency and loss from what the decays of one pendulum leave open.

    Parameters
    ----------
    fits
        Of one decay, or of several.

    Raises
    ------
    InputError
        If a fit has neither a law that holds nor turning points that show period and loss.

    Notes
    -----
    Of a law that holds, the curves are the law's; else those of the backbone, which beyond what was
    seen goes straight on in the logarithms, and is as unsure as it changes by that. The error of a
    curve is taken to be alike at all amplitudes. Several decays have a variance between them
    besides (DerSimonian and Laird), by which another experiment differs too: with Student's t of
    one degree of freedom fewer than there are decays.
    """
    refuse_if(not fits, "predict", "no decay is given", "give one recording or several")
    units = {fit.parameters["amplitude"].unit for fit in fits}
    refuse_if(
        len(units) > 1,
        "predict",
        f"the recordings are in {' and '.join(sorted(units))}",
        "give recordings of one pendulum in one unit",
    )
    rng = np.random.default_rng(0)
    spans = [_seen(fit) for fit in fits]
    low, high = min(span[0] for span in spans), max(span[1] for span in spans)
    logs = np.linspace(math.log(low), math.log(_UP * high), _ROWS)
    drawn = np.stack([_drawn(fit, span, logs, rng) for fit, span in zip(fits, spans, strict=True)])
    both = drawn[0] if len(fits) == 1 else _together(drawn, spans, logs, rng)
    of_law = np.mean([_of_law(fit.law, logs) for fit in fits], axis=0)
    return Curves(logs, both[0], both[1], of_law, (low, high), units.pop(), len(fits))


def _of_law(law: Eq8, logs: FloatArray) -> FloatArray:
    """What losses lengthen a swing by, and the powers of the drive's frequency in them, (3, m).

    The first harmonic of rho^2 is omega^2/3 + 2 Omega^2/3.
    """
    y, b = np.exp(logs), law.hysteretic + law.viscous
    late = period_excess(y, law.angular_frequency, law.quadratic, b, law.coulomb, law.share)
    drag, dry = law.quadratic * y, law.coulomb / y
    own = drag * (1.0 if law.drag == "speed" else 1.0 / 3.0) - dry
    total = np.maximum(drag + b + dry, 1e-300)
    return np.stack([late, own / total, -b / total])


def _seen(fit: Fitted) -> tuple[float, float]:
    """The smallest and the largest amplitude of a decay."""
    if (shown := fit.lawless) is not None:
        return shown.seen_rad[1], shown.seen_rad[0]
    problem = "its turning points do not show period and loss, and no law holds"
    refuse_if(
        fit.points is None or fit.light == "red", fit.name, problem, "give a longer recording"
    )
    assert fit.points is not None
    return float(fit.points.amplitude_rad.min()), float(fit.points.amplitude_rad.max())


def _drawn(
    fit: Fitted, seen: tuple[float, float], logs: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Logarithms of omega and lambda of one decay, shape (2, draws, m)."""
    shown, hertz = fit.lawless, fit.parameters["frequency"]
    # A law goes on by itself; a backbone straight on from the last third of what was seen.
    inside = logs if shown is None else np.clip(logs, *np.log(seen))
    rows = list[tuple[float, float, float, float]]()
    for y in np.exp(inside).tolist():
        if shown is None:
            errors = hertz.sd / hertz.value, relative_loss_sd(fit, y)
            rows.append((period_of(fit, y), loss_of(fit.law, y), *errors))
        else:
            period, loss = shown.period(y), shown.loss(y)
            lasts = period.value / (1.0 + float(_of_law(fit.law, np.log([y]))[0, 0]))
            size = max(loss.value, _SMALL * loss.sd)
            rows.append((lasts, size, period.sd / period.value, loss.sd / size))
    lasts, size, *relative = np.array(rows).T
    refuse_if(not np.all(size > 0.0), fit.name, "it shows no loss", "give a longer recording")
    last = (inside == logs) & (logs > np.log(seen) @ (1.0 / 3.0, 2.0 / 3.0))
    found = []
    for middle, sd in zip((np.log(math.tau / lasts), np.log(size)), relative, strict=True):
        # Beyond, it is as unsure as it changes by that.
        more = np.polyfit(logs[last], middle[last], 1)[0] * np.maximum(logs - inside, 0.0)
        found.append(middle + more + np.hypot(sd, more) * rng.standard_normal((DRAWS, 1)))
    return np.stack(found)


def _together(
    drawn: FloatArray,
    spans: Sequence[tuple[float, float]],
    logs: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """The curves of several decays, shape (2, draws, m), for one experiment more."""
    middle, variance = np.median(drawn, axis=2), np.var(drawn, axis=2)
    # A decay counts where it was seen; where none was, the one that came nearest.
    low, high = np.log(np.array(spans)).T
    far = np.maximum(low[:, None] - logs, logs - high[:, None]).clip(0.0)
    near = (far <= far.min(axis=0) + 1e-12)[:, None]
    weight = near / variance
    k = near.sum(axis=0)
    mean = (weight * middle).sum(axis=0) / weight.sum(axis=0)
    excess = (weight * (middle - mean) ** 2).sum(axis=0) - (k - 1)
    scale = weight.sum(axis=0) - (weight**2).sum(axis=0) / weight.sum(axis=0)
    # Alike at all amplitudes, in the logarithms: three decays tell little of each.
    several = k[0] > 1
    whole = np.maximum(scale[:, several].sum(axis=1), 1e-300)  # none, where no two overlap
    between = np.maximum(excess[:, several].sum(axis=1) / whole, 0.0)[:, None]
    weight = near / (variance + between)
    weight /= weight.sum(axis=0)
    mean = (weight[:, :, None] * drawn).sum(axis=0)
    t = rng.standard_t(len(spans) - 1, (2, DRAWS, 1))
    return np.asarray(mean + np.sqrt(between)[:, None] * t)


def decay_from(curves: Curves, amplitude: float) -> "DataFrame":
    """Predict the turning points of a decay from an amplitude, down to the smallest seen.

    Parameters
    ----------
    amplitude
        Of the release, the first turning point, in the unit of the curves.

    Returns
    -------
    pandas.DataFrame
        A row a turning point: ``time_s``, ``amplitude``, ``period_s``, ``quality_factor`` with
        their limits (``time_s_low``, ...), and whether the amplitude is ``extrapolated``.

    Notes
    -----
    ``t = integral of d ln y/lambda`` and ``k pi = integral of omega d ln y/lambda`` from the
    release down to the k-th turning point.
    """
    import pandas as pd

    low, high = curves.seen[0], _UP * curves.seen[1]
    refuse_if(
        not low < amplitude <= high,
        "amplitude",
        f"{amplitude:g} is not between {low:.3g} and {high:.3g}{after_number(curves.unit)}",
        "predict from another amplitude, or give a recording that was let go at a larger one",
    )
    logs = np.linspace(math.log(amplitude), math.log(low), _STEPS)
    omega, loss = curves.free(np.exp(logs))
    rates = np.stack([1.0 / loss, omega / loss])
    steps = 0.5 * (rates[..., 1:] + rates[..., :-1]) * (logs[0] - logs[1])
    time, phase = np.pad(np.cumsum(steps, axis=2), ((0, 0), (0, 0), (1, 0)))
    turns = math.pi * np.arange(int(np.median(phase[:, -1]) / math.pi) + 1)
    passed = [np.interp(turns, own, np.arange(_STEPS), right=math.nan) for own in phase]
    times = [
        np.interp(each, np.arange(_STEPS), own) for each, own in zip(passed, time, strict=True)
    ]
    ys = amplitude * (low / amplitude) ** (np.array(passed) / (_STEPS - 1))
    found = band("time_s", np.array(times)) | band("amplitude", ys)
    there = np.fmax(found["amplitude"], low)
    omega, loss = curves.free(there)
    found |= band("period_s", math.tau / omega) | band("quality_factor", 0.5 * omega / loss)
    return pd.DataFrame(found | {"extrapolated": curves.outside(there)})


def phase_of(curves: Curves, frequency_hz: FloatArray, amplitude: FloatArray) -> FloatArray:
    """Phase in degrees at drive frequencies and amplitudes, shape (draws, n); negative: it lags.

    It does not depend on the force: ``tan phi = -2 lambda g Omega/(omega^2 - Omega^2)``.
    """
    drive = math.tau * frequency_hz
    omega, loss = curves.driven(amplitude)(drive)
    return np.asarray(-np.degrees(np.arctan2(2.0 * loss * drive, omega**2 - drive**2)))


def force_of(curves: Curves, amplitude: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """The force per inertia that holds amplitudes, of a drive in Hz: unit/s^2, (draws, n)."""
    driven = curves.driven(amplitude)

    def force(frequency_hz: FloatArray) -> FloatArray:
        drive = math.tau * frequency_hz
        omega, loss = driven(drive)
        return np.asarray(amplitude * np.hypot(omega**2 - drive**2, 2.0 * loss * drive))

    return force


def response(curves: Curves, frequency_hz: FloatArray, force: FloatArray) -> "DataFrame":
    """Predict amplitude and phase of a driven pendulum, all branches of a bent resonance.

    Parameters
    ----------
    frequency_hz
        Of the drive, shape (n,).
    force
        Its amplitude per inertia, in the unit of the curves/s^2, shape (n,) or (draws, n); of a
        support that moves by s, Omega^2 s.

    Returns
    -------
    pandas.DataFrame
        A row a state: ``frequency_hz``, ``branch`` (``lower`` and ``upper``, which are one where
        only one state is, and ``unstable`` between them), ``amplitude`` and ``phase_deg`` with
        their limits, and whether the amplitude is ``extrapolated``.

    Notes
    -----
    A state is stable where a larger force holds a larger amplitude. Where friction holds the
    pendulum there is none.
    """
    import pandas as pd

    logs = np.linspace(math.log(0.1 * curves.seen[0]), curves.log_amplitude[-1], _STEPS)
    draw, states = np.arange(DRAWS), list[tuple[float, str, FloatArray]]()
    holds = force_of(curves, np.exp(logs))
    for hertz, pushed in zip(
        frequency_hz, np.broadcast_to(force, (DRAWS, len(frequency_hz))).T, strict=True
    ):
        held = np.log(holds(np.array(hertz))) - np.log(pushed)[:, None]
        rising = (held[:, 1:] > 0.0) & (held[:, :-1] <= 0.0)
        falling = (held[:, 1:] <= 0.0) & (held[:, :-1] > 0.0)
        last = _STEPS - 2 - rising[:, ::-1].argmax(axis=1)
        for branch, place, there in (
            ("lower", rising.argmax(axis=1), rising.any(axis=1)),
            ("upper", last, rising.any(axis=1)),
            ("unstable", falling.argmax(axis=1), (rising.sum(axis=1) > 1)),
        ):
            if np.mean(there) >= 0.5:
                one, two = held[draw, place], held[draw, place + 1]
                found = logs[place] + (logs[1] - logs[0]) * one / np.where(
                    there, one - two, math.nan
                )
                states.append((hertz, branch, np.exp(found)))
    at = np.array([state[0] for state in states])
    y = np.array([state[2] for state in states]).reshape(-1, DRAWS).T
    y_or_one = np.where(np.isfinite(y), y, 1.0)
    phase = np.where(np.isfinite(y), phase_of(curves, at, y_or_one), math.nan)
    columns = band("amplitude", y) | band("phase_deg", phase)
    outside = curves.outside(columns["amplitude"])
    branches = [state[1] for state in states]
    return pd.DataFrame(
        {"frequency_hz": at, "branch": branches, **columns, "extrapolated": outside}
    )


@dataclass(frozen=True, repr=False)
class Prediction:
    """What another experiment on the same pendulum shows. It prints as a few lines.

    Parameters
    ----------
    curves
        Frequency and loss against amplitude.
    decay, response
        What was asked for, as `decay_from` and `response` return it.
    compared
        A row a measured number: ``quantity`` (``phase_deg``, ``amplitude``, ``time_s``), ``at``
        (frequency in Hz, or turning point), ``measured``, ``value`` with its limits,
        ``extrapolated``, and whether the band ``held`` it.
    force
        Force per inertia over drive, where the largest measured amplitude told it.
    """

    curves: Curves
    decay: "DataFrame | None" = None
    response: "DataFrame | None" = None
    compared: "DataFrame | None" = None
    force: Estimate | None = None

    @property
    def tables(self) -> "dict[str, DataFrame]":
        """What was asked for, by name."""
        names = "decay", "response", "compared"
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    @property
    def answer(self) -> Answer:
        """The answer in words."""
        unit, (low, high) = after_number(self.curves.unit), self.curves.seen
        of = "one decay" if self.curves.records == 1 else f"{self.curves.records} decays"
        head = f"predicted from {of}, {low:.3g} to {high:.3g}{unit}, with 95 % bands"
        rows = list[tuple[str, str]]()
        for name, table in self.tables.items():
            groups = table.groupby(["quantity", "extrapolated"]) if name == "compared" else ()
            for (quantity, outside), each in groups:
                rms = math.sqrt(((each.measured - each.value) ** 2).mean())
                after = {"phase_deg": "°", "time_s": " s", "amplitude": unit}[str(quantity)]
                said = f"{each.held.sum()} of {len(each)} in the band, rms {rms:.2g}{after}"
                title = f"measured {str(quantity).partition('_')[0]}"
                rows.append((title, said + ", extrapolated" * bool(outside)))
            if name == "decay":
                for place in sorted({0, (len(table) - 1) // 2, len(table) - 1}):
                    told = [_text(table.iloc[place], each) for each in DECAY]
                    said = "{}{} at {} s, T {} s, Q {}".format(told[0], unit, *told[1:])
                    rows.append((f"turning point {place}", said))
            if name == "response" and table.empty:
                least = f"{0.1 * low:.2g}{unit}"
                rows.append(("no state", f"friction holds it, or it swings by less than {least}"))
            elif name == "response":
                one = table.iloc[int(table.amplitude.argmax())]
                where = f"{unit} at {one.frequency_hz:.5g} Hz, phase {_text(one, 'phase_deg')}°"
                rows.append(("largest state", f"{_text(one, 'amplitude')}{where}"))
                two = table.frequency_hz[table.branch == "unstable"]
                ends = f"from {two.min():.5g} to {two.max():.5g} Hz"
                rows += [("two states", ends)] if len(two) else []
        if self.force is not None:
            rows.append(("force constant", f"{self.force}, from the largest measured amplitude"))
        beyond = any(table.extrapolated.any() for table in self.tables.values())
        remark = "beyond the amplitudes of the decays it extrapolates: the bands open there"
        return Answer((head,), tuple(rows), remarks=(remark,) * beyond)

    def __str__(self) -> str:
        return "\n".join(self.answer.lines())

    __repr__ = __str__

    def to_dict(self) -> dict[str, Any]:
        """Return the prediction as plain numbers, a list a column."""
        known = {
            "schema_version": 1,
            "records": self.curves.records,
            "seen": list(self.curves.seen),
            "unit": self.curves.unit,
            "force_constant": self.force and self.force.as_json(),
            "decay": None,
            "response": None,
            "compared": None,
        }
        lists = {name: table.to_dict("list") for name, table in self.tables.items()}
        return dict(finite(known | lists))

    def plot(self) -> "Figure":
        """Draw the bands, and the measured points."""
        from pendpipe.figures.prediction import draw_prediction

        return draw_prediction(self.tables, self.curves.unit)


def _text(row: Any, name: str) -> str:
    """A value, with a quarter of the width of its band as its error."""
    sd = (row[f"{name}_high"] - row[f"{name}_low"]) / (2.0 * Z95)
    return with_error(float(row[name]), float(sd), short=True) if sd > 0.0 else f"{row[name]:.4g}"


def frequencies(text: str) -> FloatArray:
    """Read LOW:HIGH in Hz.

    >>> len(frequencies("0.9:1.1"))
    201
    """
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low = high = 0.0
    if not 0.0 < low < high < math.inf:
        raise ArgumentTypeError(f"{text!r} is not LOW:HIGH in Hz, as 0.9:1.1")
    return np.linspace(low, high, _FREQUENCIES)


@checked
def predict(
    source: Any,
    *,
    amplitude: Annotated[
        float | None,
        Option(
            "predict the decay from this amplitude, in the recording's unit",
            "Y",
            POSITIVE,
            flag="--from",
        ),
    ] = None,
    drive: Annotated[
        Any,
        Option("predict the driven response at these frequencies, Hz", "LOW:HIGH", frequencies),
    ] = None,
    drive_force: Annotated[
        float | None,
        Option(
            "amplitude of the driving torque over the inertia, in the recording's unit/s^2",
            "F",
            POSITIVE,
            heading=ALTERNATIVES,
        ),
    ] = None,
    support: Annotated[
        float | None,
        Option(
            "amplitude of the support's motion, in the recording's unit (of a pendulum: over its"
            " length)",
            "S",
            POSITIVE,
            heading=ALTERNATIVES,
        ),
    ] = None,
    points: "str | Path | TurningPoints | None" = None,
) -> Prediction:
    """Predict another decay of a pendulum, and its response to a drive, with 95 % bands.

    Parameters
    ----------
    source
        A fit or a diagnosis, a recording or the path of its file; or several of one pendulum.
    {options}
    points
        What was measured: turning points of a decay, or a table (CSV) with the columns
        ``frequency_hz``, ``amplitude``, ``phase_deg``. Phases are predicted at the measured
        amplitudes, whatever the force. With a column ``drive`` (of a `support`, its motion), the
        largest amplitude tells the force constant, with which the others are predicted.

    Returns
    -------
    Prediction
        ``.decay``, ``.response``, ``.compared``, ``.plot()``, ``.to_dict()``.

    Raises
    ------
    InputError
        If a decay shows no law and no backbone, or it is asked for too far above the amplitudes
        that were seen.

    Examples
    --------
    >>> import pendpipe as pp
    >>> fit = pp.fit("examples/rod-pendulum.csv")
    >>> found = pp.predict(fit, amplitude=0.08, drive=[0.87, 0.873], drive_force=0.01)
    >>> len(found.decay), found.response.branch.tolist()
    (96, ['lower', 'upper', 'lower', 'upper'])
    """
    size, moves = support or drive_force, support is not None
    refuse_if(
        (drive is not None and size is None)
        or all(each is None for each in (drive, amplitude, points)),
        "predict",
        "it is not said what to predict",
        "give an amplitude (--from), or frequencies (--drive) with a force (--drive-force) or the"
        " motion of the support (--support), or what was measured (--points)",
    )
    sources = source if isinstance(source, list | tuple) else [source]
    curves, driven = curves_of([_fit_of(each) for each in sources]), None
    decay = None if amplitude is None else decay_from(curves, amplitude)
    if drive is not None and size is not None:
        hertz = np.asarray(drive, dtype=np.float64)
        driven = response(curves, hertz, size * (math.tau * hertz) ** (2.0 * moves))
    if isinstance(points, str | Path) and is_turning_points(points):
        points = read_turning_points(points)
    compared, constant = None, None
    if isinstance(points, TurningPoints):
        compared = _beside_turning_points(curves, points)
    elif points is not None:
        compared, constant = _beside_driven(curves, read_driven(points), moves=moves)
    return Prediction(curves, decay, driven, compared, constant)


def _fit_of(source: Any) -> Fitted:
    """The fit of a recording, or that which a diagnosis began with."""
    from pendpipe.api import fit

    found = getattr(source, "fit", source)
    return found if isinstance(found, Fitted) else fit(source)


def _compared(
    curves: Curves,
    quantity: str,
    at: FloatArray,
    measured: FloatArray,
    predicted: dict[str, FloatArray],
    amplitude: FloatArray,
) -> "DataFrame":
    """Rows of `Prediction.compared`."""
    import pandas as pd

    low, value, high = predicted.values()
    held = (low <= measured) & (measured <= high)
    numbers = {"at": at, "measured": measured, "low": low, "value": value, "high": high}
    found = pd.DataFrame({"quantity": quantity, **numbers})
    return found.assign(extrapolated=curves.outside(amplitude), held=held)


def _beside_turning_points(curves: Curves, points: TurningPoints) -> "DataFrame":
    """A measured decay beside that which its release predicts."""
    import pandas as pd

    y, order = points.amplitude_rad, points.half_cycle - points.half_cycle[0]
    predicted = decay_from(curves, float(y[0]))
    rows = (order > 0) & (order < len(predicted))
    there, tables = predicted.iloc[order[rows]], []
    for name, values, sd in (
        ("time_s", points.time_s - points.time_s[0], points.time_sd_s),
        ("amplitude", y, points.angle_sd_rad),
    ):
        # Of the release too: the first point is where the prediction begins.
        more = Z95 * np.hypot(sd[rows], sd[0])
        value = there[name].to_numpy()
        down, up = (np.hypot(there[f"{name}_{end}"] - value, more) for end in ("low", "high"))
        limits = {"low": value - down, "value": value, "high": value + up}
        tables.append(_compared(curves, name, order[rows] * 1.0, values[rows], limits, y[rows]))
    return pd.concat(tables, ignore_index=True)


def read_driven(path: str | Path) -> "DataFrame":
    """Read a table of driven states, with the columns of `DRIVEN`."""
    import pandas as pd

    remedy = f"give a CSV with the columns {', '.join(DRIVEN)}, and drive where its size is known"
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True)
    except (OSError, ValueError) as problem:
        raise InputError(path, f"no table can be read ({problem})", remedy) from None
    missing = [name for name in DRIVEN if name not in table]
    refuse_if(missing, path, f"it has no column {' and '.join(missing)}", remedy)
    kept = table[[name for name in (*DRIVEN, "drive") if name in table]]
    numbers = kept.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    good = np.isfinite(numbers).all(axis=1) & (numbers[:, :2] > 0.0).all(axis=1)
    refuse_if(not good.any(), path, "no row has positive numbers in them", remedy)
    return pd.DataFrame(numbers[good], columns=kept.columns)


def _beside_driven(
    curves: Curves, table: "DataFrame", *, moves: bool
) -> "tuple[DataFrame, Estimate | None]":
    """Measured states beside the phases at their amplitudes, and the amplitudes of one force."""
    import pandas as pd

    hertz, y, phase = (table[name].to_numpy() for name in DRIVEN)
    phases = band("value", phase_of(curves, hertz, y))
    turned = (phase - phases["value"] + 180.0) % 360.0 - 180.0 + phases["value"]
    found = _compared(curves, "phase_deg", hertz, turned, phases, y)
    if "drive" not in table:
        return found, None
    drive = table["drive"].to_numpy() * (math.tau * hertz) ** (2.0 * moves)
    largest = int(np.argmax(np.where(curves.outside(y), 0.0, y)))
    constant = force_of(curves, y)(hertz)[:, largest] / drive[largest]
    states, limits = (
        response(curves, hertz, constant[:, None] * drive),
        np.full((3, len(y)), math.nan),
    )
    for place, (one, size) in enumerate(zip(hertz, y, strict=True)):
        near = states[states.frequency_hz == one]
        if len(near):
            best = near.loc[(near.amplitude / size).apply(math.log).abs().idxmin()]
            limits[:, place] = best[["amplitude_low", "amplitude", "amplitude_high"]]
    sizes = dict(zip(("low", "value", "high"), limits, strict=True))
    others = _compared(curves, "amplitude", hertz, y, sizes, y).drop(index=largest)
    low, value, high = np.percentile(constant, _PERCENT).tolist()
    told = Estimate(
        value, (high - low) / (2.0 * Z95), "" if moves else f"{curves.unit}/s^2", (low, high)
    )
    return pd.concat([found, others], ignore_index=True), told
