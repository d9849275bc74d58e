"""Stated probabilities and intervals beside the truth: coins of known bias, normal errors."""

import numpy as np
import pytest

import pendpipe as pp

IDENTIFIER, NUMBER = "cubic-stiffness", "k3"


def answer(probability, value=0.0, sd=1.0, rivals=(), presumed=False, name=IDENTIFIER):
    """A diagnosis of one effect."""
    half = 1.959963984540054 * sd
    parameters = {
        NUMBER: {
            "value": value,
            "sd": sd,
            "unit": "",
            "at_bound": False,
            "interval95": [value - half, value + half],
        }
    }
    listed = [{"id": each, "probability": p} for each, p in rivals]
    effect = {"id": name, "probability": probability, "presumed": presumed}
    return {"effects": [effect | {"parameters": parameters, "indistinguishable_from": listed}]}


@pytest.fixture(scope="module")
def coins():
    """Answers that are right as often as they say, whose sizes err as much as they say."""
    rng = np.random.default_rng(68)
    stated, sizes = rng.uniform(0.01, 0.99, 2000), rng.normal(size=2000)
    answers = [answer(p, value) for p, value in zip(stated, sizes, strict=True)]
    true = rng.uniform(size=2000) < stated
    return answers, [{IDENTIFIER: {NUMBER: 0.0}} if each else {} for each in true]


def test_what_is_as_sure_as_it_says_is_calibrated(coins):
    found = pp.judge(*coins)
    inside = found.bins["stated"].between(found.bins["low95"], found.bins["high95"])
    assert len(found.bins) == 10
    assert inside.sum() >= 8
    assert found.error < 0.03
    assert min(found.names_p_value, found.sizes_p_value) > 0.01
    # 95 % of some thousand, and three standard deviations of such a share.
    held = found.sizes["held"]
    assert abs(held.mean() - 0.95) < 3 * (0.95 * 0.05 / len(held)) ** 0.5


@pytest.mark.parametrize(
    "boast", [lambda p: p**0.3, lambda p: p**3, lambda p: 0.5 + 0.2 * (p - 0.5)]
)
def test_what_is_too_sure_or_not_sure_enough_is_seen(coins, boast):
    answers, truths = coins
    boasts = [answer(boast(each["effects"][0]["probability"])) for each in answers]
    assert pp.judge(boasts, truths).names_p_value < 1e-3


@pytest.mark.parametrize("scale", [0.7, 1.4])
def test_errors_of_another_size_are_seen(coins, scale):
    answers, truths = coins
    values = [each["effects"][0]["parameters"][NUMBER]["value"] for each in answers]
    found = pp.judge([answer(0.5, value, scale) for value in values], truths)
    assert found.sizes_p_value < 1e-3
    assert found.sizes["pull"].std() == pytest.approx(1 / scale, rel=0.1)


def test_a_skew_interval_is_measured_on_the_side_of_the_truth():
    skew = answer(0.9, value=1.0)
    skew["effects"][0]["parameters"][NUMBER]["interval95"] = [0.9, 3.0]
    above, below = ({IDENTIFIER: {NUMBER: truth}} for truth in (3.0, 0.9))
    pulls = pp.judge([skew, skew], [above, below]).sizes["pull"]
    assert list(pulls) == pytest.approx([1.96, -1.96], abs=1e-3)


def test_an_interval_that_ends_at_its_value_is_missed_by_any_error_beyond():
    ended = answer(0.9, value=1.0)
    ended["effects"][0]["parameters"][NUMBER]["interval95"] = [0.5, 1.0]
    sizes = pp.judge([ended], [{IDENTIFIER: {NUMBER: 1.0001}}]).sizes
    assert sizes[["pull", "held"]].values.tolist() == [[float("inf"), False]]


def test_who_claims_what():
    """Presumed effects and curves claim nothing; two names that are both true are one claim."""
    rivals = [("quadratic-stiffness", 0.2), ("unnamed-restoring", 0.1)]
    several = answer(0.6, rivals=rivals)
    nothing = [answer(1.0, presumed=True), answer(1.0, name="unnamed-damping")]
    both = {IDENTIFIER: {}, "quadratic-stiffness": {}}
    found = pp.judge([several, *nothing], [both, {}, {}]).names
    assert found[["answer", "id", "true"]].values.tolist() == [[0, IDENTIFIER, True]]
    assert found["probability"].tolist() == pytest.approx([0.8])
    apart = pp.judge([several], [{"quadratic-stiffness": {}}]).names
    assert apart[["probability", "true"]].values.tolist() == [[0.6, False], [0.2, True]]


def test_each_answer_needs_a_truth():
    with pytest.raises(pp.InputError, match="2 truths for 1 answers"):
        pp.judge([answer(0.5)], [{}, {}])


def test_a_number_by_another_name_is_refused_by_place():
    with pytest.raises(pp.InputError, match=r"truths\[1\].*it has no k9; name one of \['k3'\]"):
        pp.judge([answer(0.5)] * 2, [{}, {IDENTIFIER: {"k9": 1.0}}])


def test_a_diagnosis_is_an_answer_as_it_stands():
    found = pp.judge([pp.diagnose("examples/rod-pendulum.csv")], [{}])
    assert str(found) == "no name is claimed"
