"""Whether `pendpipe fit` prints laws that lose what the decays lose, on the real recordings.

    python -m benchmarks.fit_honesty [NAME ...]

A row a recording, fitted without options: the loss of the fitted law over that of the turning
points at a large, a middle and a small amplitude, the light, the exit status, and by how many of
their errors a, b, c and f differ at most from those of the same model in `pendpipe diagnose`: Eq. 8
alone, or with sin x alone where that is all that is missing. With names, only the recordings whose
path holds one of them.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from pendpipe.cli import main as pendpipe

RECORDINGS = Path(__file__).resolve().parents[2] / "shared/recordings"
FREE_DECAYS = (
    "bychai-phy180/10cm.txt",
    "bychai-phy180/60deg_long (48).txt",
    "davidw99-wood-steel-bob/damping_angle.xlsx",
    "deepfe-beam/VDeXpiLab1_Exp.mat",
    "dynamicslab-single/SingleDataFreeSwing_1_Dt_0_0001.mat",
    "filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv",
    "ganesh999-phone-gyro/Gyroscope.csv",
    "hasi7-string/QFactorGraph10(43cm).txt",
    "jensen-freeswing/pendulum_free_swing_data_03.txt",
    "jiarui-phy180/8050.txt",
    "jiarui-phy180/8053.txt",
    "jiarui-phy180/8055.txt",
    "jiarui-phy180/AAAtAmp3.txt",
    "jlefebvre-phy180/q2_data.csv",
    "kenevich-furuta-arm2/dataset1_no_clip.txt",
    "kenevich-furuta-arm2/dataset2_clip.txt",
    "kenevich-furuta-arm2/dataset3.txt",
    "kenevich-furuta-arm2/dataset4.txt",
    "knly-coupled/3.1.txt",
    "kosta24-torsion/0.96734.1.csv",
    "kvlcc2-roll-decay/model_test_21337.csv",
    "lipson-schmidt-2009/real_linear_h_1.txt",
    "lipson-schmidt-2009/real_pend_h_1.txt",
    "martin8ner-pohl-eddy/1.3_100mA.csv",
    "martin8ner-pohl-eddy/1.3_200mA.csv",
    "martinrobomaze-eulers-rod/d_4mm_l_100mm_50deg.txt",
    "nielsskov-cartpend/test1pend1.csv",
    "nielsskov-cartpend/test1pend2.csv",
    "phyprakit-cassy/Cassy.txt",
    "profcarter-adip/adip_pend_data.mat",
    "profcarter-adip/cdip_pend_data.mat",
    "ptibbets-labprob2/idf_wah.mat",
    "tjcork-imu/data-acc3.csv",
    "tychoaussie-seismometer/SM3_SN001_freeperiod.csv",
    "tylertian-phy180/lab1_data.txt",
    "tylertian-phy180/trial1_rawdata.txt",
    "vicber507-water/Agua1.csv",
    "vicber507-water/Aire1.csv",
    "yfysiks-encoder/data2_12.csv",
    "yfysiks-encoder/data2_14.csv",
    "yfysiks-encoder/data2_20.csv",
    "yfysiks-encoder/data2_22.csv",
    "yfysiks-encoder/data32.csv",
    "yfysiks-encoder/data33.csv",
    "yyzcr-tracker/pendulum_data_from_tracker_copy.txt",
)
"""Of ../shared/recordings, bad ones among them: those must be refused in one line."""
WORST = 0.10
"""Part of the decrement by which no green law may be off."""


NUMBERS: Final = ("a", "b", "c", "frequency")


def fitted(path: Path) -> tuple[int, dict[str, Any] | None, str]:
    """Run the command; return its status, ``fit.json`` if there is one, and why it was refused."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "fit.json"
        words, said = io.StringIO(), io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(words):
            status = pendpipe(["fit", str(path), "--out", str(out)])
        content = json.loads(out.read_text()) if out.exists() else None
    refusals = [line for line in said.getvalue().splitlines() if line.startswith("pendpipe:")]
    return status, content, refusals[-1].replace(str(path), "it") if refusals else ""


def apart(path: Path, content: dict[str, Any]) -> str:
    """The largest difference between fit and diagnose, in errors; blank without a common model."""
    words = io.StringIO()
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(words):
        pendpipe(["diagnose", str(path), "--json"])
    answer = json.loads(words.getvalue() or "{}")
    model = answer.get("baseline")
    if content["light"] == "red" or not model:
        return ""
    pairs = [(content["parameters"][name], model["parameters"][name]) for name in NUMBERS]
    return f"{max(abs(one['value'] - two['value']) / (one['sd'] or 1.0) for one, two in pairs):.2g}"


def main() -> None:
    """Print the table."""
    wanted = [each for each in sys.argv[1:] if each != "fit_honesty"]
    names = [name for name in FREE_DECAYS if not wanted or any(each in name for each in wanted)]
    if not RECORDINGS.is_dir():
        print("not run: the recordings are not beside this clone")
        return
    print(
        "| recording | torque | method | fitted over seen, large to small | light | status |"
        " beside diagnose, errors | s |"
    )
    print("|---|---|---|---|---|---|---|---|")
    off = []
    for name in names:
        begun = time.process_time()
        status, content, reason = fitted(RECORDINGS / name)
        spent = time.process_time() - begun
        if content is None:
            print(f"| {name} | | | {reason} | | {status} | | {spent:.1f} |", flush=True)
            continue
        checks = content["decrement_check"]
        ratios = ", ".join(
            f"{each['fitted'] / each['seen']:.3g} (sd {each['seen_sd'] / abs(each['seen']):.2g})"
            for each in checks
        )
        print(
            f"| {name} | {content['restoring']} | {content['method']} | {ratios} |"
            f" {content['light']} | {status} | {apart(RECORDINGS / name, content)} | {spent:.1f} |",
            flush=True,
        )
        if content["light"] == "green":
            off += [name for check in checks if abs(check["fitted"] / check["seen"] - 1) > WORST]
    print(f"\ngreen and off by more than {WORST:.0%}: {', '.join(off) if off else 'none'}")


if __name__ == "__main__":
    main()
