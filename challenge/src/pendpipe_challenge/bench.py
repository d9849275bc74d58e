"""The oracle's workbench for one item: the baseline's tangent space, whitened.

The oracle knows the nuisances and the noise. What the baseline can absorb is the span of
its sensitivities (start, omega, viscous, hysteretic, quadratic, Coulomb, offset), taken by
central differences of the challenge's own integrator.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe_challenge.motion import Motion, Track
from pendpipe_challenge.scenario import Scenario, Whitening, stop_s

EQ8 = ("angle", "rate", "omega", "gamma", "hysteretic", "quadratic", "coulomb", "offset")
VISCOUS = ("angle", "rate", "omega", "gamma", "offset")
SMALL = 1e-4
"""Change of the reading, relative to the amplitude, that the differences aim at."""


@dataclass(frozen=True)
class Point:
    """One setting of the baseline: its motion and its level, rad."""

    motion: Motion
    level_rad: float

    def moved(self, name: str, by: float) -> Point:
        """Change one parameter; `by` is in its own unit, for omega relative."""
        motion = self.motion
        if name == "offset":
            return replace(self, level_rad=self.level_rad + by)
        if name == "angle":
            return replace(self, motion=replace(motion, angle_rad=motion.angle_rad + by))
        if name == "rate":
            return replace(self, motion=replace(motion, rate_rad_s=motion.rate_rad_s + by))
        value = motion.value(name)
        return replace(
            self,
            motion=motion.changed(**{name: value * (1 + by) if name == "omega" else value + by}),
        )


class Bench:
    """Baseline of one scenario, with what is needed to project and to refit.

    Parameters
    ----------
    scenario
        The item without its effect.
    kept
        Which samples are judged; those about a stop are not.
    """

    def __init__(self, scenario: Scenario, kept: BoolArray | None = None) -> None:
        self.scenario = scenario
        self.names = EQ8 if scenario.baseline == "eq8" else VISCOUS
        motion = scenario.motion
        if scenario.baseline == "viscous":
            motion = motion.changed(hysteretic=0.0, quadratic=0.0, coulomb=0.0)
        chain = scenario.chain
        self.gain = chain.volts_per_radian / chain.nominal_volts_per_radian
        self.truth = Point(motion, chain.offset_volts / chain.nominal_volts_per_radian)
        self.track: Track = motion.run(scenario.time_s)
        if kept is None:
            kept = scenario.time_s < stop_s(scenario, self.track)
        self.kept = kept
        self.count = int(kept.sum())
        self.sizes = self._sizes()
        slow = scenario.noise.slow(scenario.time_s)[kept]
        self.whiten = Whitening(scenario.sd_rad, slow)

    def _sizes(self) -> dict[str, float]:
        """Steps of the parameters that change the reading by about SMALL of the amplitude."""
        omega, track = self.scenario.omega, self.track
        swing = np.hypot(track.angle_rad, track.rate_rad_s / omega)
        span = min(self.scenario.span_s, float(np.trapezoid(swing, track.time_s) / swing[0]) * 2)
        a = swing[0]
        return {
            "angle": SMALL * a,
            "rate": SMALL * a * omega,
            "omega": SMALL / (omega * span),
            "gamma": 2.0 * SMALL / span,
            "hysteretic": 2.0 * SMALL / span,
            "quadratic": 2.0 * SMALL / (span * omega * a),
            "coulomb": 2.0 * SMALL * a * omega / span,
        }

    def reading(self, point: Point) -> FloatArray:
        """The baseline's reading in nominal angle, whole record."""
        track = point.motion.run(self.scenario.time_s)
        return np.asarray(self.gain * track.angle_rad + point.level_rad)

    def tangent(self, point: Point, more: Mapping[str, float] | None = None) -> FloatArray:
        """Sensitivities of the kept readings, a column a parameter (unit: its step).

        `more` are torques beside the baseline's, with their steps.
        """
        columns = []
        sizes = self.sizes | dict(more or {})
        for name in (*self.names, *(more or ())):
            if name == "offset":
                columns.append(np.full(len(self.kept), self.scenario.sd_rad))
                continue
            size = sizes[name]
            up = self.reading(point.moved(name, size))
            down = self.reading(point.moved(name, -size))
            columns.append(0.5 * (up - down))
        return np.column_stack(columns)[self.kept]

    @cached_property
    def propagator(self) -> FloatArray:
        """State at every sample for a change of the state at the first: (samples, 2, 2).

        Rows are x and v, columns the change of x and of v (in rad and rad/s).
        """
        columns = []
        for name in ("angle", "rate"):
            size = self.sizes[name]
            up = self.truth.moved(name, size).motion.run(self.scenario.time_s)
            down = self.truth.moved(name, -size).motion.run(self.scenario.time_s)
            columns.append(_state(up) - _state(down))
            columns[-1] /= 2.0 * size
        return np.stack(columns, axis=2)

    @cached_property
    def back(self) -> FloatArray:
        """Inverse of the propagator; zero where the motion has all but died away."""
        (a, b), (c, d) = self.propagator.transpose(1, 2, 0)
        determinant = a * d - b * c
        alive = np.abs(determinant) > 1e-12
        scale = np.where(alive, 1.0 / np.where(alive, determinant, 1.0), 0.0)
        return np.asarray(scale[:, None, None] * np.array([[d, -b], [-c, a]]).transpose(2, 0, 1))

    def state_change(self, name: str) -> FloatArray:
        """Change of x and v at every sample with one parameter's step, (samples, 2)."""
        size = self.sizes[name]
        up = self.truth.moved(name, size).motion.run(self.scenario.time_s)
        down = self.truth.moved(name, -size).motion.run(self.scenario.time_s)
        return np.asarray(0.5 * (_state(up) - _state(down)))

    @cached_property
    def jacobian(self) -> FloatArray:
        """Whitened sensitivities at the truth, a column a parameter."""
        return self.whiten(self.tangent(self.truth))

    @cached_property
    def basis(self) -> FloatArray:
        """Orthonormal basis of the whitened tangent space at the truth."""
        return orthonormal(self.jacobian)

    @cached_property
    def true_reading(self) -> FloatArray:
        """The baseline's reading at the truth, whole record."""
        return np.asarray(self.gain * self.track.angle_rad + self.truth.level_rad)

    def _linear(self, point: Point, more: Mapping[str, float] | None) -> FloatArray:
        """Whitened sensitivities at a point; those at the truth are kept."""
        if point is self.truth and not more:
            return self.jacobian
        return self.whiten(self.tangent(point, more))

    def off(self, columns: FloatArray) -> FloatArray:
        """Take the tangent space at the truth out of whitened columns."""
        return np.asarray(columns - self.basis @ (self.basis.T @ columns))

    def residual(self, reading: FloatArray) -> FloatArray:
        """Whitened difference of a whole record's reading and the truth's, kept part."""
        return self.whiten((reading - self.true_reading)[self.kept])

    def refit(
        self,
        reading: FloatArray,
        start: Point | None = None,
        rounds: int = 6,
        more: Mapping[str, float] | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> tuple[Point, FloatArray, float]:
        """Fit the baseline to a reading by Gauss and Newton.

        Parameters
        ----------
        reading
            Whole record, rad.
        start
            Where to begin; the truth if None.
        rounds
            Steps at most.
        more
            Torques beside the baseline's that are free too, with their steps.
        limits
            What some of them may not leave.

        Returns
        -------
        tuple
            The point, the whitened residual of the kept samples, and its square.
        """
        point = start or self.truth
        wanted = reading[self.kept]

        def left(at: Point) -> FloatArray:
            # A trial step may run away; it is then worse than what we have, and no fault.
            found = np.clip(self.reading(at)[self.kept], -1e6, 1e6)
            return self.whiten(wanted - found)

        residual = left(point)
        best = float(residual @ residual)
        sizes = self.sizes | {"offset": self.scenario.sd_rad} | dict(more or {})
        names = (*self.names, *(more or ()))
        units = [sizes[name] for name in names]
        jacobian, fresh = self._linear(point, more), True
        for _ in range(rounds):
            if not (np.isfinite(best) and np.isfinite(jacobian).all()):
                return point, residual, float("nan")
            change = np.linalg.lstsq(jacobian, residual, rcond=1e-12)[0]
            share, gained = 1.0, 0.0
            while share > 0.02:
                trial = point
                for name, unit, by in zip(names, units, share * change, strict=True):
                    trial = trial.moved(name, unit * by)
                if any(
                    not low <= trial.motion.value(name) <= high
                    for name, (low, high) in (limits or {}).items()
                ):
                    share *= 0.3
                    continue
                found = left(trial)
                square = float(found @ found)
                if square < best:
                    gained, best, point, residual = best - square, square, trial, found
                    break
                share *= 0.3
            if gained < 1e-3 * best + 1e-3:
                if fresh:
                    break
                jacobian, fresh = self._linear(point, more), True
                continue
            fresh = False
            if share < 1.0 or gained > 0.3 * (best + gained):
                # Far from straight: the old sensitivities no longer lead down.
                jacobian, fresh = self._linear(point, more), True
        return point, residual, best


def _state(track: Track) -> FloatArray:
    return np.column_stack([track.angle_rad, track.rate_rad_s])


def orthonormal(columns: FloatArray) -> FloatArray:
    """Orthonormal basis of a span, directions without weight left out."""
    norms = np.linalg.norm(columns, axis=0)
    kept = columns[:, norms > 0.0] / norms[norms > 0.0]
    u, weights, _ = np.linalg.svd(kept, full_matrices=False)
    return np.asarray(u[:, weights > 1e-9 * weights[0]])
