"""What is printed for the real recordings, and what each light states.

    python -m benchmarks.answers lights [NAME ...]
    python -m benchmarks.answers printed [NAME ...]
    python -m benchmarks.answers words

`lights`: a row a recording, fitted without options: the light, what can be quoted, period and Q of
the fit beside those of the turning points, which need no law; then the counts. `printed`: what
`fit` and `diagnose` print, ten recordings without names; `words` counts it over all of them.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator

import numpy as np

import pendpipe as pp
from benchmarks.known_physics import RECORDINGS, table
from pendpipe.quantities import with_error

TEN = (
    *("8050.txt", "lab1_data.txt", "damping_angle.xlsx", "adip_pend_data.mat", "data2_14.csv"),
    *("data32.csv", "1.3_100mA.csv", "model_test_21337.csv", "molla_durissima", "dataset4.txt"),
)
"""Those whose answers stand in docs/recordings.md."""


def lights(names: list[str]) -> Iterator[str]:
    """A row a recording, and the counts."""
    yield "| recording | light | quotable | T0, fit (turning points) | Q, fit (off) |"
    yield "|---" * 5 + "|"
    counts, beyond = Counter[str](), []
    for name in names:
        try:
            fit = pp.fit(RECORDINGS / name)
        except pp.InputError as fault:
            counts["refused"] += 1
            yield f"| {name} | refused: {str(fault).split(': ', 1)[-1]} | | | |"
            continue
        counts[fit.light] += 1
        pairs = zip(fit.quality_factors, fit.decrement_check, strict=False)
        q = [
            f"{with_error(each.quality_factor.value, each.quality_factor.sd, short=True)}"
            f" ({-100 * check.excess:+.1f} %)"
            for each, check in pairs
        ]
        period = with_error(fit.period.value, fit.period.sd, short=True)
        for whole in fit.period_check[:1]:
            period += f" ({with_error(whole.seen, whole.seen_sd, short=True)})"
        light = f"{fit.light}: {fit.light_reason}"
        yield f"| {name} | {light} | {' '.join(fit.quotable)} | {period} | {', '.join(q)} |"
        off = (
            abs(each.excess) > 0.05 and abs(each.fitted - each.seen) > 2 * each.seen_sd
            for each in fit.decrement_check
        )
        beyond += [name] * (fit.light == "green" and any(off))
    yield f"\n{dict(counts)}; green and off by more than 5 % and two errors: {beyond or 'none'}"


def printed(names: list[str], *, show: bool = True) -> Iterator[str]:
    """Both answers of each recording, and how many lines, words and percentages they have."""
    totals = []
    for name in names:
        try:
            texts = [str(command(RECORDINGS / name)) for command in (pp.fit, pp.diagnose)]
        except pp.InputError as fault:
            yield f"{name}: {str(fault).split(': ', 1)[-1]}"
            continue
        for command, text in zip(("fit", "diagnose"), texts, strict=True):
            if show:
                yield f"**{name}**, `pendpipe {command}`:\n\n```\n{text}\n```\n"
        shares = [float(each) for each in re.findall(r"(\d+) %", texts[1])]
        sizes = [len(part) for text in texts for part in (text.splitlines(), text.split())]
        totals.append([*sizes, len(shares), sum(share <= 20 for share in shares)])
    most, mean = np.max(totals, axis=0), np.mean(totals, axis=0)
    for at, command in ((0, "fit"), (2, "diagnose")):
        yield f"{command}: at most {most[at]} lines, {mean[at + 1]:.0f} words on average"
    total = np.sum(totals, axis=0)
    yield f"{total[4]} percentages printed, {total[5]} of them 20 % or less"


def main() -> None:
    """Print what is asked for."""
    what, *wanted = sys.argv[1:] or ["lights"]
    if not RECORDINGS.is_dir():
        sys.exit("not run: the recordings are not beside this clone")
    wanted = wanted or (list(TEN) if what == "printed" else [""])
    names = [row["file"] for row in table() if any(each in row["file"] for each in wanted)]
    for line in lights(names) if what == "lights" else printed(names, show=what == "printed"):
        print(line, flush=True)


if __name__ == "__main__":
    main()
