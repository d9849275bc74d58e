"""Pages of every kind, and the system's Chromium with the network cut."""

import copy
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from benchmarks.open import browser, installed

from pendpipe.cli import main
from pendpipe.report.page import OWN_PAGES, render

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """The browser as it is installed; tests are skipped where there is none."""
    pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if installed() is None:
        pytest.skip("no Chromium is installed")
    with browser() as running:
        yield running


def repeated(results: Path, home: Path, count: int) -> tuple[Path, list[str]]:
    """Make a campaign of so many records of another; return its page and the own pages."""
    comparison = json.loads((results / "comparison.json").read_text())
    entries, own = comparison["records"], list[str]()
    comparison["records"] = []
    for index in range(count):
        again, which = divmod(index, len(entries))
        like = entries[which]
        name = f"{like['record']}-{again}" if again else like["record"]
        comparison["records"].append({**like, "record": name})
        if (results / like["record"]).is_dir():
            shutil.copytree(results / like["record"], home / name)

    def own_page(record: str, page: str) -> None:
        (home / OWN_PAGES / f"{record}.html").write_text(page)
        own.append(record)

    (home / OWN_PAGES).mkdir(parents=True, exist_ok=True)
    settings = yaml.safe_load((ROOT / "config/config.yaml").read_text())
    numbers = json.loads((results / "campaign.json").read_text())
    page = home / "report.html"
    figures = results / "figures"
    made = render(settings, comparison, numbers, home, figures, home=page, own_page=own_page)
    page.write_text(made)
    return page, own


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory, make_example: Callable[..., Any]) -> Path:
    """The results of a campaign: three records with waveform, one of them amiss, one refused."""
    from pendpipe.figures.campaign import draw_fig04, draw_fig09
    from pendpipe.figures.data import read_decay
    from pendpipe.figures.decays import draw_decay
    from pendpipe.figures.style import save
    from pendpipe.files import write_json

    made = make_example(tmp_path_factory.mktemp("browser"))
    content, folder = copy.deepcopy(made.content), made.folder
    for name, draw in (("fig04", draw_fig04), ("fig09", draw_fig09)):
        save(draw(content), folder / "figures" / name)
    typical = folder / content["typical_record"] / "recording.csv"
    for entry in content["records"][:2]:
        shutil.copy(typical, folder / entry["record"])
        decay = read_decay(folder, entry)
        save(draw_decay(decay), folder / entry["record"] / "figures" / "decay", dpi=80)
    (_, amiss, refused) = (entry["record"] for entry in content["records"][:3])
    known = ("record", "source", "fluid", "branch", "geometry", "temperature_c")
    entry = content["records"][2]
    content["records"][2] = {key: entry[key] for key in known} | {"refused": "there is no decay"}
    shutil.rmtree(folder / refused)
    write_json(folder / amiss / "diagnosis" / "diagnosis.json", DIAGNOSIS)
    shutil.copy(folder / amiss / "figures/decay.svg", folder / amiss / "diagnosis/residual_map.svg")
    (folder / "comparison.json").write_text(json.dumps(content))
    return Path(folder)


@pytest.fixture(scope="session")
def pages(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of each kind; the documents only where `make docs` has built them."""
    folder = tmp_path_factory.mktemp("pages")
    few, _ = repeated(campaign, folder / "3", 3)
    report, _ = repeated(campaign, folder / "27", 27)
    many, own = repeated(campaign, folder / "many", 110)
    recording = campaign / "water-low-7" / "recording.csv"
    files = [str(shutil.copy(recording, folder / name)) for name in ("one.csv", "two.csv")]
    assert main(["page", "--no-diagnosis", files[0], "--out", str(folder / "one.html")]) == 0
    assert main(["page", "--no-diagnosis", *files, "--out", str(folder / "class.html")]) == 0
    return {
        "few records": few,
        "campaign": report,
        "many records": many,
        "record": many.parent / OWN_PAGES / f"{own[0]}.html",
        "recording": folder / "one.html",
        "class": folder / "class.html",
        "documents": ROOT / "docs/_build/html/index.html",
    }


def _estimate(value: float, sd: float, unit: str) -> dict[str, Any]:
    return {"value": value, "sd": sd, "unit": unit, "at_bound": False}


_MODEL = {
    "parameters": {"amplitude": _estimate(0.25, 1e-4, "rad")},
    "residual_rms_rad": 2.4e-3,
    "chi2_per_dof": 569.0,
}
DIAGNOSIS = {
    "verdict": "missing-physics",
    "p_value": 1e-9,
    "noise_rms_rad": 1e-4,
    "baseline": _MODEL,
    "improved": {**_MODEL, "residual_rms_rad": 1e-4, "chi2_per_dof": 1.01},
    "effects": [
        {
            "id": "second-mode",
            "name": "second mode",
            "equation": r"x = x_1 + A e^{-t/\tau} \cos \omega_2 t",
            "probability": 0.9,
            "indistinguishable_from": [],
        }
    ],
    "statement": "missing: second mode",
    "summary": {
        "headline": "missing: second mode",
        "missing": ["second mode"],
        "matters": "the fit misses the readings by 2.4 mrad",
        "consequence": [
            {
                "quantity": "b",
                "amplitude_rad": None,
                "fitted": _estimate(0.0123, 1e-4, "1/s"),
                "with_missing": _estimate(0.0117, 1e-4, "1/s"),
            }
        ],
        "where": "between 0 and 9 s",
        "certainty": "cycles left out are predicted better",
        "candidates": "",
        "excluded": ["drifting gain"],
        "decide_by": "a second sensor",
        "quote": "Q",
        "sentence": "A second mode was found.",
    },
}
