"""`make evidence`: do the campaign's errors tell the truth?

Fifty campaigns of the default configuration are recorded with noise drawn at run time, from
motions that `benchmarks.independent` has integrated, and each goes through the library's
own stages in memory. A pull is (estimate - truth)/standard deviation: over many campaigns
its mean is 0 and its standard deviation 1 where the errors are honest.
"""

from __future__ import annotations

import json
import secrets
import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.independent import Truth, motion, truths
from benchmarks.virtual_campaign import Pulls, one_campaign

ROOT = Path(__file__).parents[1]
KEPT = ROOT / ".evidence"
CAMPAIGNS = 50
CORES = 2


def motions(run_seed: int, drag_factor: float) -> list[tuple[Truth, np.ndarray, np.ndarray]]:
    """Integrate every record once; the first sample comes at a random phase."""
    random = np.random.default_rng([run_seed, 0])
    told = truths(ROOT, drag_factor)
    starts = [random.uniform(0, 2 * np.pi / truth.omega) for truth in told]
    with ProcessPoolExecutor(CORES) as pool:
        sampled = list(pool.map(motion, told, [8.0e-5] * len(told), starts))
    return [(truth, *track) for truth, track in zip(told, sampled, strict=True)]


def campaigns(run_seed: int, drag_factor: float, count: int) -> list[Pulls]:
    """Run the campaigns; what an interrupted run has finished is kept and read back."""
    KEPT.mkdir(exist_ok=True)
    journal = KEPT / f"campaigns-{drag_factor}-{run_seed}.jsonl"
    done: dict[int, Pulls] = {}
    if journal.exists():
        for line in journal.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            done[entry["seed"]] = entry["pulls"]
    tracks = motions(run_seed, drag_factor)
    missing = [seed for seed in range(1, count + 1) if seed not in done]
    with ProcessPoolExecutor(CORES) as pool, journal.open("a", encoding="utf-8") as stream:
        work = pool.map(one_campaign, [tracks] * len(missing), [[run_seed, s] for s in missing])
        for seed, pulls in zip(missing, work, strict=True):
            done[seed] = pulls
            stream.write(json.dumps({"seed": seed, "pulls": pulls}) + "\n")
            stream.flush()
            print(f"\r{len(done)}/{count} campaigns", end="", file=sys.stderr)
    print(file=sys.stderr)
    return [done[seed] for seed in sorted(done)][:count]


def table(pulls: list[Pulls]) -> list[str]:
    """A row a quantity: mean and standard deviation of its pull, and the estimates' mean."""
    gathered: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for campaign in pulls:
        for name, (value, sd, truth) in campaign.items():
            gathered[name].append((value, sd, truth))
    rows = ["| quantity | truth | mean estimate | mean sd | pull: mean | pull: sd |", "|---|---|---|---|---|---|"]
    for name, entries in gathered.items():
        value, sd, truth = np.array(entries).T
        pull = (value - truth) / sd
        rows.append(
            f"| {name} | {truth.mean():.6g} | {value.mean():.6g} | {sd.mean():.2g}"
            f" | {pull.mean():+.2f} | {pull.std(ddof=1):.2f} |"
        )
    return rows


def main() -> None:
    """Run, print and write ``docs/evidence.md``."""
    run_seed = int(sys.argv[1]) if len(sys.argv) > 1 else secrets.randbits(32)
    print("\n".join(table(campaigns(run_seed, 1.117, CAMPAIGNS))))


if __name__ == "__main__":
    main()
