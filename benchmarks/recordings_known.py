"""What is known of the real recordings beforehand, and which of it a diagnosis has found.

What is known is told by the recordings' own README (``../shared/recordings``); nothing of it is
told to the diagnosis. Each item is asked of ``diagnosis.json`` by a rule that can say no.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

Content = Mapping[str, Any]
"""Of ``diagnosis.json``."""


class Known(NamedTuple):
    """One known thing, and how it would show: the evidence in words, or None."""

    words: str
    shown: Callable[[Content], str | None]


def by_name(*names: str) -> Callable[[Content], str | None]:
    """One of these effects is named, or the record cannot tell it from what is named."""

    def shown(content: Content) -> str | None:
        for effect in content["effects"]:
            if effect["id"] in names:
                return f"{effect['id']} {effect['probability']:.0%}"
            for mate in effect["indistinguishable_from"]:
                if mate["id"] in names:
                    return f"{mate['id']} {mate['probability']:.0%}, beside {effect['id']}"
        return None

    return shown


def hardens(content: Content) -> str | None:
    """A cubic restoring torque of positive sign: dT/T = -(3/8) k3 A^2."""
    for effect in content["effects"]:
        if effect["id"] == "cubic-stiffness" and effect["parameters"]["k3"]["value"] > 0.0:
            share = -0.375 * effect["parameters"]["k3"]["value"]
            return f"cubic-stiffness, dT/T = {share:.2f} A^2"
    return None


def stiffens(content: Content) -> str | None:
    """The frequency is above the named model's at the smallest amplitudes."""
    found = content.get("small_amplitudes")
    if found and found["frequency_excess"] > 0.0:
        return f"+{found['frequency_excess']:.1%} at {found['amplitude_rad']:.2g} rad"
    return by_name("presliding-friction")(content)


def beats(content: Content) -> str | None:
    """A tone beside the motion's, with the period of its beats."""
    for effect in content["effects"]:
        found = re.search(r"beating with the motion every \S+ s", effect["location"]["summary"])
        if found:
            return f"{effect['id']}, {found.group()}"
    return None


def warned(words: str) -> Callable[[Content], str | None]:
    """A warning holds these words."""

    def shown(content: Content) -> str | None:
        return next((each for each in content["warnings"] if words in each), None)

    return shown


def like_a_spring(content: Content) -> str | None:
    """The period changes with the amplitude, but not as sin x makes it."""
    if by_name("circular-error")(content):
        return None
    return by_name("presliding-friction", "cubic-stiffness", "unnamed-restoring")(content)


def isochronous(content: Content) -> str | None:
    """Nothing that changes the period with the amplitude."""
    names = "circular-error", "cubic-stiffness", "quadratic-stiffness", "presliding-friction"
    return None if by_name(*names)(content) else "none of the restoring torque's entries"


CIRCULAR = Known("circular error", by_name("circular-error"))
COULOMB = Known("Coulomb friction", by_name("coulomb-friction"))
DRAG = Known("quadratic drag", by_name("quadratic-drag"))
STIFFENING = Known("stiffer below 0.04 rad", stiffens)
WANDER = Known("slow wander of the level", warned("the level wanders"))
SPRING = Known("spring-type period change, no circular error", like_a_spring)

KNOWN: Mapping[str, tuple[Known, ...]] = {
    "data32": (CIRCULAR, STIFFENING),
    "data2_14": (CIRCULAR, STIFFENING),
    "data2_20": (CIRCULAR, STIFFENING),
    "data2_12": (
        CIRCULAR,
        STIFFENING,
        Known("a gap of 13 s in the time column", warned("of 13.")),
    ),
    "adip": (CIRCULAR,),
    "AAAtAmp3": (CIRCULAR, WANDER),
    "8050": (CIRCULAR, WANDER),
    "8055": (CIRCULAR, WANDER),
    "1.3_100mA": (SPRING,),
    "1.3_200mA": (SPRING,),
    "21337": (Known("hardening moment, dT/T = -0.27 A^2", hardens),),
    "test1pend1": (CIRCULAR, Known("presliding at the end", stiffens)),
    "filo0509": (Known("a beat with a second mode", beats),),
    "lab1_data": (CIRCULAR,),
    "real_pend_h_1": (CIRCULAR,),
    "real_linear_h_1": (Known("isochronous", isochronous),),
    "damping_angle": (CIRCULAR, Known("one tracking error", by_name("glitches"))),
}
"""What the README knows beside a, b and c."""
KNOWN_VISCOUS: Mapping[str, tuple[Known, ...]] = {
    "1.3_100mA": (COULOMB,),
    "data32": (COULOMB, DRAG, CIRCULAR),
    "adip": (COULOMB, DRAG, CIRCULAR),
    "lab1_data": (DRAG, CIRCULAR),
}
"""And what Eq. 3 lacks."""


def cell(known: tuple[Known, ...], content: Content) -> str:
    """What is known of a recording, each item with what was found of it."""
    told = []
    for item in known:
        found = item.shown(content)
        told.append(f"{item.words}: " + (f"**found** ({found})" if found else "not found"))
    return "; ".join(told)
