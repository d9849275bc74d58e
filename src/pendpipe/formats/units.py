"""Units as people write them, and the SI unit that each is a multiple of."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from math import pi
from typing import Final, Literal

Kind = Literal["angle", "volts", "length", "time", "angular velocity", "other"]


@dataclass(frozen=True)
class Unit:
    """A unit: what it measures, and its size in rad, V, m, s or rad/s."""

    kind: Kind
    factor: float


_DEGREE = pi / 180
_SPELLINGS: Final[tuple[tuple[Kind, float, str], ...]] = (
    ("angle", 1.0, "rad rads radian radians radiant radianti radianes radiani рад 弧度"),
    ("angle", 1e-3, "mrad millirad milliradian milliradians"),
    ("angle", 1e-6, "µrad urad microrad microradian microradians"),
    ("angle", _DEGREE, "deg degs degree degrees ° º grad grado grados gradi degré degrés degre"),
    ("angle", _DEGREE, "graden stopnie grader град 度 degr dg altgrad"),
    ("angle", pi / 200, "gon gons"),
    ("angle", _DEGREE / 60, "arcmin ' ′"),
    ("angle", _DEGREE / 3600, "arcsec ″"),
    ("angle", 2 * pi, "rev revs turn turns revolution revolutions umdrehungen tours"),
    ("volts", 1.0, "v volt volts vdc volt(s) voltios в"),
    ("volts", 1e-3, "mv millivolt millivolts"),
    ("volts", 1e-6, "µv uv microvolt microvolts"),
    ("volts", 1e3, "kv"),
    ("length", 1.0, "m meter meters metre metres metro metros metri mètre mètres м 米"),
    ("length", 1e-1, "dm"),
    ("length", 1e-2, "cm centimeter centimeters centimetre centimetres zentimeter см 厘米"),
    ("length", 1e-3, "mm millimeter millimeters millimetre millimetres мм 毫米"),
    ("length", 1e-6, "µm um micron microns micrometer micrometre"),
    ("length", 0.0254, 'in inch inches "'),
    ("length", 0.3048, "ft foot feet"),
    ("time", 1.0, "s sec secs second seconds sek sekunde sekunden seconde secondes segundos"),
    ("time", 1.0, "segundo secondi secondo с сек 秒 초"),
    ("time", 1e-3, "ms msec msecs millis milli millisecond milliseconds millisekunden мс 毫秒"),
    ("time", 1e-6, "µs us usec usecs micros microsecond microseconds mikrosekunden мкс 微秒"),
    ("time", 1e-9, "ns nsec nanos nanosecond nanoseconds"),
    ("time", 60.0, "min mins minute minutes minuten"),
    ("time", 3600.0, "h hr hrs hour hours"),
    ("angular velocity", 1.0, "rad/s rad/sec rads/s radian/s radians/s s-1 1/s rad.s-1"),
    ("angular velocity", _DEGREE, "deg/s °/s degrees/s deg/sec degree/s grad/s dps º/s"),
    ("other", 1.0, "m/s cm/s mm/s m/s2 m/s^2 rad/s2 rad/s^2 deg/s2 deg/s^2 °/s2 °/s^2 px/s"),
    (
        "other",
        1.0,
        "hz khz mhz 1/min rpm a ma n nm n·m j w pa kpa hpa bar k c °c degc °f db g t mt",
    ),
    ("other", 1.0, "px pix pixel pixels % kg ms-2 ms-1 count counts tick ticks steps lsb a.u. au"),
)
_UNITS: Final = {
    word: Unit(kind, factor) for kind, factor, words in _SPELLINGS for word in words.split()
}


def plain(text: str) -> str:
    """Lower-case a name or unit and give each sign one form (both µ, ², full width)."""
    text = unicodedata.normalize("NFKC", text).replace("μ", "µ").replace("−", "-")
    return " ".join(text.strip().strip("\"'").lower().split())


def unit_of(text: str) -> Unit | None:
    """Find a unit by what is written for it; ``None`` where it is not known."""
    word = plain(text).strip("[](){}<> ")
    return _UNITS.get(word) or _UNITS.get(word.replace(" ", "").rstrip("."))


_BRACKETED: Final = re.compile(r"^(.*?)\s*[\[({<]\s*([^\])}>]*)\s*[\])}>]\s*(.*)$")
_SLASHED: Final = re.compile(r"^(.+?)(?:\s+/\s*|\s*/\s+)(\S+)$")
_SPACED: Final = re.compile(r"^(.+?)(?:\s+in\s+|,\s*|\s+(?=\S\S))(\S+)$")
_SUFFIX: Final = re.compile(r"^(.+?)[_\-.]([A-Za-zµ°]+)$")
_CAMEL: Final = re.compile(
    r"^(.*[a-z])(Rad|Deg|Mrad|Sec|Ms|Us|Mm|Cm|Volts?|Seconds|Millis|Micros)$"
)


def split_header(text: str) -> tuple[str, str]:
    """Split a column's header into name and unit, as written.

    Examples
    --------
    >>> split_header("Weg &b_A1 / rad"), split_header("Angle (deg) Run #1")
    (('Weg &b_A1', 'rad'), ('Angle', 'deg'))
    >>> split_header("theta_deg"), split_header("x")
    (('theta', 'deg'), ('x', ''))
    """
    text = text.strip().strip("\"'").strip()
    text = re.sub(r"(?i)^(latest|run\s*\d+|data ?set\s*\d*|set\s*\d+)\s*:\s*", "", text)
    text = (
        re.sub(r"(?i)[\s,]*(?:\brun|\bch(?:annel)?s?)\s*#?\s*[\d&]+\s*$", "", text).strip() or text
    )
    bracketed = _BRACKETED.match(text)
    # "angle (0 up, pi down)" is a remark, "[foo]" a unit that nobody knows.
    remark = bracketed is not None and unit_of(bracketed[2]) is None and " " in bracketed[2]
    if bracketed and bracketed[1] and not remark:
        name = f"{bracketed[1]} {bracketed[3]}".strip()
        return re.sub(r"(?i)\s*\brun\s*#?\d+\s*$", "", name), bracketed[2].strip()
    for pattern in (_SLASHED, _SPACED, _SUFFIX, _CAMEL):
        split = pattern.match(text)
        if split is None:
            continue
        unit = unit_of(split[2])
        # One letter after an underscore is as likely an axis or an index as a unit.
        bare = pattern is _SUFFIX and len(split[2]) == 1 and split[2] not in "sV°"
        if split[2] == "m" and re.fullmatch(r"(?i)x|y|z|pos|position|displacement", split[1]):
            bare = False
        if unit is not None and not bare:
            return split[1].strip(), split[2]
    return text, ""
