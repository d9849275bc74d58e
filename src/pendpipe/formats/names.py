"""What a column's name says it holds, in the languages that laboratories write in."""

from __future__ import annotations

import re
from typing import Final, Literal

from pendpipe.formats.units import plain, unit_of

Role = Literal["time", "index", "angle", "volts", "length", "angular velocity", "other", "unknown"]

# Tried in this order: "angular velocity" is no angle, "time derivative" no time.
_WORDS: Final[tuple[tuple[Role, str], ...]] = (
    (
        "other",
        r"acc(el\w*)?|a|\w*acceleration|\w*beschleunigung|force|kraft|torque|moment|current"
        r"|strom|temp(erature)?|temperatur|freq(uency)?|frequenz|fft|spectrum|energy|energie"
        r"|err(or)?|xerr|yerr|std(dev)?|sigma|uncert\w*|fit(ted)?|model|sim(ulated)?|set"
        r"|setpoint|target|ref(erence)?|command|cmd|control|input|pwm|power|pressure|mass|period"
        r"|quality|flag|status|residuals?|weight|battery|duty|event|events|vy|vx|vz|ax|ay|az|i",
    ),
    (
        "angular velocity",
        r"angular (velocity|speed|rate)|winkelgeschw\w*|gyro\w*|omega|ω|\w*theta_?dot|th_?dot"
        r"|\w*phi_?dot|\w*alpha_?dot|d\s?theta|dphi|dth|vitesse angulaire|velocidad angular"
        r"|velocit[aà] angolare|hoeksnelheid|w|rotation rate",
    ),
    (
        "other",
        r"\w*velocity|vel|v|speed|\w*geschw\w*|vitesse|velocidad|velocit[aà]|snelheid|\w*dot"
        r"|derivative|\w*ableitung|deriv\w*|d\w+/dt|dx|dy|скорость|速度",
    ),
    (
        "time",
        r"t|time|times|zeit|messzeit|temps|tiempo|tempo|tijd|czas|время|时间|時間|시간|aika|tid"
        r"|timestamps?|time_?stamps?|elapsed|seconds?|secs?|sekunden|millis|micros|milliseconds"
        r"|microseconds|ms|us|µs|uptime|clock|uhrzeit|datetime|relative time|time_s",
    ),
    (
        "index",
        r"frames?|bild|index|idx|samples?|n|no|nr|num|number|#|row|point|counter|trial|run|scan",
    ),
    (
        "angle",
        r"\w*theta\w*|teta|th\d?|\w*[θϑφϕψαβγ]\w*|\w*phi\d?|fi|psi|alpha\d?|beta\d?|gamma\d?"
        r"|\w*angle\w*|ang|angular (position|displacement)|angpos|\w*winkel|\w*angulo|\w*ángulo"
        r"|angolo|hoek|kąt|kat|угол|角度?|각도|auslenkung|ausschlag|roll|pitch|yaw|tilt"
        r"|inclin\w*|neigung|deflection|deflexion|swing|pendulum\w*|pend\w*|encoder\w*|enc\d?"
        r"|rotation|rot|azimuth|heading|deg(rees)?|rad(ians)?|grad|q\d?|o|kulma|vinkel|açı",
    ),
    (
        "volts",
        r"volts?|\w*voltage|spannung|tension|voltaje|tensione|tensión|напряжение|电压|電圧|u"
        r"|ch\s?\d*|chn\s?\d*|channel\s?\d*|kanal\s?\d*|ain\d*|ai\d*|adc\d*|a\d|analog\w*"
        r"|potential|sensor\w*|signal|output|out|poti\w*",
    ),
    (
        "length",
        r"\w*position\w*|pos\w*|x\d?|y\d?|z\d?|\w*displacement\w*|\w*distance|dist|abstand|weg|ort"
        r"|strecke|[ée]longation|elongación|spostamento|posizione|posición|lage|height|höhe"
        r"|hoogte|uitwijking|verplaatsing|ultrasonic|range|level|déplacement|r|length|s",
    ),
)
_PATTERNS: Final = tuple(
    (role, re.compile(rf"(?<![^\W_])(?:{words})(?![^\W_])")) for role, words in _WORDS
)


def role_of(name: str) -> Role:
    """Say what a column's name (without its unit) promises.

    Examples
    --------
    >>> role_of("Zeit t"), role_of("Pendulum angle"), role_of("Angular Velocity")
    ('time', 'angle', 'angular velocity')
    """
    words = plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.strip()))
    whole = re.sub(r"[\s_\-.]+", " ", words).strip()
    for role, pattern in _PATTERNS:
        if pattern.fullmatch(whole) or pattern.fullmatch(words):
            return role
    for role, pattern in _PATTERNS:
        found = pattern.search(whole)
        # One letter inside a longer name ("pendulum a") says little.
        while found is not None and len(found[0]) == 1 and found[0].isascii():
            found = pattern.search(whole, found.end())
        if found is not None:
            return role
    unit = unit_of(name)
    return "time" if unit is not None and unit.kind == "time" else "unknown"
