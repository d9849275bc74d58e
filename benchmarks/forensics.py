"""Tests of the measurement: false alarms on nulls, what faults are taken for, time.

``python -m benchmarks.forensics [NULLS] [FAULTS]``; OPENBLAS_NUM_THREADS=1. A fault counts as
found where its test says p < 1e-3, as does one that is found and not there.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from tests.diagnosis.decays import Fitted, Pendulum
from tests.diagnosis.examine import examine
from tests.diagnosis.faults import AIR, FAULTS, NOISES, null

from pendpipe.diagnosis.forensics import TESTS

_LEVELS = (0.1, 0.01, 0.001)
_FOUND = 1e-3


def p_values(record: Fitted) -> dict[str, float]:
    """The p-value of each test by itself (properties of the record are no alarms)."""
    found = {}
    for name, find in TESTS.items():
        finding = find(record.data, record.fit, record.noise, record.samples)
        found[name] = finding.p_value if finding.kind == "fault" else 1.0
    return found


def false_alarms(count: int) -> None:
    """Rates on nulls, a line a test and noise; tests that can't be made are left out."""
    clean: dict[Pendulum, np.ndarray] = {}
    print(f"false alarms in {count} nulls of each noise, at p < " + ", ".join(map(str, _LEVELS)))
    every: dict[str, list[float]] = {name: [] for name in TESTS}
    for kind in NOISES:
        records = [p_values(null(seed, kind, clean)) for seed in range(count)]
        for name in TESTS:
            each = np.array([record[name] for record in records])
            every[name] += each.tolist()
            if np.any(each < 1.0):
                rates = "  ".join(f"{np.mean(each < level):.4f}" for level in _LEVELS)
                print(f"  {kind:18s} {name:20s} {rates}   smallest {each.min():.2g}", flush=True)
    for name, values in every.items():
        rates = "  ".join(f"{np.mean(np.array(values) < level):.4f}" for level in _LEVELS)
        print(f"  {'all':18s} {name:20s} {rates}")


def confusion(count: int) -> None:
    """What each fault is taken for, when the tests run one after the other."""
    clean = AIR.model().reading(AIR.values())
    names = list(TESTS)
    print(f"\nfound at p < {_FOUND} in {count} records of each fault (its own test in brackets)")
    print(" " * 26 + " ".join(f"{name[:11]:>11s}" for name in names))
    for fault, (test, make) in FAULTS.items():
        seen = dict.fromkeys(names, 0)
        for seed in range(count):
            record = make(clean, np.random.default_rng(1000 + seed))
            findings = examine(record)
            for name, finding in zip(names, findings, strict=True):
                seen[name] += finding.p_value < _FOUND and finding.kind == "fault"
        cells = [f"[{seen[name]}]" if name == test else str(seen[name] or ".") for name in names]
        print(f"  {fault:24s}" + " ".join(f"{cell:>11s}" for cell in cells), flush=True)


def cost(repetitions: int = 20) -> None:
    """Processor time of all tests together on 4000 readings."""
    clean: dict[Pendulum, np.ndarray] = {}
    print("\nprocessor time of all tests, 4000 readings, ms")
    for kind in ("white", "16 bit, 1.3 steps", "12 bit, 0.3 steps"):
        record = null(0, kind, clean)
        examine(record)
        begin = time.process_time()
        for _ in range(repetitions):
            examine(record)
        print(f"  {kind:20s} {1e3 * (time.process_time() - begin) / repetitions:.1f}")


def main() -> None:
    """Print the tables."""
    nulls = int(sys.argv[1]) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 100
    faults = int(sys.argv[2]) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 10
    cost()
    confusion(faults)
    print()
    false_alarms(nulls)


if __name__ == "__main__":
    main()
