"""Real recordings through the whole tool: the table of ``docs/recordings.md``.

    snakemake --cores 2 --configfile benchmarks/shared_recordings.yaml
    python -m benchmarks.recordings

The known times are those of the recordings' own README (``../shared/recordings``).
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

from benchmarks.recordings_diagnosis import diagnose_viscous, section
from pendpipe.files import read_json

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results/shared-recordings"
KNOWN = {
    "adip": "free after t = 2 s (rest and hand pull before)",
    "dataset4": "free from t = 12.8 s (rest and hand lift before), to rest",
    "21337": "lies still before the release",
    "data32": "released by hand, to complete rest",
    "data2_12": "a gap of 13 s in the time column",
    "1.3_100mA": "Coulomb floor and a linear brake",
    "AAAtAmp3": "string pendulum, video",
    "lab1_data": "71 cycles, video",
    "test1pend1": "from 2.6 rad to a dead stop",
    "dataset1_no_clip": "repositioning: to be refused or cut",
    "dataset2_clip": "a clamp: to be refused or cut",
    "dataset3": "gaps of 0.9 and 1.6 s: to be refused or cut",
    "SingleDataFreeSwing": "the last 7 cycles and 17 s of rest",
    "free_swing_03": "8 cycles",
}
SHOWN = ("adip", "AAAtAmp3", "data32", "dataset4")

HEAD = """# Real recordings

Recordings of other laboratories, each through the whole tool with its path alone: no start or
stop time, no layout and no unit are given. Made by

```sh
snakemake --cores 2 --configfile benchmarks/shared_recordings.yaml
python -m benchmarks.recordings
```

*Misfit* is the rms of turning-point amplitudes about the fitted law: Eq. 14 (a, b and c),
and beside it linear damping alone (b), the textbook's exponential, on the same points with
the same weights. A large chi^2 is expected: the recordings contain physics that Eq. 8 lacks
(sin x, stiction, second modes). The diagnosis finds and names it.
"""


def cell(number: float | None, factor: float = 1e3) -> str:
    """A number in milliradians (or millimetres), three digits."""
    return "" if number is None else f"{factor * number:.3g}"


def cuts(record: dict[str, Any]) -> str:
    """What was cut, in a cell."""
    return "; ".join(
        f"{cut['start_s']:.2f} to {cut['stop_s']:.2f} s {cut['reason']}" for cut in record["cuts"]
    )


def rows(records: list[dict[str, Any]]) -> list[str]:
    """The table's rows."""
    lines = [
        "| record | half cycles | amplitude at first (mrad) | misfit, Eq. 14 (mrad)"
        " | misfit, linear damping (mrad) | ratio | kept (s) | cut | known |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for record in records:
        known = KNOWN.get(record["record"], "")
        if record["refused"]:
            lines.append(f"| {record['record']} | refused: {record['refused']} ||||||| {known} |")
            continue
        misfit = record["misfit"]
        both = misfit["amplitude_rms_rad"], misfit["linear_damping_rms_rad"]
        lines.append(
            f"| {record['record']} | {misfit['half_cycles']} |"
            f" {cell(record['amplitude']['value'])} | {cell(both[0])} | {cell(both[1])} |"
            f" {both[1] / both[0]:.2g} | {record['start_s']:.2f} to {record['stop_s']:.2f} |"
            f" {cuts(record)} | {known} |"
        )
    return lines


def main() -> None:
    """Print the table and write the page with four figures."""
    records = read_json(RESULTS / "comparison.json")["records"]
    commit = subprocess.run(
        ["git", "-C", str(ROOT), "describe", "--always", "--dirty"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    lines = [*HEAD.splitlines(), "", f"Answered by commit {commit}.", "", *rows(records), ""]
    images = ROOT / "docs/images"
    images.mkdir(exist_ok=True)
    for name in SHOWN:
        drawn = RESULTS / name / "figures/decay.svg"
        if drawn.exists():
            shutil.copyfile(drawn, images / f"recording-{name}.svg")
            lines += [f"![Decay of {name}](images/recording-{name}.svg)", ""]
    diagnose_viscous(ROOT, RESULTS)
    lines += section(RESULTS, [record["record"] for record in records], images)
    text = "\n".join(lines)
    print(text)
    (ROOT / "docs/recordings.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
