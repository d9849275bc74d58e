"""What a campaign's answer says: causes where the scan alarms, records that disagree, shares."""

import numpy as np
import pytest

from pendpipe.campaign.diagnose import campaign_diagnosis, search
from pendpipe.campaign.fit import Measured, named

from .campaigns import data, default

DESIGN = default()


def odd_record(record: str, percent: float, seed: int) -> Measured:
    """Sound data but for one b."""
    found = data(default(), seed=seed)
    values = found.values.copy()
    number = [run.record for run in DESIGN.runs].index(record)
    values[number, 1] *= 1.0 + 0.01 * percent
    return found._replace(values=values)


@pytest.mark.parametrize(
    ("record", "percent"), [("water-low-5", 1.2), ("water-high-8", -1.2), ("air-03", -1.2)]
)
def test_a_record_that_disagrees_is_named_and_no_cause(record: str, percent: float) -> None:
    content = campaign_diagnosis(search(default(), odd_record(record, percent, 3)), {})
    assert content["verdict"] == "missing-physics"
    assert [far["record"] for far in content["left_out"]] == [record]
    assert content["left_out"][0]["sigma"] * percent > 0.0
    assert [effect["kind"] for effect in content["effects"]] == ["unnamed"]
    assert f"{record} lies" in content["statement"]
    assert "Most probable" not in content["statement"]
    # With it and without it.
    numbers = content["numbers"]
    assert numbers["all_records"]["chi2"] - numbers["without"]["chi2"] > 30.0
    drag = numbers["without"]["drag_factor"]
    assert abs(drag["value"] - 1.0) < 3.0 * drag["sd"]


def test_a_cause_is_found_beside_a_record_that_disagrees() -> None:
    hidden = named("uniform-drag-excess")
    moved = np.zeros(len(DESIGN.nuisances))
    moved[DESIGN.index["distance of lower at 0.2129 m"]] = 20.0  # a weight 2 mm off
    answer = search(DESIGN, data(DESIGN, hidden, (0.117,), seed=5, moved=moved))
    assert [far.record for far in answer.left_out] == ["water-high-4"]
    (found,) = answer.found
    inside = {found.leader.last.identifier, *(r.last.identifier for r, _ in found.rivals)}
    assert "uniform-drag-excess" in inside


def test_nothing_is_named_where_the_scan_is_silent() -> None:
    """Off by 2 sigma from one record to the next, b makes chi^2 alarm, and no pattern."""
    found = data(DESIGN)
    values = found.values.copy()
    values[np.argsort(values[:, 0]), 1] *= 1.0 + 0.002 * (-1.0) ** np.arange(len(values))
    answer = search(DESIGN, found._replace(values=values))
    assert answer.missing
    assert (answer.found, answer.left_out) == ((), ())
    content = campaign_diagnosis(answer, {})
    assert [effect["kind"] for effect in content["effects"]] == ["unnamed"]
    assert "No effect of the catalogue stands out" in content["statement"]


def test_nothing_competes_with_the_causes() -> None:
    """Near the level of the alarm the evidence for a cause is no 99 %."""
    answer = search(DESIGN, data(DESIGN, named("uniform-drag-excess"), (0.025,), seed=5))
    content = campaign_diagnosis(answer, {})
    assert 0.001 < answer.p_value < 0.01
    (effect,) = content["effects"]
    shares = [effect["probability"], effect["probability_of_nothing"]]
    shares += [rival["probability"] for rival in effect["indistinguishable_from"]]
    assert effect["probability_of_nothing"] > 0.02
    assert effect["probability"] < 0.9
    assert sum(shares) <= 1.0 + 1e-12
    assert "nothing at all" in content["statement"]
    # What stands in the numbers beforehand is said, and is in the file.
    assert "0.05 (viscosity excess)" in content["statement"]
    assert content["priors"]["nothing_missing"] == 0.5
    assert content["priors"]["expected_size"]["viscosity-temperature"] == 0.05


def test_two_causes_are_one_sentence() -> None:
    both = named("uniform-drag-excess", "grease-drag")
    content = campaign_diagnosis(search(DESIGN, data(DESIGN, both, (0.117, 2e-5), seed=5)), {})
    assert len(content["effects"]) == 2
    assert content["statement"].count("Most probable") == 1
    assert "beside each other" in content["statement"]


def test_a_record_that_would_not_swing_in_glycerol_is_said() -> None:
    hidden = named("uniform-drag-excess")
    content = campaign_diagnosis(search(DESIGN, data(DESIGN, hidden, (0.117,), seed=5)), {})
    runs = {run["measurement"]: run for run in content["effects"][0]["next_measurements"]}
    assert runs["half glycerol, half water"]["would_not_swing"] == ["water-low-1"]
    assert runs["the same records once more"]["would_not_swing"] == []
    assert "water-low-1 would not swing in it" in content["statement"]


def test_a_recording_that_is_there_twice_is_said() -> None:
    answer = search(default(), data(default(), seed=7))
    content = campaign_diagnosis(answer, {}, {"again": "water-low-7"})
    assert content["warnings"] == ["again is the same recording as water-low-7"]
    assert "again is the same recording as water-low-7: each counts once." in content["statement"]
