"""What is printed for the real recordings, and what each light states, beside no model at all.

    python -m benchmarks.answers lights [NAME ...]
    python -m benchmarks.answers printed [NAME ...]
    python -m benchmarks.answers coverage [NUMBER]
    python -m benchmarks.answers words

`lights`: a row a recording, fitted without options: the light, what it says can be quoted, period
and Q of the fit beside those of the turning points, which need no law, and by what the errors were
widened; then the counts. `printed`: what `fit` and `diagnose` print, and the lines, words and
probabilities of it, counted; `words` only counts, over all recordings. `coverage`: how often 95 %
intervals hold the true T0 and Q of simulated decays with a fault of the sensor or of the motion, as
they are printed and without the widening.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fit_honesty import FREE_DECAYS, RECORDINGS

TEN = (
    "jiarui-phy180/8050.txt",
    "tylertian-phy180/lab1_data.txt",
    "davidw99-wood-steel-bob/damping_angle.xlsx",
    "profcarter-adip/adip_pend_data.mat",
    "yfysiks-encoder/data2_14.csv",
    "yfysiks-encoder/data32.csv",
    "martin8ner-pohl-eddy/1.3_100mA.csv",
    "kvlcc2-roll-decay/model_test_21337.csv",
    "filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv",
    "kenevich-furuta-arm2/dataset4.txt",
)
"""Those whose answers stand in docs/recordings.md."""
ROW = "| {} | {} | {} | {} | {} | {} |"


def chosen(names: list[str], of: tuple[str, ...]) -> list[str]:
    """Return the recordings whose path holds one of the names; all of them without names."""
    return [name for name in of if not names or any(each in name for each in names)]


def lights(names: list[str]) -> Iterator[str]:
    """Yield a row a recording, and the counts."""
    import pendpipe as pp
    from pendpipe.quantities import with_error

    yield ROW.format(
        "recording",
        "light",
        "quotable",
        "T0, fit (turning points)",
        "Q, fit (turning points)",
        "errors × (T0, losses)",
    )
    yield "|---|---|---|---|---|---|"
    counts, beyond = Counter[str](), []
    for name in chosen(names, FREE_DECAYS):
        try:
            fit = pp.fit(RECORDINGS / name)
        except pp.InputError as problem:
            counts["refused"] += 1
            yield ROW.format(name, "refused", "", str(problem).split(": ", 1)[-1], "", "")
            continue
        counts[fit.light] += 1
        whole = fit.period_check[0] if fit.period_check else None
        seen = "" if whole is None else f" ({with_error(whole.seen, whole.seen_sd, short=True)})"
        law = [each.quality_factor for each in fit.quality_factors]
        without = [100.0 * check.excess for check in fit.decrement_check]
        q = ", ".join(
            f"{with_error(each.value, each.sd, short=True)} ({-off:+.1f} %)"
            for each, off in zip(law, without, strict=False)
        )
        wide = "{:.3g}, {:.3g}".format(*fit.widening)
        period = with_error(fit.period.value, fit.period.sd, short=True)
        yield ROW.format(
            name, f"{fit.light}: {fit.light_reason}", " ".join(fit.quotable), period + seen, q, wide
        )
        if fit.light == "green":
            beyond += [
                name
                for check in fit.decrement_check
                if abs(check.excess) > 0.05 and abs(check.fitted - check.seen) > 2 * check.seen_sd
            ]
    yield ""
    yield f"{dict(counts)}; green and off by more than 5 % and two errors: {beyond or 'none'}"


def printed(names: list[str], *, counts: bool = False) -> Iterator[str]:
    """Yield both answers of each recording, or only their counts; then those of all."""
    import pendpipe as pp

    totals: list[tuple[int, ...]] = []
    for name in chosen(names, TEN if not (names or counts) else FREE_DECAYS):
        try:
            answers: list[Any] = [pp.fit(RECORDINGS / name), pp.diagnose(RECORDINGS / name)]
        except pp.InputError as problem:
            yield f"{name}: {str(problem).split(': ', 1)[-1]}"
            continue
        texts = [str(answer).replace(f"{Path(name).name}: ", "", 1) for answer in answers]
        shares = [float(each) for each in re.findall(r"(\d+) %", texts[1])]
        low = sum(share <= 20 for share in shares)
        lines, words = ([f(text) for text in texts] for f in (_lines, _words))
        totals.append((*lines, *words, len(shares), low))
        if counts:
            yield f"{name}: lines {lines}, words {words}, percentages {len(shares)} ({low} low)"
            continue
        for command, text in zip(("fit", "diagnose"), texts, strict=True):
            yield f"**{Path(name).name}**, `pendpipe {command}`:\n\n```\n{text}\n```\n"
    if totals:
        by_column = [list(each) for each in zip(*totals, strict=True)]
        for place, command in enumerate(("fit", "diagnose")):
            lines, words = by_column[place], by_column[place + 2]
            yield (
                f"Of `{command}`, {len(totals)} recordings: {max(lines)} lines at most,"
                f" {sum(words) / len(words):.0f} words on average ({min(words)} to {max(words)})."
            )
        yield f"{sum(by_column[4])} percentages printed, {sum(by_column[5])} of them 20 % or less."


def _lines(text: str) -> int:
    return len(text.splitlines())


def _words(text: str) -> int:
    return len(text.split())


FAULTS: dict[str, Any] = {
    "none": lambda t, x, rng: x,
    "sensor: x + x²/20": lambda t, x, rng: x + 0.05 * x**2,
    "sensor: x − x³/10": lambda t, x, rng: x - 0.1 * x**3,
    "drifting zero": lambda t, x, rng: x + 0.02 * np.sin(0.02 * t + rng.uniform(0.0, 6.0)),
    "second mode, 3 %": lambda t, x, rng: x + 0.03 * x[0] * np.exp(-t / 60.0) * np.cos(8.7 * t),
    "red noise": lambda t, x, rng: x + 1e-4 * np.cumsum(rng.normal(size=t.size)),
    "hum": lambda t, x, rng: x + 2e-3 * np.sin(math.tau * 0.31 * t),
}
"""What is done to the readings of a pendulum, times in s and angles in rad."""


def coverage(names: list[str]) -> Iterator[str]:
    """Yield a row a fault: how many intervals hold the truth, of how many; and the lights."""
    import pendpipe as pp
    from pendpipe.analysis.fit.decrement import loss_of
    from pendpipe.analysis.torque import swing_phase
    from pendpipe.dynamics import Eq8, Release, sample

    number = int(names[0]) if names else 20
    yield ROW.format("fault", "lights", "T0", "without widening", "Q", "without widening")
    yield "|---|---|---|---|---|---|"
    for place, (fault, act) in enumerate(FAULTS.items()):
        held, seen, lights = np.zeros(4), np.zeros(4), Counter[str]()
        for seed in range(number):
            rng = np.random.default_rng(1000 * place + seed)
            omega, quality = rng.uniform(3.0, 9.0), 10.0 ** rng.uniform(1.7, 2.5)
            share, b = rng.dirichlet(np.ones(3)), 0.5 * omega / quality
            y0 = rng.uniform(0.1, 0.5)
            law = Eq8(omega, share[0] * b / y0, 0.0, share[1] * b, share[2] * b * y0 / 3.0, "sine")
            time_s = np.arange(0.0, min(80.0, 1.6 / b), 0.02)
            angle = sample(law, Release(-0.1, y0), time_s)
            angle = act(time_s, angle, rng) + 5e-4 * rng.normal(size=time_s.size)
            try:
                fit = pp.fit(pp.Recording(time_s=time_s, angle_rad=angle))
            except pp.InputError:
                lights["refused"] += 1
                continue
            lights[fit.light] += 1
            if fit.light == "red":
                continue
            wide, off = fit.widening, abs(fit.period.value - math.tau / omega) / fit.period.sd
            pulls = [(off, off * wide.period, 0)]
            for each in fit.quality_factors:
                y = each.amplitude_rad
                half = float(swing_phase(np.array([y, y]), "sine")[0]) / omega
                q = each.quality_factor
                off = abs(q.value - math.pi / (2.0 * half * loss_of(law, y))) / q.sd
                pulls.append((off, off * wide.losses, 2))
            for printed_pull, bare, column in pulls:
                held[column : column + 2] += [printed_pull < 1.96, bare < 1.96]
                seen[column : column + 2] += 1
        yield ROW.format(
            fault,
            ", ".join(f"{count} {light}" for light, count in lights.items()),
            *(f"{in_it:.0f} of {of:.0f}" for in_it, of in zip(held, seen, strict=True)),
        )


def main() -> None:
    """Print what is asked for."""
    what, *names = [each for each in sys.argv[1:] if each != "answers"] or ["lights"]
    if not RECORDINGS.is_dir():
        print("not run: the recordings are not beside this clone")
        return
    asked: dict[str, Callable[[list[str]], Iterator[str]]] = {
        "lights": lights,
        "printed": printed,
        "words": partial(printed, counts=True),
        "coverage": coverage,
    }
    for line in asked[what](names):
        print(line, flush=True)


if __name__ == "__main__":
    main()
