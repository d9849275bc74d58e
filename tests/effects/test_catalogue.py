"""The catalogue as a whole, and effects of other packages."""

import math
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.commands.small import catalogue_manual as manual
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, START, TIME, A, B, C
from pendpipe.effects import Effect, catalogue
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES, Curve
from pendpipe.effects.effect import Parameter, Span, enters
from pendpipe.effects.model import Model, pendulum_of, responses
from pendpipe.errors import InputError

from .pendulums import VALUES, baseline, times

# The catalogue as a whole: complete, without effect at size zero, its derivatives right.

DYNAMICS = [
    "circular-error",
    "cubic-stiffness",
    "quadratic-stiffness",
    "amplitude-linear-stiffness",
    "coulomb-friction",
    "quadratic-drag",
    "drag-form",
    "power-law-damping",
    "cubic-damping",
    "stribeck-friction",
    "presliding-friction",
    "backlash",
    "history-force",
    "vortex-shedding",
    "second-mode",
    "plane-coupling",
    "periodic-drive",
    "parametric-drive",
    "broadband-drive",
    "frequency-drift",
    "damping-drift",
    "equilibrium-creep",
    "equilibrium-step",
    "amplitude-step",
    "frequency-step",
    "damping-step",
    "impulse",
    "release-transient",
]
MEASUREMENT = [
    "sensor-quadratic",
    "sensor-cubic",
    "camera-geometry",
    "rolling-shutter",
    "count-slips",
    "clock-slips",
    "sensor-backlash",
    "offset-drift",
    "offset-step",
    "gain-drift",
    "ac-coupling",
    "tone-pickup",
    "clipping",
    "missing-codes",
    "coarse-quantisation",
    "clock-drift",
    "jitter",
    "dropped-samples",
    "glitches",
    "tracking-noise",
    "coloured-noise",
]
"""The identifiers that people outside rely on."""
BASE = baseline(a=7.2e-3, b=7.8e-3, c=1.3e-4, share=0.4, offset=0.01)
RECORD = times(60.0)
WITH_TEMPLATE = [effect.identifier for effect in CATALOGUE if effect.has_signature]
WITH_SIZE = [name for name in WITH_TEMPLATE if not by_identifier(name).form]
"""Another form of Eq. 8 is there, or it is not."""


def test_the_catalogue_holds_every_identifier_once() -> None:
    found = [effect.identifier for effect in CATALOGUE]
    assert sorted(found) == sorted([*DYNAMICS, *MEASUREMENT])
    for effect in CATALOGUE:
        assert effect.kind == ("dynamics" if effect.identifier in DYNAMICS else "measurement")
        assert by_identifier(effect.identifier) is effect


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"m\.toml: .*'circular-eror'; did you mean 'circular-er"):
        by_identifier("circular-eror", "m.toml")


def test_every_declaration_is_whole() -> None:
    for effect in CATALOGUE:
        assert effect.name
        assert effect.discriminating_test
        assert effect.equation.count("{") == effect.equation.count("}")
        names = [parameter.name for parameter in effect.parameters]
        assert len(names) == len(set(names))
        assert all(parameter.low < parameter.high for parameter in effect.parameters)
        assert effect.parameter_free or len(names) >= effect.sizes
        assert len(effect.example) == (effect.count if effect.has_signature else 0)


def test_the_page_has_every_effect_under_its_name() -> None:
    headings = re.findall(r"^### ([\w-]+)$", manual(), re.MULTILINE)
    assert sorted(headings) == sorted(effect.identifier for effect in CATALOGUE)


@pytest.mark.parametrize(
    ("unit", "power"),
    [
        *(("rad", 1), ("rad/s", 1), ("rad^2/s", 2), ("s rad", 1)),
        *(("1/rad^2", -2), ("1/(rad s)", -1), ("s^3/rad^4", -4), ("kg/rad", -1)),
        *(("1", 0), ("s", 0), ("grad", 0)),
    ],
)
def test_the_power_of_a_displacement_is_that_of_its_unit(unit: str, power: int) -> None:
    """A bound of a file in metres is scaled by it."""
    assert Parameter("size", unit, 0.0, 1.0).power == power


def test_units_follow_the_displacements() -> None:
    units = {parameter.unit_in("m") for effect in CATALOGUE for parameter in effect.parameters}
    assert "m/s^2" in units
    assert "1/m^2" in units
    assert not any("rad" in unit for unit in units)


def test_frictions_have_one_sign() -> None:
    """A size that can't be negative is looked for with its own sign only."""
    one_sided = {
        effect.identifier for effect in CATALOGUE if effect.has_signature and effect.one_sided
    }
    assert one_sided == {
        "circular-error",
        "coulomb-friction",
        "quadratic-drag",
        "drag-form",
        "power-law-damping",
        "stribeck-friction",
        "presliding-friction",
        "backlash",
        "history-force",
        "vortex-shedding",
        "sensor-backlash",
    }


def test_what_eq8_holds_is_left_out_of_its_catalogue() -> None:
    inside = {effect.identifier for effect in CATALOGUE if "eq8" in effect.inside}
    assert inside == {"coulomb-friction", "quadratic-drag"}


@pytest.mark.parametrize("identifier", WITH_TEMPLATE)
def test_at_size_zero_it_is_absent(identifier: str) -> None:
    effect = by_identifier(identifier)
    values = np.array(VALUES[identifier])
    values[: effect.sizes] = 0.0
    model = Model(RECORD, 0.05, order=max(14, effect.nodes))
    found = model.adding(effect).reading(np.append(BASE, values))
    np.testing.assert_allclose(found, model.reading(BASE), rtol=0.0, atol=3e-10)


@pytest.mark.parametrize("identifier", WITH_SIZE)
def test_it_changes_the_readings_in_proportion_to_its_size(identifier: str) -> None:
    """Half the (small) size, half the change, to first order."""
    effect = by_identifier(identifier)
    model = Model(RECORD, 0.05)
    own = model.reading(BASE)
    changes = []
    for part in (0.1, 0.05):
        values = np.array(VALUES[identifier])
        values[: effect.sizes] *= part
        changes.append(model.adding(effect).reading(np.append(BASE, values)) - own)
    assert np.linalg.norm(changes[0]) > 1e-7
    # What is not linear in the size is of the order of the change over the amplitude.
    within = 0.1 + 20.0 * float(np.max(np.abs(changes[0])))
    assert np.linalg.norm(changes[0] - 2.0 * changes[1]) < within * np.linalg.norm(changes[0])


def numerical(model: Model, value: FloatArray, index: int, step: float) -> FloatArray:
    low, high = value.copy(), value.copy()
    low[index] -= step
    high[index] += step
    return (model.reading(high) - model.reading(low)) / (2.0 * step)


FREQUENCIES = ("f_2", "f_d", "f_h", "f_a", "detuning")
BASELINE_STEPS = {A: 1e-5, B: 1e-5, C: 1e-6, OMEGA: 1e-5, START: 1e-5, TIME: 1e-5, OFFSET: 1e-5}


def with_derivatives(identifier: str) -> tuple[Effect, Model, FloatArray, FloatArray]:
    """An effect on the baseline: its model, their values, and the derivatives of the readings."""
    effect = by_identifier(identifier)
    model = Model(RECORD, 0.05).adding(effect)
    value = np.append(BASE, VALUES[identifier])
    return effect, model, value, model.evaluate(value).jacobian


@pytest.mark.parametrize("identifier", WITH_SIZE)
def test_derivatives_by_the_effects_own_values(identifier: str) -> None:
    """Derivatives against central differences, an instant's own neighbourhood apart."""
    effect, model, value, found = with_derivatives(identifier)
    for index in range(len(BASE), model.size):
        name = ["size", *(p.name for p in effect.parameters)][
            index - len(BASE) + 1 - effect.parameter_free
        ]
        step = 1e-2 * abs(value[index])
        if name == "time":
            step = 0.0625 * 2.0 * math.pi / float(BASE[OMEGA])
        elif name in FREQUENCIES:
            step = 1e-5
        expected = numerical(model, value, index, step)
        far = np.ones(len(RECORD), dtype=bool)
        if effect.local and "time" in [p.name for p in effect.parameters]:
            far = np.abs(RECORD - value[-1]) > 0.2
        error = np.linalg.norm((found[:, index] - expected)[far])
        # The instant of a pure jump of the amplitude hardly matters elsewhere.
        assert error <= 0.02 * np.linalg.norm(expected[far]) + 1e-6, name


@pytest.mark.parametrize("identifier", WITH_TEMPLATE)
def test_derivatives_by_the_baselines_values(identifier: str) -> None:
    """The same, of the baseline's columns where the effect is present.

    What the effect itself adds to the readings is not followed into these columns: they are
    off by as much as the effect is of the amplitude, which slows a fit a little.
    """
    _, model, value, found = with_derivatives(identifier)
    for index, step in BASELINE_STEPS.items():
        expected = numerical(model, value, index, step)
        error = np.linalg.norm(found[:, index] - expected)
        assert error < 0.025 * np.linalg.norm(expected), index


@pytest.mark.parametrize("kind", [*CURVES, *FOLLOW_UP_CURVES], ids=lambda kind: kind.__name__)
def test_readings_are_linear_in_a_curves_mixtures(kind: type[Curve]) -> None:
    """So that their derivatives are the same wherever they are asked on one motion."""
    model = Model(RECORD, 0.05)
    at = model.evaluate(BASE)
    curve = kind(at.span)
    values, change = np.random.default_rng(4).standard_normal((2, curve.count))
    there = replace(at, model=model.adding(curve), value=np.append(BASE, values))
    found = there.jacobian[:, len(BASE) :]
    moved = responses(curve, [(values, values + change)], at, model.pendulum(BASE))[0]
    assert found @ change == pytest.approx(moved, abs=1e-6 * np.max(np.abs(moved)))


def projected(
    effect: Effect, shape: tuple[float, ...], model: Model, basis: FloatArray
) -> FloatArray:
    """Columns of an effect's sizes, what the baseline can do taken off; orthonormal."""
    at = model.evaluate(BASE)
    columns = []
    for index in range(effect.sizes):
        low = np.concatenate([np.zeros(effect.sizes), shape])
        high = low.copy()
        high[index] = 1e-6
        columns.append(responses(effect, [(low, high)], at, model.pendulum(BASE))[0] / 1e-6)
    tall = np.stack(columns, axis=1)
    tall -= basis @ (basis.T @ tall)
    tall -= basis @ (basis.T @ tall)
    return np.linalg.qr(tall)[0]


SCANNED = [
    effect.identifier
    for effect in CATALOGUE
    if effect.has_signature and not effect.spectral and effect.sizes < len(effect.parameters)
]


@pytest.mark.parametrize("identifier", SCANNED)
def test_a_scan_keeps_most_of_what_lies_between_its_rows(identifier: str) -> None:
    """The correlation with the best row, beyond what the baseline can do: 0.9 usually."""
    effect = by_identifier(identifier)
    model = Model(RECORD, 0.05)
    at = model.evaluate(BASE)
    columns = at.jacobian
    basis = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)[0]
    rows = [tuple(row) for row in effect.shapes(at.span)]
    assert all(len(row) == len(effect.parameters) - effect.sizes for row in rows)
    bank = np.concatenate([projected(effect, row, model, basis) for row in rows], axis=1)
    random = np.random.default_rng(5)
    best = []
    for _ in range(25):
        low, high = rows[random.integers(len(rows) - 1)], None
        high = rows[min(rows.index(low) + 1, len(rows) - 1)]
        share = random.uniform()
        between = tuple(a + share * (b - a) for a, b in zip(low, high, strict=True))
        columns = projected(effect, between, model, basis)
        mixture = columns @ random.standard_normal(columns.shape[1])
        products = (bank.T @ (mixture / np.linalg.norm(mixture))).reshape(len(rows), -1)
        best.append(math.sqrt(float(np.max(np.sum(products**2, axis=1)))))
    assert float(np.median(best)) > 0.9
    assert min(best) > 0.6


@pytest.mark.parametrize(
    ("given", "said"),
    [({"equatoin": "y = x"}, "has no equatoin"), ({"name": "a push"}, "needs equation, discrim")],
)
def test_a_declaration_that_is_misspelt_or_short_is_refused(given: Any, said: str) -> None:
    """Else a word would be lost, or missed when a diagnosis prints it."""
    with pytest.raises(TypeError, match=f"push: an effect {said}"):

        @enters("reading", identifier="push", **given)
        def push(sampled: object, pendulum: object, size: float) -> float:
            return size


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.identifier)
def test_what_is_tried_of_an_effect_is_what_is_believed(effect: Effect) -> None:
    """Its example, what a simulation takes where nothing is given, and the shapes of a scan."""
    span = Span(0.0, 100.0, 0.05, pendulum_of(baseline(a=0.1, b=0.02, c=1e-3)), 0.4, 0.1)
    bounds = effect.bounds(100.0)
    defaults = [each.default for each in effect.parameters]
    for values in (effect.example, defaults, *effect.shapes(span)):
        behind = bounds[len(bounds) - len(values) :]
        for value, (low, high) in zip(values, behind, strict=True):
            assert value is None or low <= value <= high


# Other packages add effects; one that can't be loaded is named in a line and passed over.


@dataclass(order=True)
class Entry:
    """An entry point of a package that is installed."""

    name: str
    effect: Effect | None = None

    def load(self) -> Effect:
        if self.effect is None:
            raise ImportError(f"no module named {self.name}")
        return self.effect


def test_an_effect_of_another_package_is_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    known = catalogue._ALL
    entries = [Entry("absent"), Entry("other", known[0])]
    monkeypatch.setattr(catalogue, "entry_points", lambda **_: entries)
    assert tuple(catalogue._found()) == (*known, known[0])
    assert "the plugin 'absent' is skipped" in capsys.readouterr().err
