"""Every command that answers prints one JSON object where it is asked to."""

import json
from pathlib import Path

import pytest

from pendpipe import cli, manifest

ROD = str(Path(__file__).parents[2] / "examples/rod-pendulum.csv")


@pytest.mark.parametrize(
    ("command", "key"),
    [
        (["inspect", ROD], "sample_rate_hz"),
        (["fit", ROD], "decrement_check"),
        (["diagnose", ROD], "verdict"),
        (["effects"], "effects"),
        (["doctor", "{folder}"], "findings"),
        (["calibrate", "{table}"], "volts_per_radian"),
    ],
)
def test_a_commands_answer_is_one_json_object(
    command: list[str], key: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "caliper.csv"
    rows = [f"{0.01 * step},{0.0385 * step + 0.001 * (step % 2)}" for step in range(-5, 6)]
    table.write_text("angle_rad,volts\n" + "\n".join(rows) + "\n", encoding="utf-8")
    results = tmp_path / "results"
    results.mkdir()
    with manifest.job(results, "separate") as written:
        (results / "separation.json").write_text("{}", encoding="utf-8")
        written.append(results / "separation.json")
    words = [word.format(folder=results, table=table) for word in command]
    assert cli.main([*words, "--json"]) == 0
    assert key in json.loads(capsys.readouterr().out)
