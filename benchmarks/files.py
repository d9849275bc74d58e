"""Every file of the shared recordings and inputs: read right, refused rightly, or wrong.

    python -m benchmarks.files

What each holds was taken by hand from the recordings' own README and from the files. A file is
read right when column, unit, largest swing, rate and duration agree with it; a unit that a file
does not give away may be any, provided that the first line of the answer calls it a guess.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pendpipe.errors import InputError
from pendpipe.formats import inspect, read

SHARED = Path(__file__).resolve().parents[2] / "shared/recordings"


class Holds(NamedTuple):
    """What a file holds: `swing` is the largest distance from the median, in `unit`.

    0 where nobody has written it down (and, as a rate, where the samples are uneven).
    """

    column: str
    unit: str
    swing: float
    rate_hz: float
    duration_s: float
    level: float | None = None


class Refused(NamedTuple):
    """Why a file can't be read, and the option or step that helps; whether it is a recording."""

    reason: str
    remedy: str
    recording: bool = False


KNOWN: dict[str, Holds | Refused] = {
    "bychai-phy180/10cm.txt": Holds("column 2", "rad", 0.36, 30.02, 66.6),
    "bychai-phy180/60deg_long (48).txt": Holds("y", "rad", 0.83, 30.0, 119.0),
    "davidw99-wood-steel-bob/damping_angle.xlsx": Holds("column 2", "rad", 0.96, 30.0, 30.5),
    "deepfe-beam/VDeXpiLab1_Exp.mat": Holds("Fe.Out.Acc(*)", "any", 0.0, 2048.0, 20.0),
    "dynamicslab-single/SingleDataFreeSwing_1_Dt_0_0001.mat": Holds(
        "Theta1", "rad", 0.066, 10000.0, 23.2, 0.0
    ),
    "filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv": Holds(
        "position", "m", 0.071, 100.0, 118.9, 0.417
    ),
    "ganesh999-phone-gyro/Gyroscope.csv": Holds("Gyroscope x", "rad/s", 0.0, 100.0, 180.0, 0.0),
    "hasi7-string/QFactorGraph10(43cm).txt": Holds("y", "rad", 0.312, 30.0, 152.3),
    "jensen-freeswing/pendulum_free_swing_data_03.txt": Holds("column 1", "rad", 1.08, 1000.0, 5.0),
    "jiarui-phy180/8050.txt": Holds("x, y", "rad", 0.30, 30.0, 137.4),
    "jiarui-phy180/8053.txt": Holds("x, y", "rad", 0.32, 30.0, 139.3),
    "jiarui-phy180/8055.txt": Holds("x, y", "rad", 0.29, 30.0, 140.8),
    "jiarui-phy180/AAAtAmp3.txt": Holds("column 2, column 3", "rad", 0.58, 30.0, 331.6),
    "jiarui-phy180/PeriodVsAngleData.txt": Refused("no time column", "--sample-rate"),
    "jlefebvre-phy180/q2_data.csv": Holds("Y", "rad", 1.38, 12.0, 375.2),
    "kenevich-furuta-arm2/dataset1_no_clip.txt": Holds("column 2", "rad", 1.53, 49.9, 33.0),
    "kenevich-furuta-arm2/dataset2_clip.txt": Holds("column 2", "rad", 1.6, 49.9, 32.7),
    "kenevich-furuta-arm2/dataset3.txt": Holds("column 2", "rad", 1.7, 49.9, 22.4),
    "kenevich-furuta-arm2/dataset4.txt": Holds("column 2", "rad", 1.88, 99.8, 36.1, 0.0),
    "knly-coupled/3.1.txt": Holds("column 2", "rad", 0.049, 40.0, 106.0),
    "kosta24-torsion/0.96734.1.csv": Holds("Pendolo", "any", 0.0, 50.0, 300.7),
    "kvlcc2-roll-decay/model_test_21337.csv": Holds("phi", "rad", 0.167, 100.0, 91.6, 0.0),
    "kvlcc2-roll-decay/model_test_parameters.csv": Refused("no time column", "--sample-rate"),
    "kvlcc2-roll-decay/model_test_units.csv": Refused("no reader knows", "CSV with a time"),
    "lipson-schmidt-2009/real_linear_a_1.txt": Holds("x", "any", 103.0, 30.0, 29.0),
    "lipson-schmidt-2009/real_linear_h_1.txt": Holds("x", "any", 103.0, 30.0, 29.0),
    "lipson-schmidt-2009/real_pend_a_1.txt": Holds("o", "rad", 1.46, 6.0, 94.5),
    "lipson-schmidt-2009/real_pend_circle_1.txt": Refused(
        "only counts", "--sample-rate", recording=True
    ),
    "lipson-schmidt-2009/real_pend_h_1.txt": Holds("o", "rad", 1.46, 6.0, 94.5),
    "martin8ner-pohl-eddy/1.3_100mA.csv": Holds("Weg &b_A1", "rad", 2.46, 10.0, 158.9, 0.0),
    "martin8ner-pohl-eddy/1.3_200mA.csv": Holds("Weg &b_A1", "rad", 0.0, 10.0, 70.8, 0.0),
    "martinrobomaze-eulers-rod/d_4mm_l_100mm_50deg.txt": Holds("x", "any", 400.0, 239.8, 44.0),
    "nielsskov-cartpend/test1pend1.csv": Holds("column 2", "rad", 3.13, 149.9, 69.7, 0.0),
    "nielsskov-cartpend/test1pend2.csv": Holds("column 2", "rad", 3.13, 149.9, 42.9, 0.0),
    # Its motor runs: that is for the analysis to refuse.
    "phyprakit-cassy/Cassy.txt": Holds("winkel w", "rad", 2.0, 10.0, 660.8),
    "profcarter-adip/adip_pend_data.mat": Holds("theta2", "rad", 1.23, 1000.0, 119.9, 0.0),
    "profcarter-adip/cdip_pend_data.mat": Holds("theta", "rad", 1.0, 1000.0, 119.9, 0.0),
    "ptibbets-labprob2/idf_wah.mat": Holds("PendPos", "rad", 1.70, 100.0, 178.5, 0.0),
    "tjcork-imu/data-acc3.csv": Holds("PT", "rad", 0.0, 20.0, 1854.0, 0.0953),
    "tychoaussie-seismometer/SM3_SN001_freeperiod.csv": Holds("Laser", "counts", 0.0, 130.2, 49.1),
    "tylertian-phy180/lab1_data.txt": Holds("column 2", "rad", 0.70, 20.0, 116.4),
    "tylertian-phy180/trial1_rawdata.txt": Holds("column 2", "rad", 1.4, 29.6, 16.9),
    "vicber507-water/Agua1.csv": Holds("theta1", "rad", 0.24, 30.0, 45.5, 0.0),
    "vicber507-water/Aire1.csv": Holds("theta1", "rad", 0.25, 30.0, 55.2, 0.0),
    "wdq-peter-t-ruehr/example_0.WDQ": Holds("channel 1", "V", 0.0, 20.0, 159.8),
    "wdq-peter-t-ruehr/example_1.WDQ": Holds("channel 1", "V", 0.0, 20.0, 28.1),
    "windaq-pytool/april_1_2026__sn2-in-adj.WDH": Holds("channel 1", "V", 0.0, 100.0, 52.5),
    "windaq-pytool/march_30_2026__sn1in.WDH": Holds("channel 1", "V", 0.0, 100.0, 50.8),
    "windaq-pytool/march_30_2026__sn1out.WDH": Holds("channel 1", "V", 0.0, 100.0, 64.3),
    "windaq-pytool/march_30_2026__sn5in_bad.WDH": Holds("channel 1", "V", 0.0, 100.0, 48.8),
    "windaq-vendor-broken/SAMPLE.WDQ": Holds("Sine Wave", "V", 0.0, 250.0, 20.0),
    "windaq-vendor-sample/SAMPLE.WDH": Holds("channel 1", "V", 0.0, 100.0, 22.1),
    "windaq-vendor-sample/SAMPLE.WDQ": Holds("Sine Wave", "V", 0.0, 250.0, 20.0),
    "windaq-vendor-sample/SAMPLE.WHC": Holds("user annotation", "V", 0.0, 200.0, 10.0),
    "windaq-windaq3/AUTO.WDQ": Holds("GEAR POSITION", "V", 0.0, 9.375, 433.7),
    "windaq-windaq3/DI-2108_sine_sample.WDH": Holds("Sample", "V", 0.0, 1000.0, 1.0),
    "windaq-windtunnel-csv/0727windturbine.head-excerpt.csv": Holds(
        "channel 1", "V", 0.0, 360.0, 0.05
    ),
    "windaq-windtunnel-csv/0727windturbine.tail-excerpt.csv": Holds(
        "column 4", "any", 0.0, 360.0, 0.011
    ),
    "yfysiks-encoder/data2_12.csv": Holds("angle", "rad", 0.45, 0.0, 293.0, 0.0),
    "yfysiks-encoder/data2_14.csv": Holds("angle", "rad", 0.40, 0.0, 221.1, 0.0),
    "yfysiks-encoder/data2_20.csv": Holds("angle", "rad", 0.56, 0.0, 148.9, 0.0),
    "yfysiks-encoder/data2_22.csv": Holds("angle", "rad", 0.56, 0.0, 124.4, 0.0),
    "yfysiks-encoder/data32.csv": Holds("angle", "rad", 1.47, 100.0, 140.7, 0.0),
    "yfysiks-encoder/data33.csv": Holds("angle", "rad", 1.40, 100.0, 146.3, 0.0),
    "yyzcr-tracker/pendulum_data_from_tracker_copy.txt": Holds("θ", "rad", 0.34, 30.0, 100.9),
} | {
    f"windaq-pylle-di149-ascii/{number:08d}.cso": Holds("channel 1", "V", 0.0, 11.44, 10.0)
    for number in (21, 23, 25, 27, 29, 31, 38, 40, 44, 46, 48, 50)
}
INPUTS: dict[str, Holds | Refused] = {
    "inputs/k02_cassy1.lab": Holds("Spannung U_A1", "V", 0.399, 50.0, 59.98),
    "inputs/k03_tek_dpo2000.csv": Holds("CH1", "V", 0.68, 500.0, 9.998),
    "inputs/k04_two_columns.csv": Holds("X", "m", 0.0733, 25.0, 39.96),
    "inputs/k05_all_cut.csv": Holds("x", "any", 150.0, 30.0, 110.47),
    "inputs/k05_cut_hundredths_240Hz.csv": Holds("x", "any", 151.5, 240.0, 39.996),
    "inputs/k06_bursts.csv": Holds("Velocity", "m/s", 0.766, 60.0, 98.0),
    "inputs/k08_mm_0.txt": Holds("x, y", "rad", 0.304, 29.97, 74.98),
    "inputs/k09_from_upright.csv": Holds(
        "/joint_states/joint1/position", "rad", 3.094, 516.75, 29.03, 0.0
    ),
    "inputs/k09_plain_names.csv": Holds("position", "rad", 3.094, 516.75, 29.03, 0.0),
    "inputs/k10_camera_28deg.csv": Holds("angle", "rad", 0.505, 30.0, 13.97),
    "inputs/k13_dead_zone_wobble.csv": Holds("Position", "m", 0.1227, 30.0, 79.97),
    "inputs/k19_date_comma_angle.csv": Holds("angle", "any", 0.3009, 25.0, 59.96),
    "inputs/k19_ms_angle_deg.csv": Holds("angle", "any", 17.2, 25.0, 59.96),
    "inputs/k19_ms_volts.csv": Holds("volts", "V", 0.301, 25.0, 59.96, 2.498),
    "inputs/k19_point_time_comma_angle.csv": Holds("angle", "any", 0.3009, 25.0, 59.96),
    "inputs/k20_control_wrap_reads.csv": Holds("adc", "any", 300.0, 100.0, 39.99),
    "inputs/k20_wrap_three_digits.csv": Holds("adc", "any", 300.0, 100.0, 39.99),
    "inputs/k26_relaxing_baseline.txt": Holds("column 2", "any", 1.057, 499.3, 1.4),
    "inputs/k27_arrays_per_stamp.json": Holds("Meas.Gyro.ArrayGyro.y", "any", 114.6, 100.0, 39.99),
    "inputs/k28_says_p_1.csv": Holds("angle", "rad", 0.953, 50.0, 59.98),
} | {
    f"inputs/k23_{kind}.txt": Holds("angle", "any", 20.0, 50.0, 39.98)
    for kind in (
        *("garbled_start", "garbled_utf8", "letters", "lost_comma", "nul_bytes"),
        *("torn_first", "torn_value", "two_in_one"),
    )
}
NOT_RECORDINGS = ("README.md", "LICENSE", ".commit", "DataExplanation.md", "description.txt")


@dataclass(frozen=True)
class Row:
    """One file's outcome: ``right``, ``refused``, ``wrong`` (and why), and what was read."""

    name: str
    outcome: str
    column: str = ""
    unit: str = ""
    rate_hz: float = 0.0
    duration_s: float = 0.0
    level: float = 0.0
    said: str = ""


def judge(name: str, known: Holds | Refused | None) -> Row:
    """Read one file and compare it with what is known of it."""
    path = (SHARED.parent if name.startswith("inputs/") else SHARED) / name
    try:
        recording, found = read(path), inspect(path)
    except InputError as fault:
        said = f"{fault.problem}; {fault.remedy}"
        rightly = isinstance(known, Refused) and known.reason in said and known.remedy in said
        return Row(name, "refused" if rightly else "wrong", said=said)
    rate, duration, unit = found.sample_rate_hz, found.duration_s, recording.unit
    usable = recording.values[recording.usable]
    swing = float(np.abs(usable - np.median(usable)).max())
    guessed = any("unit" in guess for guess in recording.weak_guesses)
    faults = []
    if not isinstance(known, Holds):
        faults.append("read, though it holds no such recording")
    else:
        stem = known.column.removesuffix("(*)")
        if found.chosen != known.column and not (stem != known.column and stem in found.chosen):
            faults.append(f"column {found.chosen}, not {known.column}")
        sure = unit == known.unit and (not known.swing or abs(swing / known.swing - 1.0) < 0.15)
        if not sure and not (guessed and (known.unit == "any" or unit in ("1", "rad"))):
            faults.append(f"unit {unit} (swing {swing:.3g})")
        if known.rate_hz and abs(rate / known.rate_hz - 1.0) > 0.01:
            faults.append(f"rate {rate:.4g} Hz, not {known.rate_hz:g}")
        if abs(duration / known.duration_s - 1.0) > 0.02 + 0.1 * (known.duration_s < 11.0):
            faults.append(f"duration {duration:.4g} s, not {known.duration_s:g}")
        level = float(np.median(usable))
        if sure and known.level is not None and abs(level - known.level) > 0.03:
            faults.append(f"hangs at {level:.3g}, not {known.level:g}")
    said = "; ".join(faults) or "; ".join(recording.weak_guesses)
    return Row(
        name,
        "wrong" if faults else "right",
        found.chosen,
        unit,
        rate,
        duration,
        found.level,
        said,
    )


def rows() -> list[Row]:
    """Judge every file, with those that nobody has described yet as wrong."""
    files = sorted(
        str(path.relative_to(SHARED))
        for path in SHARED.rglob("*")
        if path.is_file() and path.name not in NOT_RECORDINGS
    )
    known = KNOWN | {name: holds for name, holds in INPUTS.items() if _is_here(name)}
    return [judge(name, known.get(name)) for name in (*files, *sorted(known.keys() - {*files}))]


def _is_here(name: str) -> bool:
    return (SHARED.parent / name).is_file()


def main() -> None:
    """Print the table and the counts; fail where a file is read wrong."""
    found = rows()
    print("| file | outcome | column | unit | rate (Hz) | span (s) | hangs at | first line |")
    print("|---|---|---|---|---|---|---|---|")
    for row in found:
        print(
            f"| {row.name} | {row.outcome} | {row.column} | {row.unit} | {row.rate_hz:.5g} |"
            f" {row.duration_s:.5g} | {row.level:.3g} | {row.said} |"
        )
    counts = {each: sum(row.outcome == each for row in found) for each in ("right", "refused")}
    wrong = [row for row in found if row.outcome == "wrong"]
    print(
        f"\n{len(found)} files: {counts['right']} read right, {counts['refused']} refused for the"
        f" true reason, {len(wrong)} wrong"
    )
    tables = sum(isinstance(each, Refused) and not each.recording for each in KNOWN.values())
    share = 100.0 * counts["right"] / (len(found) - tables)
    print(
        f"{tables} of them are tables and no recordings: {share:.1f} % of the others are read right"
    )
    for row in wrong:
        print(f"wrong: {row.name}: {row.said}")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
