"""The words of a header: what each unit is worth, and what a column's name promises."""

import re
import unicodedata
from dataclasses import dataclass
from itertools import chain
from math import pi
from typing import Final, Literal

from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2

Kind = Literal["angle", "volts", "length", "time", "own", "none"]


@dataclass(frozen=True)
class Unit:
    """A unit: what it measures, and its size in rad, V, m, s, or in the unit `name`.

    A unit of kind ``"own"`` (counts, pixels, m/s^2, rad/s, lx) has no constant that would make
    it an angle: its readings are analysed as they are. Of kind ``"none"`` (Hz, kg) nothing
    swings.
    """

    kind: Kind
    factor: float
    name: str = ""


_DEGREE = pi / 180
_SPELLINGS: Final[tuple[tuple[Kind, float, str, str], ...]] = (
    ("angle", 1.0, "rad", "rad rads radian radians radiant radianti radianes radiani рад 弧度"),
    ("angle", 1e-3, "rad", "mrad millirad milliradian milliradians"),
    ("angle", 1e-6, "rad", "µrad urad microrad microradian microradians"),
    ("angle", _DEGREE, "rad", "deg degs degree degrees ° º grad grado grados gradi degré degrés"),
    ("angle", _DEGREE, "rad", "degre graden stopnie grader град 度 degr dg altgrad graus grau"),
    ("angle", _DEGREE, "rad", "stopni derece µοίρες stupně"),
    ("angle", _DEGREE * 1e-3, "rad", "mdeg millidegree millidegrees"),
    ("angle", pi / 200, "rad", "gon gons"),
    ("angle", _DEGREE / 60, "rad", "arcmin ' ′"),
    ("angle", _DEGREE / 3600, "rad", "arcsec ″"),
    ("angle", 2 * pi, "rad", "rev revs turn turns revolution revolutions umdrehungen tours giri"),
    ("angle", pi, "rad", "half-turns"),
    ("volts", 1.0, "V", "v volt volts vdc voltdc volt(s) voltios в"),
    ("volts", 1e-3, "V", "mv millivolt millivolts"),
    ("volts", 1e-6, "V", "µv uv microvolt microvolts"),
    ("volts", 1e3, "V", "kv"),
    ("length", 1.0, "m", "m meter meters metre metres metro metros metri mètre mètres м 米"),
    ("length", 1e-1, "m", "dm"),
    ("length", 1e-2, "m", "cm centimeter centimeters centimetre centimetres zentimeter см 厘米"),
    ("length", 1e-3, "m", "mm millimeter millimeters millimetre millimetres мм 毫米"),
    ("length", 1e-6, "m", "µm um micron microns micrometer micrometre"),
    ("length", 0.0254, "m", 'in inch inches "'),
    ("length", 0.3048, "m", "ft foot feet"),
    ("time", 1.0, "s", "s sec secs second seconds sek sekunde sekunden seconde secondes segundos"),
    ("time", 1.0, "s", "segundo secondi secondo с сек 秒 초"),
    ("time", 1e-3, "s", "ms msec msecs millis milli millisecond milliseconds millisekunden мс"),
    ("time", 1e-3, "s", "毫秒 millisecondi"),
    ("time", 1e-6, "s", "µs us usec usecs micros microsecond microseconds mikrosekunden мкс 微秒"),
    ("time", 1e-9, "s", "ns nsec nsecs nanosec nanos nanosecond nanoseconds"),
    ("time", 60.0, "s", "min mins minute minutes minuten"),
    ("time", 3600.0, "s", "h hr hrs hour hours"),
    ("own", 1.0, "rad/s", "rad/s rad/sec rads/s radian/s radians/s s-1 1/s rad.s-1 rads-1 s^-1"),
    ("own", _DEGREE, "rad/s", "deg/s °/s degrees/s deg/sec degree/s grad/s dps º/s"),
    ("own", 1.0, "rad/s^2", "rad/s2 rad/s^2 rad/s/s"),
    ("own", _DEGREE * 1e-3, "rad/s", "mdps mdeg/s"),
    ("own", _DEGREE, "rad/s^2", "deg/s2 deg/s^2 °/s2 °/s^2 deg/s/s"),
    ("own", 1.0, "m/s", "m/s m/sec ms-1 m.s-1"),
    ("own", 1e-2, "m/s", "cm/s"),
    ("own", 1e-3, "m/s", "mm/s"),
    ("own", 1.0, "m/s^2", "m/s2 m/s^2 m/s/s m/sec^2 ms-2 m.s-2"),
    ("own", STANDARD_GRAVITY_M_PER_S2, "m/s^2", "g gn gee"),
    ("own", 1e-3 * STANDARD_GRAVITY_M_PER_S2, "m/s^2", "mg"),
    ("own", 1.0, "pixels", "px pix pixel pixels píxeles"),
    ("own", 1.0, "counts", "count counts cnt cnts tick ticks steps lsb digits bit bits adu"),
    ("own", 1.0, "divisions", "skalenteile skt div divisions"),
    ("own", 1.0, "px/s", "px/s"),
    ("own", 1.0, "lx", "lx lux"),
    ("own", 1.0, "T", "t tesla"),
    ("own", 1e-3, "T", "mt"),
    ("own", 1e-6, "T", "µt ut"),
    ("own", 1e-4, "T", "gauss"),
    ("own", 1.0, "N", "n newton newtons"),
    ("own", 1e-3, "N", "mn"),
    ("own", 1.0, "N m", "nm n·m n*m"),
    ("own", 1.0, "A", "a amp amps ampere"),
    ("own", 1e-3, "A", "ma"),
    ("own", 1e-6, "A", "µa ua"),
    ("own", 1.0, "1", "% a.u. au arb.u. arb 1 -"),
    ("none", 1.0, "", "hz khz mhz 1/min rpm j w pa kpa hpa bar k c °c degc °f db kg"),
)
_UNITS: Final = {
    word: Unit(kind, factor, name)
    for kind, factor, name, words in _SPELLINGS
    for word in words.split()
}


def plain(text: str) -> str:
    """Lower-case a name or unit and give each sign one form (both µ, ², full width)."""
    text = unicodedata.normalize("NFKC", text).replace("μ", "µ").replace("−", "-")
    return " ".join(text.lower().split())


def unit_of(text: str) -> Unit | None:
    """Find a unit by what is written for it; ``None`` where it is not known."""
    word = plain(text).strip("[](){}<> $")
    return _UNITS.get(word) or _UNITS.get(word.replace(" ", "").rstrip("."))


_BRACKETED: Final = re.compile(r"\s*[\[({<]\s*([^\])}>]*)\s*[\])}>]\s*")
_REMARK: Final = re.compile(r"(?<=.)\s*\([^()]*\)$")
_SLASHED: Final = re.compile(r"^(.+?)\s*/\s*(\S.*)$")
_SPACED: Final = re.compile(r"^(.+?)(?:\s+in\s+|\s*[,;:]\s*|\s+(?=\S\S))(\S+)$")
_SUFFIX: Final = re.compile(r"^(.+?)[_\-.]([A-Za-zµ°]+)$")
_PER_SECOND: Final = re.compile(
    r"(?i)^(.+?)[_\-.](m?rad|deg|[cm]?m)[_\-.](?:per[_\-.])?s(ec)?(?:ond)?((?:\^|\*\*)?2|²)?$"
)
"""``gyro_rad_s``, ``acc_m_s2``, ``v_cm_per_s``: the signs of a quotient are none of a name."""
_LIKELY: Final = re.compile(
    r".*([^_\-.]{2}|[_\-.][sV°])|(?i:s|x|y|z|pos|position|displacement)[_\-.]m"
)
_CAMEL: Final = re.compile(
    r"^(.*[a-z])(Rad|Deg|Mrad|Sec|Ms|Us|Mm|Cm|Volts?|Seconds|Millis|Micros)$"
)


def split_header(text: str) -> tuple[str, str]:
    """Split a column's header into name and unit, as written.

    Examples
    --------
    >>> split_header("Weg &b_A1 / rad"), split_header("Angle (deg) Run #1")
    (('Weg &b_A1', 'rad'), ('Angle', 'deg'))
    >>> split_header("theta_deg"), split_header("x"), split_header("gyro_rad_s")
    (('theta', 'deg'), ('x', ''), ('gyro', 'rad/s'))
    """
    text = " ".join(text.replace("$", "").replace("\\", "").split()).strip(' "')
    text = re.sub(r"_\{([^}]*)\}", r"_\1", text)
    text = text[1:-1] if len(text) > 2 and text[0] == text[-1] == "'" else text
    text = re.sub(r"(?i)^(latest|run\s*\d+|data ?set\s*\d*|set\s*\d+)\s*:\s*", "", text)
    text = (
        re.sub(r"(?i)[\s,]*(?:\brun|\bch(?:annel)?s?)\s*#?\s*[\d&]+\s*$", "", text).strip() or text
    )
    if unit_of(text) is not None and len(plain(text)) > 1 and "/" in text:
        return text, text
    brackets = list(_BRACKETED.finditer(text))
    known = [found for found in brackets if unit_of(found[1]) is not None]
    for found in [*known[-1:], *brackets[:1]]:
        # "angle (0 up, pi down)" is a remark, "[foo]" a unit that nobody knows.
        if found.start() and (known or " " not in found[1]):
            name = f"{text[: found.start()]} {text[found.end() :]}".strip()
            return re.sub(r"(?i)\s*\brun\s*#?\d+\s*$", "", name), found[1].strip()
    if (rate := _PER_SECOND.match(text)) and role_of(rate[1]) != "time":
        return rate[1].strip(), f"{rate[2]}/s{'^2' * bool(rate[4])}"
    for pattern in (_SLASHED, _SPACED, _SUFFIX, _CAMEL):
        split = pattern.match(_REMARK.sub("", text))
        # One letter after an underscore is as likely an axis or an index as a unit.
        if split and unit_of(split[2]) and (pattern is not _SUFFIX or _LIKELY.fullmatch(split[0])):
            return split[1].strip(), split[2].strip()
    return text, ""


Role = Literal[
    "time",
    "index",
    "angle",
    "length",
    "volts",
    "signal",
    "velocity",
    "acceleration",
    "none",
    "unknown",
]
"""What a column holds. A ``signal`` is light, force, field; ``none`` is a drive, a model, an
uncertainty, a temperature: nothing that a free pendulum's motion is read from."""

# Tried in this order: "angular velocity" is no angle, "time derivative" no time.
_WORDS: Final[tuple[tuple[Role, str], ...]] = (
    (
        "none",
        r"d[xyt]|[a-z]+'+|δ\w*|delta_?\w*|uncert\w*|unsicherheit|fehler|err(or)?|\w_?err|xerr|yerr|std(dev)?|sigma"
        r"|incertezza|errore|incertitude|erreur|incertidumbre|temp(erature)?|temperatur"
        r"|freq(uency)?|frequenz|frequenza|fft|spectrum|energy|energie|energia|fit(ted)?|model"
        r"|sim(ulated)?|set|setpoint|target|ref(erence)?|command|cmd|control|input(?! [a-d\d]\b)"
        r"|pwm|power|pressure|mass|massa|masse|period|periodo|periode|quality|flag|status|residuals?|weight"
        r"|battery|duty|event|events|torque|moment|drive|driver|driving|motor|exciter|erreger"
        r"|anregung|forzante|forcing|excitation|excitador|func\s?gen\w*|generator|amplitude"
        r"|ampiezza|amplitud|einhüllende|envelope|phase|phasen\w*|fase|func|window|smooth\w*"
        r"|filter(ed)?|covariance|correlation|tg ?f|[abw] t(otal)?|g ?f ?total|magnitude"
        r"|betrag|absolute(?! (ang|pos|win))",
    ),
    (
        "acceleration",
        r"dd ?(theta|phi|alpha|angle|x|y)\d?"
        r"|acc(el\w*)?|g ?f[xyz]|g-?force|\w*acceleration|a(x|y|z)?"
        r"|\w*beschleunigung|accelerazione"
        r"|aceleraci[oó]n|accélération|\w*_?ddot|ускорение|加速度|alpha_?dd",
    ),
    (
        "velocity",
        r"angular (velocity|speed|rate)|winkelgeschw\w*|gyro\w*|omega\d?|ω\d?|\w*theta_?dot"
        r"|th_?dot|\w*phi_?dot|\w*alpha_?dot|d\s?theta|dphi|dth|vitesse angulaire"
        r"|velocidad angular|velocit[aà] angolare|hoeksnelheid|w[xyz]?|g[xyz]|rotation rate"
        r"|\w*velocity|\w*velocities|vel\w*|v(x|y|z)?|speed|\w*geschw\w*|vitesse|velocidad|velocit[aà]"
        r"|snelheid|\w*dot|derivative|\w*ableitung|deriv\w*|d\w+/dt|скорость|速度",
    ),
    (
        "time",
        r"t\d?|time\d?|times|zeit|messzeit|temps|tiempo|tempo|tijd|czas|время|时间|時間|시간|aika"
        r"|tid|timestamps?|time_?stamps?|elapsed|seconds?|secs?|sekunden|millis|micros"
        r"|milliseconds|microseconds|ms|us|µs|uptime|clock|uhrzeit|datetime|relative time|time_s"
        r"|tm|epoch|unix\w*|secondi|segundos|abs_?t|laufzeit",
    ),
    (
        "index",
        r"frames?|seq|sequence|bild|index|idx|samples?|n|no|nr|num|number|#|row|point|points|pt#|counter|trial"
        r"|run|tirada|ensayo|corrida|prova|lauf|scan|id|record|zeile|schritt|step|campione|riga",
    ),
    (
        "angle",
        r"\w*theta\w*|teta\w*|th\d?|\w*[θϑφϕψαβγ]\w*|\w*phi\d?|fi|psi|alpha\d?|beta\d?|gamma\d?"
        r"|\w*angle\w*|ang|angular (position|displacement)|angpos|\w*winkel\w*|\w*angulo\w*"
        r"|\w*ángulo\w*|angolo|hoek|kąt|kat|угол|角度?|각도|auslenkung|ausschlag|roll|pitch|yaw|tilt"
        r"|yw|pt|rl|inclin\w*|neigung|deflection|deflexion|swing|pendulum\w*|pend\w*|\w*pendel\w*"
        r"|encoder\w*|enc\d?|rotation|rot|azimuth|heading|deg(rees)?|rad(ians)?|grad|q\d?|o|kulma"
        r"|vinkel|açı|ângulo|gimbal",
    ),
    (
        "signal",
        r"light|licht|illuminance|lux|intensity|intensität|luminosity|brightness|photo\w*|ldr|magnet\w*"
        r"|field|feld|campo|force|kraft|forza|fuerza|tension force|current|strom|corrente|hall"
        r"|counts?|raw|b(x|y|z)|m(x|y|z)|mag\w*|lumière|luce|luz|i",
    ),
    (
        "volts",
        r"volts?|\w*voltage|spannung|tension|voltaje|tensione|tensión|напряжение|电压|電圧|u"
        r"|ch\s?\d*v?|chn\s?\d*|channel\s?\d*|kanal\s?\d*|ain\d*|ai\d*|adc\d*|a\d|analog\w*"
        r"|inp?(ut)?\s?\d+|ampl|potential|sensor\w*|signal|output|out|poti\w*",
    ),
    (
        "length",
        r"\w*position\w*|pos\w*|x\d?|y\d?|z\d?|px|py|\w*displacement\w*|\w*distance|dist|abstand|weg"
        r"|ort|strecke|[ée]longation|elongación|spostamento|posizione|posición|lage|height|höhe"
        r"|hoogte|uitwijking|verplaatsing|ultrasonic|sonar|laser|lvdt|range|level|déplacement|r"
        r"|length|s",
    ),
)
_PATTERNS: Final = tuple(
    (role, re.compile(rf"(?<![^\W_])(?:{words})(?![^\W_'])")) for role, words in _WORDS
)


def role_of(name: str) -> Role:
    """Tell what a column's name (without its unit) promises.

    Examples
    --------
    >>> role_of("Zeit t"), role_of("Pendulum angle"), role_of("Angular Velocity")
    ('time', 'angle', 'velocity')
    """
    words = plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.strip()))
    whole = re.sub(r"[\s_\-.]+", " ", words).strip()
    # "Zeit2" and "Zeit (2)" are the time of the second run.
    forms = (whole, words, re.sub(r" ?\(?\d+\)?$", "", whole))
    is_it = (role for form in forms for role, pattern in _PATTERNS if pattern.fullmatch(form))
    # One letter inside a longer name ("pendulum a") means little.
    holds_it = (
        role
        for role, pattern in _PATTERNS
        if any(len(found[0]) > 1 or not found[0].isascii() for found in pattern.finditer(whole))
    )
    # A letter with an index: "x_10s".
    symbol = (role for role, pattern in _PATTERNS if pattern.fullmatch(words.partition("_")[0]))
    unit = unit_of(name)
    named: Role = "time" if unit is not None and unit.kind == "time" else "unknown"
    return next(chain(is_it, holds_it, symbol), named)


_SWINGS: Final = (
    r"swings?|oscillations?|cycles?|periods|schwingung(en)?|perioden|oscilaciones|oscillazioni|ciclos"
    r"|périodes|svingninger|колебани\w*"
)
_NUMBER_OF: Final = r"(?i)\b(number|no|nr|n|num|count|anzahl|número|numero|nombre|#|число)\b|#|№"


def counts_swings(name: str) -> bool:
    """Say whether a column counts swings: ``Number of swings``, ``n (cycles)``, ``Schwingung Nr.``.

    Examples
    --------
    >>> counts_swings("Number of oscillations"), counts_swings("Swing angle (deg)")
    (True, False)
    """
    whole = plain(name)
    word = re.search(_SWINGS, whole)
    return word is not None and (word[0] == whole or re.search(_NUMBER_OF, whole) is not None)
