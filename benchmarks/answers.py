"""What is printed for the real recordings, and what each light states, beside no model at all.

    python -m benchmarks.answers lights [NAME ...]
    python -m benchmarks.answers printed [NAME ...]

`lights`: a row a recording, fitted without options: the light, what it says can be quoted, period
and Q of the fit beside those of the turning points, which need no law, and by what the errors were
widened; then the counts. `printed`: what `fit` and `diagnose` print, and the lines, words and
probabilities of it, counted.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


def printed(names: list[str]) -> Iterator[str]:
    """Yield both answers of each recording, and their counts."""
    import pendpipe as pp

    totals: list[tuple[int, int, int, int]] = []
    for name in chosen(names, TEN if not names else FREE_DECAYS):
        try:
            answers: list[Any] = [pp.fit(RECORDINGS / name), pp.diagnose(RECORDINGS / name)]
        except pp.InputError as problem:
            yield f"{name}: {str(problem).split(': ', 1)[-1]}"
            continue
        texts = [str(answer).replace(f"{Path(name).name}: ", "", 1) for answer in answers]
        for command, text in zip(("fit", "diagnose"), texts, strict=True):
            yield f"**{Path(name).name}**, `pendpipe {command}`:\n\n```\n{text}\n```\n"
        shares = [float(each) for each in re.findall(r"(\d+) %", texts[1])]
        low = sum(share <= 20 for share in shares)
        totals.append((len(texts[1].splitlines()), len(texts[1].split()), len(shares), low))
    if totals:
        lines, words, shares, low = (list(each) for each in zip(*totals, strict=True))
        yield (
            f"Of `diagnose`, {len(totals)} recordings: {max(lines)} lines at most,"
            f" {sum(words) / len(words):.0f} words on average ({min(words)} to {max(words)}),"
            f" {sum(shares)} percentages printed, {sum(low)} of them 20 % or less."
        )


def main() -> None:
    """Print what is asked for."""
    what, *names = [each for each in sys.argv[1:] if each != "answers"] or ["lights"]
    if not RECORDINGS.is_dir():
        print("not run: the recordings are not beside this clone")
        return
    for line in {"lights": lights, "printed": printed}[what](names):
        print(line, flush=True)


if __name__ == "__main__":
    main()
