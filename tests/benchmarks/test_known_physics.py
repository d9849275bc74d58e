"""The table of known physics is judged by names and numbers."""

from typing import Any

from benchmarks import known_physics as known
from pendpipe.effects.catalogue import CATALOGUE


def answers(effects: list[dict[str, Any]], **parameters: dict[str, Any]) -> known.Answers:
    """A diagnosis with these effects and parameters."""
    content = {"effects": effects, "improved": {"parameters": parameters}}
    return known.Answers({"content": {}}, {"content": content, "status": 0})


def effect(name: str, *others: str, **coefficient: float) -> dict[str, Any]:
    """A named effect with the rest of its class."""
    return {
        "id": name,
        "probability": 0.8,
        "indistinguishable_from": [{"id": each, "probability": 0.1} for each in others],
        "parameters": {key: {"value": value} for key, value in coefficient.items()},
    }


def test_an_item_is_found_by_a_name_or_by_its_class_and_by_no_other() -> None:
    found = answers([effect("circular-error", "cubic-stiffness", k3=-0.2)])
    assert known.is_found("circular-error", found)
    assert known.is_found("clipping/cubic-stiffness", found)
    assert not known.is_found("second-mode", found)
    assert not known.is_found("hardening", found)
    assert known.is_found("hardening", answers([effect("cubic-stiffness", k3=0.7)]))
    assert not known.is_found("hardening", answers([effect("cubic-stiffness", k3=-0.7)]))


def test_a_loss_is_found_where_its_interval_excludes_none() -> None:
    there, unsure = ({"value": 0.1, "interval95": [low, 0.2]} for low in (0.05, 0.0))
    assert known.is_found("a>0", answers([], a=there))
    assert not known.is_found("a>0", answers([], a=unsure))


def test_every_item_of_the_table_can_be_judged() -> None:
    words = {"quality", "period", "from", "until", "says", "gap", *known.TESTS}
    new = {"count-slips", "clock-slips", "rolling-shutter", "camera-geometry", "tracking-noise"}
    new |= {"amplitude-linear-stiffness", "keulegan-carpenter-drag"}
    new |= {effect.identifier for effect in CATALOGUE}
    new |= {"unnamed-restoring", "unnamed-measurement", "unnamed-drive", "unnamed-damping"}
    for row in known.table():
        listed = known.items(row["known"]) + known.items(row["by_hand"])
        for each in [*"/".join(listed).split("/"), *row["wrong"].split("/")]:
            assert each.partition(":")[0] in words | new | {""}
