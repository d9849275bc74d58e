"""Tables of text: layout, meaning of their columns, and rows that are lost."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.formats import ReadOptions, inspect, read
from pendpipe.formats.lost import without_marks

from ..recordings import white
from .cases import (
    ANGLE,
    DEGREES,
    RATE,
    TIME,
    Case,
    check,
    clock,
    each,
    swing,
    text,
    with_lines,
)

# One swing in the tables that laboratories, loggers, phones and programs write.

SLOW_S, SLOW = swing(1500, 30.0, 0.5)
LARGE = swing(1000, 50.0, 1.1)[1]
SMALL = 0.2 * np.exp(-0.03 * TIME) * np.cos(2.0 * np.pi * TIME / 1.352)
STILL = 1e-3 * np.random.default_rng(5).standard_normal(len(TIME))
ONE, HALF = np.ones(len(TIME)), len(TIME) // 2
DRIVE = np.where(TIME < 7.0, np.sin(5.0 * TIME), 0.0)
COUNT = np.arange(float(len(TIME)))
WHOLE_S = np.floor(TIME + 1e-9)
NANOSECONDS = np.rint(1e9 * (TIME - WHOLE_S))
VOLTS, COUNTS = np.round(2.5 * ANGLE, 4), np.rint(1e5 * ANGLE)
TURN = np.rint(ANGLE * 4096 / (2 * np.pi))
WHEEL = np.exp(-0.05 * TIME) * np.cos(3 * TIME)
LONG_S = 10.0 * np.arange(1500)
ROW, HEAD = "{:.3f},{:.5f}\n", "t (s),theta (rad)\n"
PLAIN = text(TIME, ANGLE, head=HEAD)
TIMES = {
    "frames missing among stamps of three digits": Case(
        "t\ttheta\n"
        + each("{:.2E}\t{:.5f}\n", *(np.delete(x, [100, 101, 640]) for x in (SLOW_S, SLOW))),
        np.delete(SLOW, [100, 101, 640]),
        said="with 3 missing",
        time_s=np.delete(SLOW_S, [100, 101, 640]),
        within_s=0.08,
    ),
    "rows that repeat an older one": Case(
        with_lines(PLAIN, {row: PLAIN.splitlines()[row - 2] for row in (300, 500, 900)}),
        np.delete(ANGLE, [299, 499, 899]),
        said=r"3 row\(s\) that repeat the time",
        time_s=np.delete(TIME, [299, 499, 899]),
    ),
    "steps of ten are seconds": Case(
        text(LONG_S, np.sin(2 * np.pi * LONG_S / 217), digits=4),
        np.sin(2 * np.pi * LONG_S / 217),
        "1",
        doubted="a period of 217",
        time_s=LONG_S,
    ),
    "numbers that end in their point": Case(
        "t (ms),theta (rad)\n" + each("{:.0f}.,{:.5f}\n", 1e3 * TIME, ANGLE)
    ),
    "whole milliseconds without a unit": Case(
        "t,theta (rad)\n" + each("{:.0f},{:.5f}\n", 1e3 * TIME, ANGLE), doubted="milliseconds"
    ),
    "milliseconds by their name": Case(text(TIME * 1e3, DEGREES, head="millis,angle_deg\n")),
    "microseconds by their steps": Case(
        "t,angle_deg\n" + each("{:.0f},{:.4f}\n", 1e6 * TIME, DEGREES)
    ),
    "seconds since 1970": Case(text(1.7e9 + TIME, ANGLE, head="timestamp,angle\n")),
    "times before zero": Case(text(TIME - 100, ANGLE, head=HEAD), said="the times begin at -100 s"),
    "runs below one another": Case(
        text(TIME[:HALF], ANGLE[:HALF], head=HEAD)
        + text(TIME[:HALF], 0.8 * ANGLE[:HALF]),
        ANGLE[:HALF],
        doubted="2 runs stand below one another",
    ),
    "runs with a header each": Case(
        "\n".join(
            f"Run {n}\nLength (m),0.60\n{HEAD}" + text(TIME[:HALF], size * ANGLE[:HALF])
            for n, size in enumerate((1.0, 0.8, 0.6), start=1)
        ),
        ANGLE[:HALF],
        doubted="3 runs stand below one another",
    ),
    "days of a spreadsheet": Case(
        "Date;Angle (deg)\n" + each("{:.10f};{:.5f}\n", 45413.5 + TIME / 86400, DEGREES),
        said="in days",
    ),
    "microseconds since the start": Case(
        "micros,angle (deg)\n" + each("{:.0f},{:.3f}\n", 987654321 + 1e6 * TIME, DEGREES)
    ),
    "nanoseconds since the start": Case(
        "timestamp,angle (deg)\n"
        + each("{},{:.3f}\n", [54321987654321 + 20_000_000 * n for n in range(1000)], DEGREES)
    ),
    "seconds and nanoseconds": Case(
        "sec,nsec,angle (deg)\n" + each("{:.0f},{:.0f},{:.3f}\n", WHOLE_S, NANOSECONDS, DEGREES)
    ),
    "seconds since 1970 and nanoseconds, nameless": Case(
        each("{:.0f},{:.0f},base,arm,{:.6f}\n", 1718030736 + WHOLE_S, NANOSECONDS, SMALL),
        SMALL,
        "1",
    ),
    "seconds and milliseconds": Case(
        "s,ms,angle (deg)\n" + each("{:.0f},{:.0f},{:.4f}\n", WHOLE_S, NANOSECONDS / 1e6, DEGREES)
    ),
    "a clock and milliseconds": Case(
        "time,ms,angle (deg)\n"
        + each("12:00:{:02.0f},{:.0f},{:.3f}\n", WHOLE_S, NANOSECONDS / 1e6, DEGREES)
    ),
    "hours, minutes and seconds": Case(
        "hour,minute,second,angle_deg\n"
        + each("12,{:.0f},{:.3f},{:.4f}\n", (1790 + TIME) // 60, (1790 + TIME) % 60, DEGREES)
    ),
    "times since the row above": Case("dt (ms),angle (deg)\n" + each("20,{:.4f}\n", DEGREES)),
    "a clock that passes midnight": Case(
        "clock,theta [rad]\n"
        + each("{},{:.6f}\n", clock("{h:02d}:{m:02d}:{s:06.3f}", (86390 + TIME) % 86400), ANGLE)
    ),
    "a terminal's stamps": Case(each("[2024-05-01 12:00:{:06.3f}] {:.4f}\n", TIME, ANGLE)),
    "intervals as pandas prints them": Case(
        "elapsed,angle (rad)\n" + each("0 days 00:00:{:09.6f},{:.4f}\n", TIME, ANGLE)
    ),
    "dates beside times": Case(
        "Date,Time,Angle (deg)\n" + each("5/1/2024,12:00:{:06.3f},{:.4f}\n", TIME, DEGREES)
    ),
    "months as words": Case(
        "Time,Angle (deg)\n" + each("01-May-2025 12:00:{:06.3f},{:.4f}\n", TIME, DEGREES)
    ),
    "dates as C prints them": Case(
        "Time,Angle (deg)\n" + each("Thu May  1 12:00:{:06.3f} 2025,{:.4f}\n", TIME, DEGREES)
    ),
    "minutes past the hour": Case(
        "Time,Angle (deg)\n"
        + each("{},{:.4f}\n", clock("{m:02d}:{s:06.3f}", TIME + 3590), DEGREES)
    ),
    "a logger of two-digit years": Case(
        '"Plot Title: arm"\n"#","Date Time, GMT+02:00","Tilt, deg (LGR S/N: 1, SEN S/N: 1)"\n'
        + each("{:.0f},05/01/25 12:00:{:06.3f} PM,{:.4f}\n", COUNT, TIME, DEGREES)
    ),
    "a clock of 32 bits without a name": Case(
        each("{:.0f} {:.0f}\n", np.mod(2.0**32 - 7e6 + 1e6 * TIME, 2.0**32), COUNTS), COUNTS, "1"
    ),
    "ticks that the header's rate explains": Case(
        "// Update Rate: 50.0Hz\nPacketCounter\tSampleTimeFine\tPitch (deg)\n"
        + each("{:.0f}\t{:.0f}\t{:.4f}\n", 900 + COUNT, 400_000 + 200 * COUNT, DEGREES),
        doubted="",
    ),
    "a rate in the header": Case(
        text(DEGREES, head="start_deg, sample_rate, seconds\n45, 50, 16\n")
    ),
    "a rate in kHz": Case(text(ANGLE, head="# Sampling frequency: 0.05 kHz\nangle_rad\n")),
    "frames at a rate that is given": Case(
        "fps: 50\n" + text(COUNT, ANGLE, head="frame,theta (rad)\n")
    ),
    "frames beside a time": Case(text(COUNT, TIME, ANGLE, head="frame,tau,theta\n")),
    "no time, and a rate of the user": Case(
        each("{:11.8f}\n", ANGLE), options=ReadOptions(sample_rate=50)
    ),
    "LabVIEW's channels without a time": Case(
        "channel names:\nDev1_ai0\nstart times:\n12.03.2024 10:23:11\ndt:\n0,02\ndata:\n"
        + text(ANGLE, decimal=",")
    ),
    **{
        f"a rate in a remark: {remark}": Case(
            f"Pendulum 3\n{remark}\nAngle (deg)\n" + text(DEGREES, digits=3)
        )
        for remark in (
            "Sampling: 50 Hz",
            "# interval between samples: 20 ms",
            "Abtastrate;50 Hz",
            "in air, sampled at 50 Hz",
            "in air, 50 Hz",
        )
    },
}  # fmt: skip
COLUMNS = {
    "a header of commas over tabs": Case(
        text(TIME, DRIVE, ANGLE, sign="\t", head="--- torsione ---\nTempo,Forzante,Pendolo\n")
    ),
    "a nameless drive": Case(text(TIME, DRIVE, ANGLE), said="whose swing decays"),
    "a drift beside a slow decay": Case(
        text(
            SLOW_S[:900],
            200 * np.exp(-0.002 * SLOW_S[:900]) * np.cos(2.9 * SLOW_S[:900]),
            590 + 30 * np.cumsum(np.random.default_rng(3).normal(size=1500))[:900] / 40,
        ),
        200 * np.exp(-0.002 * SLOW_S[:900]) * np.cos(2.9 * SLOW_S[:900]),
        "1",
        time_s=SLOW_S,
    ),
    "a letter with an index": Case(
        text(0.01 * ANGLE, TIME, head="x_10s,t_10s\n"), 0.01 * ANGLE, "1"
    ),
    "the unused input of an oscilloscope": Case(
        text(TIME, 0.0 * TIME, ANGLE, head="% Time (s),Input A (V),Input B (V)\n"), unit="V"
    ),
    "a row counter and an error": Case(
        text(
            COUNT, TIME, 1e-3 * (1 + abs(RATE)), 1e-3 * ANGLE, digits=7,
            head="Pt#,Seconds,X',Laser\n",
        ),
        1e-3 * ANGLE,
        "1",
    ),
    "derivatives": Case(
        text(TIME, RATE, ANGLE, head="t,angular velocity (rad/s),angle (rad)\n")
    ),
    "fewer names than columns": Case(
        text(0.0 * TIME, TIME, ANGLE, np.gradient(ANGLE), sign=" ", head="%o v\n")
    ),
    "roll among other motions": Case(
        text(TIME, 3 + 0 * TIME, ANGLE, 1e-4 * ANGLE, head="time,x,phi,theta\n")
    ),
    "symbols above the units": Case(
        "Vernier Format 2\nRun 1\nTime\tAngle\tVelocity\nt\tA\tv\ns\trad\trad/s\n\n"
        + text(TIME, ANGLE, RATE, sign="\t")
    ),
    "the swing's own size": Case(
        "time;ax;ay;az;aT\n"
        + each(
            "{:.3f};{:.5f};0.001;0.002;{:.5f}\n", TIME, ANGLE, abs(ANGLE)
        ).replace(".", ","),
        unit="1",
    ),
    "runs that share their time": Case(
        text(TIME, DEGREES, 0.7 * DEGREES, head="time (s),run1,run2\n"),
        doubted="'run1' (not run2)",
    ),
    "runs that a column numbers": Case(
        "run,t_s,theta_rad\n" + text(ONE, TIME, ANGLE) + text(2 * ONE, TIME, 0.6 * ANGLE),
        said="several runs",
    ),
    "flags beside times that rise": Case(
        "t,theta_rad,flag\n"
        + each("{:.4f},{:.6f},{}\n", TIME, ANGLE, [("ok", "late")[n % 7 == 0] for n in range(1000)])
    ),
    "the row number of pandas": Case(text(COUNT, TIME, ANGLE, head=",t,theta\n")),
    "a table on its side": Case(
        "".join(
            ",".join([name, *(f"{x:.4f}" for x in values)]) + "\n"
            for name, values in (("t (s)", TIME), ("theta (rad)", ANGLE))
        )
    ),
    "a phone in g, the axis that swings once a cycle": Case(
        text(TIME, 0.02 * RATE, STILL, 1 + STILL, abs(0.02 * RATE), head="time,gFx,gFy,gFz,TgF\n"),
        0.02 * RATE,
        "1",
        doubted="gFx",
    ),
    "a phone without a unit": Case(
        text(TIME + 3, TIME, STILL, RATE, STILL, head="time,seconds_elapsed,z,y,x\n"),
        RATE,
        "1",
        doubted="x, y, z",
    ),
    "a phone pulled twice a cycle along its string": Case(
        text(
            TIME, STILL, 9.81 * np.cos(ANGLE) + 0.39 * RATE**2, 0.03 * ANGLE,
            head="Time (s),acceleration x (m/s^2),acceleration y (m/s^2),acceleration z (m/s^2)\n",
        ),
        0.03 * ANGLE,
        "m/s^2",
    ),
    "axes of an accelerometer, with gravity on one": Case(
        text(
            TIME, 300.0 * np.sin(ANGLE), 1e3 * STILL - 1000, 1e3 * STILL, digits=2,
            head="Time (s),x,y,z\n",
        ),
        300.0 * np.sin(ANGLE),
        "1",
        doubted="x, y, z",
    ),
    "gravity's level beside no swing is no unit": Case(
        text(TIME, 9.81 * np.cos(ANGLE) + 0.5 * RATE**2),
        9.81 * np.cos(ANGLE) + 0.5 * RATE**2,
        "1",
    ),
    "two sensors that take turns": Case(
        "Time (s),Angle (rad),Force (N)\n"
        + each(
            "{:.3f},{},{}\n",
            TIME,
            [f"{x:.5f}" if n % 2 == 0 else "" for n, x in enumerate(ANGLE)],
            ["" if n % 5 else "9.81" for n in range(1000)],
        ),
        lost=range(1, 1000, 2),
    ),
}  # fmt: skip
UNITS = {
    "an encoder's steps tell no unit": Case(
        text(TIME, np.pi / 2048 * np.rint(0.2 * SMALL * 2048 / np.pi), digits=9, head="t,theta\n"),
        np.pi / 2048 * np.rint(0.2 * SMALL * 2048 / np.pi),
        "1",
    ),
    "digits that were printed as degrees": Case(
        text(TIME, np.radians(np.round(np.degrees(0.2 * ANGLE), 5)), digits=12, head="x,y\n"),
        0.2 * ANGLE,
        said="its values are multiples of 1e-05",
    ),
    "a header that contradicts the period": Case(
        text(TIME, LARGE, head="t (s),theta (deg)\n"), LARGE, doubted="headed in degrees"
    ),
    "a torsion pendulum of 8 rad": Case(text(TIME, 8 * WHEEL, head=HEAD), 8 * WHEEL),
    "a torsion pendulum of 150 rad": Case(text(TIME, 150 * WHEEL, head=HEAD), 150 * WHEEL),
    "counts that are few": Case(
        "t (s),Right encoder\n" + each("{:.2f},{:.0f}\n", TIME, TURN // 10),
        TURN // 10,
        "counts",
        doubted="whole numbers",
    ),
    "counts that go on beyond their zero": Case(
        "t (s),raw_angle\n" + each("{:.2f},{:.0f}\n", TIME, np.mod(TURN, 4096)),
        TURN,
        "counts",
        said="jump by a turn of 4096",
    ),
    "a position whose period grows as an angle's": Case(
        text(TIME, ANGLE, head="time (s),position\n")
    ),
    "a position that is none": Case(
        text(TIME, 0.388 * np.sin(ANGLE), head="time (s),position\n"), 0.388 * np.sin(ANGLE), "1"
    ),
    "pi is down": Case(text(TIME, ANGLE + np.pi, head="t,theta\n")),
    "pi is down, wrapped": Case(
        text(TIME, np.where(ANGLE > 0, ANGLE - np.pi, ANGLE + np.pi), head="t,theta\n")
    ),
    "a polar angle from the horizontal": Case(text(TIME, DEGREES - 90, head="t,θ_r\n")),
    "a degree sign that was decoded twice": Case(text(TIME, DEGREES, head="Time (s),Angle [Â°]\n")),
    "metres in the name": Case(text(TIME, ANGLE, head="t (s),s_m\n"), unit="m"),
    "divisions of a scale": Case(text(TIME, ANGLE, head="t (s),Skalenteile\n"), unit="divisions"),
    "sections are no units": Case(
        "[Header]\nSampleRate=50\nUnit=deg\n[Data]\n" + text(DEGREES)
    ),
    **{
        f"a unit in the last bracket of {name}": Case(
            text(TIME, ONE, 80 * ANGLE, sign=";", head=f"t [s];Pixel (X) [px];{name}\n"),
            80 * ANGLE,
            "pixels",
        )
        for name in ("Pixel (Y) [px]", "Y (bob) <b> [px]", "Bob <2> (px) [raw]")
    },
    **{
        f"{header} is read in its own unit": Case(
            text(TIME, scale * ANGLE, digits=9, head=f'"Time (s)","{header}"\n'), unit=unit
        )
        for header, scale, unit in (
            ("Gyroscope x (rad/s)", 1.0, "rad/s"),
            ("omega (deg/s)", 180 / np.pi, "rad/s"),
            ("Acceleration y (m/s^2)", 1.0, "m/s^2"),
            ("Illuminance (lx)", 1.0, "lx"),
            ("x (px)", 1.0, "pixels"),
            ("ADC (counts)", 1.0, "counts"),
            ("Hall (foo)", 1.0, "foo"),
        )
    },
    **{
        f"{unit} that the user gives": Case(
            text(TIME, ANGLE, digits=9, head="t,theta\n"),
            factor * ANGLE,
            found,
            options=ReadOptions(unit=unit),
        )
        for unit, factor, found in (
            ("deg", np.pi / 180, "rad"),
            ("mrad", 1e-3, "rad"),
            ("V", 1.0, "V"),
            ("mV", 1e-3, "V"),
            ("mm", 1e-3, "m"),
        )
    },
}  # fmt: skip
POSITIONS = {
    "pixels from a corner": Case(
        text(TIME, 640 + 60 * SMALL, 480 - 3 * SMALL**2, digits=2, head="t,x,y\n"),
        640 + 60 * SMALL,
        "1",
        doubted="analysed in its own",
    ),
    "a bob seen from its pivot": Case(
        text(TIME, 1.2 * np.sin(ANGLE), -1.2 * np.cos(ANGLE), sign="\t", head="mass_A\nt\tx\ty\n")
    ),
    "a nameless bob seen from its pivot": Case(
        text(TIME, 1.2 * np.sin(ANGLE), -1.2 * np.cos(ANGLE))
    ),
    "rows of a picture count downwards": Case(
        text(TIME, 300 * np.sin(ANGLE), 300 * np.cos(ANGLE), head="t,x [px],y [px]\n")
    ),
    "a pivot that is tracked too": Case(
        text(
            TIME, 3.2 + STILL, 5.1 - STILL, 3.2 + STILL + 0.6 * np.sin(ANGLE),
            5.1 - STILL - 0.6 * np.cos(ANGLE), head="t,x_pivot,y_pivot,x_bob,y_bob\n",
        )
    ),
    "cells of a tracker that lost four frames": Case(
        with_lines(
            "mass_A\t\t\nt\tx\ty\n"
            + each("{:.5E}\t{:.5E}\t{:.5E}\n", TIME, 0.6 * np.sin(ANGLE), -0.6 * np.cos(ANGLE)),
            {row + 2: f"{TIME[row]:.5E}\t\t" for row in (300, 301, 302, 900)},
        ),
        lost=(300, 301, 302, 900),
    ),
    "Tracker's angle beside its axes": Case(
        "#mass_A\n"
        + text(
            TIME, np.sin(ANGLE), -np.cos(ANGLE), DEGREES - 90, sign="\t", head="t\tx\ty\tθ_{r}\n"
        )
    ),
    **{
        f"axes called {names}": Case(
            text(
                TIME, 1288 + 1664 * np.sin(0.5 * ANGLE), -744 + 1664 * np.cos(0.5 * ANGLE),
                head=f"tempo_s,{names}\n",
            ),
            0.5 * ANGLE,
        )
        for names in ("posicao_x_px,posicao_y_px", "x1 (px),y1 (px)", "Bob X,Bob Y")
    },
    **{
        f"a bob marked lost by {mark}": Case(
            text(
                TIME,
                np.where(np.isin(COUNT, (70, 500, 501, 820)), mark, 640.0 + 400.0 * np.sin(ANGLE)),
                head="time_s,x_px\n",
            ),
            640.0 + 400.0 * np.sin(ANGLE),
            "pixels",
            lost=(70, 500, 501, 820),
        )
        for mark in (-1, 0, 9999)
    },
}  # fmt: skip
SIGNS = {
    "the plain form": Case(text(TIME, ANGLE, head="# source: test\ntime_s,angle_rad\n")),
    "no header, blanks": Case(text(TIME, ANGLE, sign="   ")),
    "no header, tabs": Case(text(TIME, ANGLE, sign="\t")),
    "decimal commas and semicolons": Case(
        text(TIME, ANGLE, sign=";", decimal=",", head="Zeit t / s;Auslenkung phi / rad\n")
    ),
    "decimal commas and tabs": Case(text(TIME, ANGLE, sign="\t", decimal=",", head="t\tθ\n")),
    "decimal commas in quotes": Case(
        "t,phi\n" + each('"{:.3f}","{:.6f}"\n', TIME, ANGLE).replace(".", ",")
    ),
    "decimal commas alone": Case(
        text(100 * ANGLE, decimal=",", digits=2),
        0.1 * ANGLE,
        options=ReadOptions(sample_rate=50, unit="mrad"),
    ),
    "a byte-order mark": Case("\ufeff" + PLAIN),
    "UTF-16": Case(PLAIN.encode("utf-16")),
    "line ends of Windows": Case(text(TIME, ANGLE, head="time,angle\n").replace("\n", "\r\n")),
    "a torn byte among signs of UTF-8": Case(
        ("Zeit;Winkel\n" + each("{:.2f} s;{:.3f}°\n", TIME, DEGREES))
        .encode()
        .replace(b"\n0.50 s", b"\n0.5\xff s"),
        np.delete(ANGLE, 25),
        said=r"1 damaged row\(s\)",
        time_s=np.delete(TIME, 25),
    ),
    "signs of a typesetter": Case(
        PLAIN.replace("-", "\N{MINUS SIGN}").replace(",", ",\N{NO-BREAK SPACE}")
    ),
    "a remark for a header": Case(
        text(TIME, ANGLE, sign=" ", head="% recorded by hand\n% t theta\n")
    ),
    "remarks with a number are no names": Case(
        "mass 0.15\nlength 0.60\n" + text(TIME, ANGLE, sign=" ")
    ),
    "a row of units": Case(text(TIME, ANGLE, sign="\t", head="Time\tAngle\n[s]\t[rad]\n")),
    "labels before the header's rows": Case(
        "Kanal;1;2\nName;Zeit;Winkel\nEinheit;s;Grad\n"
        + each(";{:.3f};{:.4f}\n", TIME, DEGREES).replace(".", ",")
    ),
    "four lines of names": Case(
        '"TOA5","CR1000"\n"TIMESTAMP","RECORD","Angle"\n"TS","RN","deg"\n"","","Smp"\n'
        + each('"2025-05-01 12:00:{:06.3f}",{:.0f},{:.4f}\n', TIME, COUNT, DEGREES)
    ),
    "a sign that the header lacks": Case(
        "t (ms)\trate (deg/s)\tangle (deg)\n"
        + each("{:.0f}\t0.0\t{:.4f}\t\n", 1e3 * TIME, DEGREES)
    ),
    "rows printed as lists": Case(each("({:.5f}, {:.5f})\n", TIME, ANGLE)),
    "an array that was printed": Case(
        "[" + each("[{: .8e} {: .8e}]\n ", TIME, 0.3 + SMALL).rstrip() + "]\n", 0.3 + SMALL, "1"
    ),
    "numbers as NumPy shows them": Case(
        "t (s), theta (rad)\n" + each("np.float64({:.2f}), np.float64({:.5f})\n", TIME, ANGLE)
    ),
    "all rows in one line": Case(
        "data = [" + each("({:.2f}, {:.5f}), ", TIME, ANGLE)[:-2] + "]\n"
    ),
    "the brackets of MATLAB": Case(
        "% run 3\nA = [\n" + each("  {:.2f} {:.5f};\n", TIME, ANGLE) + "];\n"
    ),
    "a dash between": Case(
        "time angle_rad\n" + each("{:.3f} - {:.5f}\n", TIME, ANGLE + 1.0), ANGLE + 1.0
    ),
    "units in the cells": Case("t,angle\n" + each("{:.2f} s,{:.3f} deg\n", TIME, DEGREES)),
    "degrees from the axis of a picture": Case(
        text(TIME, 270 + np.degrees(SMALL), head="t (s),theta\n"),
        SMALL,
        doubted="swings about 270: taken to be in degrees",
    ),
    "what swings about no quarter turn": Case(
        text(TIME, 260 + np.degrees(SMALL), head="t (s),theta\n"),
        260 + np.degrees(SMALL),
        "1",
        doubted="no unit: analysed in its own",
    ),
    "degrees and decimal commas in the cells": Case(
        "Zeit;Auslenkung\n" + each("{:.2f} s;{:.3f}°\n", TIME, DEGREES).replace(".", ",")
    ),
    "an error behind every number": Case(
        "t (s),theta (deg)\n" + each("{:.2f} ± 0.01,{:.3f} ± 0.05\n", TIME, DEGREES)
    ),
    "rows numbered without a name": Case(
        '"time" "angle"\n' + each('"{:.0f}" {:.2f} {:.5f}\n', COUNT, TIME, ANGLE)
    ),
    "statistics below the table": Case(
        text(TIME, DEGREES, head="Time (s),Angle (deg)\n")
        + "\nMean,-0.103\nStd. Dev.,9.12\nN,3000\n"
    ),
    "names and the first row in one line": Case(
        "x y0 0.2\n" + each("{:.3f} {:.5f}\n", TIME, SMALL),
        SMALL, "1", said="names and the first row in one line",
    ),
    **{
        f"thousands parted by {name}": Case(
            f"time (ms){sign}angle (deg)\n"
            + each(f"{quote}{{}}{quote}{sign}{{}}\n", *(
                [f"{x:,.3f}".translate(str.maketrans(*swapped)) for x in column]
                for column in (1e3 * TIME, DEGREES)
            ))
        )
        for name, sign, quote, swapped in (
            ("commas", ",", '"', ("", "")),
            ("points", ";", "", (",.", ".,")),
            ("apostrophes", ";", "", (",", "'")),
            ("narrow blanks", ";", "", (",.", "\N{NARROW NO-BREAK SPACE},")),
            ("thin blanks", ";", "", (",", "\N{THIN SPACE}")),
        )
    },
    **{
        f"a header in {encoding}": Case(
            text(TIME, DEGREES, sign=sign, head=head + "\n").encode(encoding), doubted=""
        )
        for head, sign, encoding in (
            ("时间(s),角度(°)", ",", "gb18030"),
            ("時間[s],角度[deg]", ",", "cp932"),
            ("시간(s),각도(°)", ",", "cp949"),
            ("Время (с),Угол (град)", ",", "cp1251"),
            ("temps (s);élongation (°)", ";", "cp1252"),
        )
    },
    **{
        f"no reading: {' '.join(words)}": Case(
            with_lines(
                "time (s),angle (deg)\n" + text(TIME, DEGREES, digits=3),
                {250 * n + 1: f"{TIME[250 * n]:.3f},{word}" for n, word in enumerate(words)},
            ),
            lost=range(0, 1000, 250)[: len(words)],
        )
        for words in (
            ("OL", "---", "overrange", "#N/A"),
            ("#DIV/0!", "#REF!", "#####", "#BEZUG!"),
            ("n/d", ".", "k.A.", "-1.#IND00"),
            ("nan", "NaN", ""),
        )
    },
}  # fmt: skip
LABVIEW = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n"
PROGRAMS = {
    "a serial monitor's arrows, with times": Case(
        each("12:03:{:06.3f} -> {:.0f},{:.6f}\n", TIME, 1e3 * TIME, ANGLE)
    ),
    "a serial monitor's arrows, without": Case(each("12:03:{:06.3f} -> {:.6f}\n", TIME, ANGLE)),
    "a serial monitor's arrows, with names": Case(
        "12:34:55.001 -> Ready\n12:34:55.101 -> ms,angle_deg\n"
        + each("12:34:{:06.3f} -> {:.0f},{:.3f}\n", TIME, 1e3 * TIME + 500, DEGREES)
    ),
    "labels with colons": Case(each("t:{:.4f},theta:{:.6f}\n", TIME, ANGLE)),
    "labels with signs of equality": Case("ready\n" + each("t={:.4f} theta={:.6f}\n", TIME, ANGLE)),
    "words with each number": Case(
        "ready\n" + each("t={:.3f} ms, angle={:.4f} deg\n", 1e3 * TIME, DEGREES)
    ),
    "words and bars": Case(each("t: {:.5f} s | theta: {:.4f}°\n", TIME, DEGREES)),
    "a log's level and place": Case(
        each("2024-05-01 12:00:{:09.6f} INFO sensor: angle = {:.4f} deg\n", TIME, DEGREES)
    ),
    "Mathematica": Case(
        each("{{{:.5f}, {}}},\n", TIME, [f"{x:.6e}".replace("e", "*^") for x in ANGLE])
    ),
    "text between the rows": Case(
        "Pendulum logger v1.2\nCalibrating... done\nms,angle (deg)\n"
        + each("{:.0f},{:.2f}\n", 1e3 * TIME + 5120, DEGREES).replace("\n", "\nWARN: 80 %\n", 2),
        said=r"2 line\(s\) of text",
    ),
    "two prints a sample": Case(
        each("{:.0f}\n{:.1f},7\n", 1e3 * TIME, 1e3 * SMALL), 1e3 * SMALL, "1"
    ),
    "topics of a robot": Case(
        each(
            "header:\n  stamp:\n    sec: {:.0f}\n    nanosec: {:.0f}\n  frame_id: base\nname:\n"
            "- arm\nangle:\n- {:.6f}\neffort: []\n---\n",
            1718030736 + WHOLE_S, NANOSECONDS, SMALL,
        ),
        SMALL, "1",
    ),
    "a broker's log": Case(each('lab/arm {{"t": {:.3f}, "angle_deg": {:.4f}}}\n', TIME, DEGREES)),
    "attributes": Case("<run>\n" + each("<row t='{:.3f}' angle_deg='{:.4f}'/>\n", TIME, DEGREES)),
    "attributes of samples": Case(each('<sample t="{:.3f}" theta="{:.6f}"/>\n', TIME, ANGLE)),
    "elements": Case(
        "<?xml version='1.0'?>\n<run>\n"
        + each(
            "<row>\n<time>{:.3f}</time>\n<angle unit='rad'>{:.5f}</angle>\n</row>\n", TIME, SMALL
        )
        + "</run>\n",
        SMALL, "1",
    ),
    "lists of YAML": Case(
        f"bob: brass\nt: [{each('{:.3f}, ', TIME)}]\ntheta: [{each('{:.6f}, ', ANGLE)}]\n"
    ),
    "lists of MATLAB": Case(
        f"t = [{each('{:.3f} ', TIME)}];\ntheta = [{each('{:.6f} ', ANGLE)}];\n"
    ),
    "matrices of Octave": Case(
        "# Created by Octave 6.4.0\n# name: t\n# type: matrix\n# rows: 1\n "
        + each("{:.3f} ", TIME)
        + "\n\n# name: theta_rad\n# type: matrix\n# rows: 1\n "
        + each("{:.5f} ", ANGLE)
    ),
    "columns of Octave": Case(
        "# Created by Octave 6.4.0, Mon May 06 11:02:01 2024 CEST <lab@pc>\n"
        + "".join(
            f"# name: {name}\n# type: matrix\n# rows: 1000\n# columns: 1\n{text(values)}\n\n"
            for name, values in (("t", TIME), ("phi", ANGLE))
        )
    ),
    "waves of Igor by their scale": Case(
        "IGOR\nWAVES/D/O\tphi\nBEGIN\n"
        + each("\t{:.6f}\n", ANGLE)
        + 'END\nX SetScale/P x, 0, 0.02, "s", phi; SetScale y, 0, 0, "rad", phi\n'
    ),
    "waves of Igor with a clock": Case(
        "IGOR\nWAVES/D\tclock, arm\nBEGIN\n"
        + each("\t{:.3f}\t{:.4f}\n", TIME, DEGREES)
        + 'END\nX SetScale/P x 0,1,"", clock; SetScale y 0,0,"s", clock\n'
        'X SetScale/P x 0,1,"", arm; SetScale y 0,0,"deg", arm\n'
    ),
    "Origin": Case(
        "Long Name\tTime\tAngle\nUnits\ts\trad\nComments\t\tPohl's wheel\n"
        + each("{:.0f}\t{:.5f}\t{:.6f}\n", COUNT, TIME, ANGLE)
    ),
    "Excel's XML": Case(
        "<?xml version='1.0'?>\n<?mso-application progid='Excel.Sheet'?>\n<Workbook><Table>"
        "<Row><Cell><Data>t (s)</Data></Cell><Cell><Data>theta (rad)</Data></Cell></Row>"
        + each(
            "<Row><Cell><Data>{:.5f}</Data></Cell><Cell><Data>{:.6f}</Data></Cell></Row>",
            TIME, ANGLE,
        )
        + "</Table></Workbook>",
        name="c.xls",
    ),
    "a web page": Case(
        "<!DOCTYPE html><html><head><title>run</title></head><body><table>"
        "<tr><th>Time (s)</th><th>Angle (deg)</th></tr>\n"
        + each("<tr>\n <td>{:.2f}</td><td>{:.3f}</td></tr>", TIME, DEGREES)
        + "</table></body></html>"
    ),
    "PASCO": Case(text(TIME, ANGLE, head='"Time (s) Run #1","Angle (rad) Run #1"\n')),
    "Vernier's table": Case(text(TIME, ANGLE, head='"Latest: Time (s)","Latest: Angle (rad)"\n')),
    "Vernier's text": Case(
        "Vernier Format 2\nUntitled\n3/4/2019 10:10:10\nRun 1\nTime\tAngle\nt\tθ\ns\trad\n\n"
        + text(TIME, ANGLE, sign="\t"),
        doubted="",
    ),
    "phyphox": Case(
        text(
            TIME, DEGREES, 0.0 * TIME,
            head='"Time (s)","Tilt up/down (deg)","Tilt left/right (deg)"\n',
        )
    ),
    "LabVIEW": Case(
        LABVIEW + "Date\t2023/11/07\nTime\t14:03:11.5\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        "Samples\t1000\t1000\t\nDate\t2023/11/07\t2023/11/07\t\nTime\t14:03:11.5\t14:03:11.5\t\n"
        "Y_Unit_Label\tVolts\tVolts\t\nX_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\n"
        "Delta_X\t0.02\t0.02\t\n***End_of_Header***\t\t\t\nX_Value\tVoltage_0\tVoltage_1\tComment\n"
        + each("{:.3f}\t{:.5f}\t{:.5f}\t\n", TIME, VOLTS, STILL),
        VOLTS, "V",
    ),
    "LabVIEW without a unit for its columns": Case(
        LABVIEW + "***End_of_Header***\t\n\t\nDelta_X\t0.02\t0.02\t\n***End_of_Header***\t\t\n"
        "X_Value\tVoltage_0\tVoltage_1\tComment\n" + text(TIME, ANGLE, 0.0 * ANGLE, sign="\t"),
        unit="V",
    ),
    "LabVIEW in segments": Case(
        LABVIEW + "***End_of_Header***\t\n\t\n"
        + "\t\n".join(
            "Channels\t1\t\nDate\t2019/03/05\t\nY_Unit_Label\tdeg\t\nDelta_X\t0.02\t\n"
            "***End_of_Header***\t\t\nX_Value\tArm\tComment\n"
            + each("{:.3f}\t{:.4f}\t\n", TIME[part], DEGREES[part])
            for part in (slice(HALF), slice(HALF, None))
        )
    ),
    "Audacity": Case(
        "Sample Rate: 50 Hz. Sample values on linear scale.\n"
        "Length processed: 1000 samples, 20.00000 seconds.\n\n"
        + text(TIME, 0.7 * SMALL, sign="\t"),
        0.7 * SMALL, "1", doubted="--unit",
    ),
    "a Rigol that counts": Case(
        "X,CH1,Start,Increment,\nSequence,VOLT,0.0e+00,2.0e-02,\n"
        + each("{:.0f},{:.6e},,\n", COUNT, VOLTS),
        VOLTS, "V",
    ),
    "a Tektronix with its settings beside": Case(
        each(
            "{},{:.3f},{:.5f},\n",
            ["Record Length,1.0e+03,Points", "Sample Interval,2.0e-02,s", "Source,CH1,",
             "Vertical Units,V,", "Horizontal Units,s,", "Model Number,TDS2014C,", *994 * [",,"]],
            TIME - 10, VOLTS,
        ),
        VOLTS, "V",
    ),
    "a Siglent": Case(
        "Record Length,Analog:1000\nSample Interval,Analog:2.0e-02\nVertical Units,CH1:V,CH2:V\n"
        "Horizontal Units,s\nModel Number,SDS1104X-E\nSource,CH1,CH2\nSecond,Volt,Volt\n"
        + text(TIME - 10, VOLTS, STILL),
        VOLTS, "V",
    ),
    "a Siglent with an offset of its settings": Case(
        "Record Length,Analog:1000\nSample Rate,50.0\nVertical Offset,CH1:0.00000\n"
        "Horizontal Scale, 0.000010000\nSecond,Volt\n" + text(TIME, VOLTS),
        VOLTS, "V",
    ),
    "a Keysight": Case(
        "x-axis,1,2\nsecond,Volt,Volt\n"
        + each("{:+.6E},{:+.6E},{:+.6E}\n", TIME - 10, VOLTS, STILL),
        VOLTS, "V",
    ),
    "a LeCroy": Case(
        "LECROYWS3024z,64012,Waveform\nSegments,1,SegmentSize,1000\nTime,Ampl\n"
        + text(TIME, VOLTS),
        VOLTS, "V",
    ),
    "a Moku": Case(
        "% Moku:Go Data Logger\n% Acquisition rate: 50 Hz\n% Time (s), Input 1 (V)\n"
        + text(TIME, VOLTS),
        VOLTS, "V",
    ),
    "BenchLink": Case(
        "Scan,Time,101 (VDC),Alarm 101\n"
        + each(
            "{:.0f},03/12/2024 10:11:{},{:.4f},0\n",
            COUNT, [f"{t:06.3f}".replace(".", ":") for t in TIME], VOLTS,
        ),
        VOLTS, "V",
    ),
    "a Keithley": Case(
        "Reading,Unit,Relative Time\n" + each("{:.4f},Volt DC,{:.5f}\n", VOLTS, TIME), VOLTS, "V"
    ),
    "an oscilloscope's nameless volts": Case(
        "Format,1.0B\nMemory Length,1000\nTrigger Level,5.0E-02\nVertical Units,V\n"
        "Vertical Scale,5.0E-01\nSampling Period,2.0E-02\nMode,Detail\nWaveform Data,\n"
        + text(TIME, VOLTS),
        VOLTS, "V",
    ),
    "SLIST of a seismograph": Case(
        "TIMESERIES XX_ARM__BHZ_D, 1000 samples, 50 sps, 2025-05-01T12:00:00, SLIST, INTEGER,"
        " Counts\n" + each("{:.0f} {:.0f} {:.0f} {:.0f} {:.0f}\n", *COUNTS.reshape(-1, 5).T),
        COUNTS, "counts",
    ),
    "SLIST of a seismograph in two segments": Case(
        "".join(
            f"TIMESERIES XX_ARM__BHZ_D, 500 samples, 50 sps, 2025-05-01T12:00:{start:02d}, SLIST,"
            " INTEGER, m\n"
            + each("{:.0f} {:.0f} {:.0f} {:.0f} {:.0f}\n", *COUNTS[part].reshape(-1, 5).T)
            for start, part in ((0, slice(HALF)), (10, slice(HALF, None)))
        ),
        COUNTS, "m",
    ),
    "GSE2 of a seismograph": Case(
        "".join(
            f"WID2 2025/05/01 12:00:{start:06.3f} ARM   BHZ      INT      500   50.000000"
            "   1.00e+00   1.000 STS-2  -1.0 -1.0\nSTA2  -99.0000 -999.00000 -.999 -.999\nDAT2\n"
            + each("{:.0f} {:.0f} {:.0f} {:.0f} {:.0f}\n", *COUNTS[part].reshape(-1, 5).T)
            + "CHK2   123456\n\n"
            for start, part in ((0, slice(HALF)), (10, slice(HALF, None)))
        ),
        COUNTS, "counts",
    ),
    "SAC of a seismograph": Case(
        f"{0.02:15.7g}" + f"{-12345.0:15.7g}" * 4 + "\n" + (f"{-12345.0:15.7g}" * 5 + "\n") * 13
        + ("    -12345" * 5 + "\n") * 8 + "-12345  -12345  -12345  \n" * 8
        + each("{:15.7g}{:15.7g}{:15.7g}{:15.7g}{:15.7g}\n", *COUNTS.reshape(-1, 5).T),
        COUNTS, "1",
    ),
}  # fmt: skip
CASES = {**TIMES, **COLUMNS, **UNITS, **POSITIONS, **SIGNS, **PROGRAMS}


@pytest.mark.parametrize("case", CASES)
def test_a_swing_is_read_from_a_table_with(tmp_path: Path, case: str) -> None:
    check(tmp_path, CASES[case])


# Readings that stand for lost ones are marked, and no true reading is.


def decay(cycle: float, quality: float, middle: float = 0.0, count: int = 1200) -> FloatArray:
    """A free decay of amplitude 1, with a thousandth of noise; `cycle` readings a cycle."""
    turn = 2.0 * np.pi * np.arange(count) / cycle
    return np.asarray(
        middle
        + np.exp(-0.5 * turn / quality) * np.cos(turn + 0.3)
        + white(int(10 * cycle + quality), count, 1e-3)
    )


def lost(values: FloatArray) -> list[int]:
    return np.flatnonzero(np.isnan(without_marks(values))).tolist()


ROWS = [40, 41, 110, 231, 305]
"""Two on end, the others alone; all at amplitudes above a third of the first."""


def marked(values: FloatArray, rows: list[int], marks: float | list[float]) -> FloatArray:
    """Readings of which some are replaced."""
    values[rows] = marks
    return values


FAR = [18, 50, 78, 98, 131, 218]
"""Four of them at amplitudes above 0.8."""
IN_TURN = [95, 97, 99, 300, 302, 700]
SWING = 42.3 + 8.0 * decay(22.0, 140.0)
DECAYS: dict[str, tuple[FloatArray, list[int]]] = {
    # A number that comes back far from the swing is no reading.
    **{
        f"{mark:g} beside a swing about {middle:g}": (
            marked(decay(20.0, 100.0, middle), ROWS, mark),
            ROWS,
        )
        for mark in (0.0, -1.0, -999.0, 9999.0, 1e6, 1e300)
        for middle in (5.3, 42.0)
    },
    # Zeros in a swing about zero are seen by those far from it.
    "zeros far from it": (marked(np.round(decay(40.0, 100.0), 3), FAR, 0.0), FAR),
    "zeros that it passes": (np.round(decay(40.0, 100.0), 1), []),
    "no echo, too near and too far": (
        marked(np.round(SWING, 1), ROWS, [0.0, 357.1, 357.1, 0.0, 357.1]),
        ROWS,
    ),
    "wild readings that differ": (
        marked(decay(20.0, 100.0), [40, 200, 500], [1e6, -3e5, 40.0]),
        [40, 200, 500],
    ),
    "every second reading for a while": (marked(decay(40.0, 100.0), IN_TURN, -999.0), IN_TURN),
    # The diagnosis names it: a glitch, or a knock.
    "one that stands out by less than all span": (
        marked(decay(40.0, 100.0), [200], decay(40.0, 100.0)[200] + 1.5),
        [],
    ),
    "a release and an end that stand apart": (
        marked(1e-3 * decay(40.0, 100.0), [0, -1], [1.0, -1.0]),
        [],
    ),
}


@pytest.mark.parametrize("case", DECAYS)
def test_readings_that_stand_for_lost_ones_are_marked(case: str) -> None:
    values, rows = DECAYS[case]
    assert lost(values) == rows


@pytest.mark.parametrize("cycle", [3.3, 8.0, 13.0, 40.0, 200.0])
@pytest.mark.parametrize("quality", [1.5, 3.0, 10.0, 3000.0])
@pytest.mark.parametrize("step", [0.0, 0.002, 0.03, 0.25])
def test_no_reading_of_a_decay_is_lost(cycle: float, quality: float, step: float) -> None:
    """Rounded, held by a slow sensor, clipped, or counted on a circle that it swings across."""
    values = decay(cycle, quality, middle=0.37)
    if step:
        values = step * np.round(values / step)
    assert lost(values) == []
    assert lost(np.repeat(values, 4)) == []
    assert lost(np.clip(values, -step * 3, step * 2) if step else np.clip(values, 0.0, 0.7)) == []
    for circle in (360, 4096):
        turned = np.round(decay(cycle, quality) * circle / 6.0)
        assert lost(np.mod(turned, circle)) == []
        assert lost(np.mod(turned + circle / 2 - 3, circle)) == []


# What a column means, its unit and its clock: as the file states, else as one test shows.

TIME_S, LARGE_RAD = swing(3000, 50.0, 0.5)
SMALL_RAD = 0.03 * swing(3000, 50.0, 0.0001)[1] / 0.0001
SMALL_RATE = np.gradient(SMALL_RAD, TIME_S)
NOISE = np.random.default_rng(3).standard_normal((2, len(TIME_S)))
ARM_M = 9.81 / (2.0 * np.pi * 0.8) ** 2
"""Of a pendulum of 0.8 Hz."""


def on_circle(angle: FloatArray, x0: float, y0: float, arm: float) -> tuple[FloatArray, FloatArray]:
    """Positions on a circle about (x0, y0), with noise of 0.2 % of its radius."""
    x, y = arm * np.sin(angle) + 2e-3 * arm * NOISE[0], -arm * np.cos(angle) + 2e-3 * arm * NOISE[1]
    return x0 + x, y0 + y


class Meant(NamedTuple):
    """Columns behind the time, under `head`: what is read, of which unit and why."""

    head: str
    columns: tuple[FloatArray, ...]
    values: FloatArray
    unit: str = "rad"
    said: str = ""
    guessed: bool = False


MEANINGS = {
    "its rate beside it, in rad/s": Meant(
        "t,theta,omega (rad/s)", (np.degrees(SMALL_RAD), SMALL_RATE), SMALL_RAD, said="by 'omega'"
    ),
    "its rate beside it, in degrees a second": Meant(
        "t,theta,omega (deg/s)", (SMALL_RAD, np.degrees(SMALL_RATE)), SMALL_RAD, said="by 'omega'"
    ),
    "derivative first, nameless": Meant(
        "", (np.gradient(LARGE_RAD, TIME_S), LARGE_RAD), LARGE_RAD, said="whose derivative"
    ),
    "derivative second, nameless": Meant(
        "", (LARGE_RAD, np.gradient(LARGE_RAD, TIME_S)), LARGE_RAD, said="whose derivative"
    ),
    "period of sin x, radians": Meant("t,angle", (LARGE_RAD,), LARGE_RAD, said="is in radians"),
    "period of sin x, degrees": Meant(
        "t,angle", (np.degrees(LARGE_RAD),), LARGE_RAD, said="is in degrees"
    ),
    "period of sin x, turns": Meant(
        "t,angle", (LARGE_RAD / (2 * np.pi),), LARGE_RAD, said="is in turns"
    ),
    "a circle about (0, 0)": Meant(
        "t,x (m),y (m)", on_circle(LARGE_RAD, 0.0, 0.0, ARM_M), LARGE_RAD, said="seen from (0, 0)"
    ),
    "a circle about another place": Meant(
        "t,x (cm),y (cm)", on_circle(LARGE_RAD, 30.0, 90.0, 100 * ARM_M), LARGE_RAD,
        said="the centre of their circle",
    ),
    "its length under gravity, with (0, 0) below the pivot": Meant(
        "t,x (mm),y (mm)", on_circle(LARGE_RAD, 0.0, 0.2e3 * ARM_M, 1e3 * ARM_M), LARGE_RAD,
        said="the centre of their circle",
    ),
    "nothing": Meant("t,theta", (SMALL_RAD,), SMALL_RAD, "1", "(--unit)", guessed=True),
    "a formula's unit in the header": Meant(
        "t,x (mm),temperature", (SMALL_RAD, 20.0 + 0.0 * SMALL_RAD), 1e-3 * SMALL_RAD, "m"
    ),
    "uncertainties and a counter beside it": Meant(
        "n,t,theta (rad),err",
        (SMALL_RAD, 0.001 + 1e-4 * np.abs(NOISE[0])), SMALL_RAD,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", MEANINGS)
def test_the_file_says_or_physics_shows_what_is_read(tmp_path: Path, case: str) -> None:
    head, columns, values, unit, said, guessed = MEANINGS[case]
    count = [np.arange(1.0, len(TIME_S) + 1)] if head.startswith("n,") else []
    lines = zip(*count, TIME_S, *columns, strict=True)
    path = tmp_path / "a.csv"
    path.write_text(f"{head}\n" + "".join(",".join(f"{x:.9f}" for x in r) + "\n" for r in lines))
    recording = read(path)
    assert recording.unit == unit
    # What is seen from a pivot has the noise of the positions.
    atol = 0.02 if "circle" in said or "(0, 0)" in said else 1e-6
    np.testing.assert_allclose(recording.values, values, atol=atol)
    assert said in " ".join((*recording.notes, *recording.weak_guesses))
    assert any("--unit" in guess for guess in recording.weak_guesses) == guessed


@pytest.mark.parametrize("size", [0.01, 3.0, 22.3, 200.0, 1013.0])
@pytest.mark.parametrize("name", ["theta", "position", "", "signal"])
def test_no_size_and_no_step_tells_a_unit(tmp_path: Path, size: float, name: str) -> None:
    """Small swings of any size, about any level, in the steps of an encoder: in their own unit."""
    step = size * 2 * np.pi / 4096
    values = step * np.rint((size + 0.1 * size * SMALL_RAD / SMALL_RAD[0]) / step)
    path = tmp_path / "a.csv"
    lines = "".join(f"{t:.3f},{x:.9g}\n" for t, x in zip(TIME_S, values, strict=True))
    path.write_text((f"t,{name}\n" if name else "") + lines)
    assert inspect(path).unit == "1"


def test_the_first_line_says_which_option_gives_the_rest(tmp_path: Path, answer_of: Any) -> None:
    path = tmp_path / "a.csv"
    lines = zip(TIME_S, SMALL_RAD, strict=True)
    path.write_text("t,theta\n" + "".join(f"{t:.3f},{x:.9f}\n" for t, x in lines))
    first = answer_of(["inspect", str(path)]).out.splitlines()[0]
    assert first == "a guess: 'theta' has no unit: analysed in its own (--unit)"
    assert not read(path, ReadOptions(unit="rad")).weak_guesses


CLOCK_S = np.arange(400) / 50.0
CLOCKED_RAD = 0.1 * np.exp(-0.02 * CLOCK_S) * np.cos(2.0 * np.pi * 0.7 * CLOCK_S)


def written(folder: Path, time: np.ndarray, angle: np.ndarray, header: str) -> Path:
    path = folder / "swing.csv"
    rows = "\n".join(f"{t!r},{x!r}" for t, x in zip(time.tolist(), angle.tolist(), strict=True))
    path.write_text(f"{header}\n{rows}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("unit", "turn"),
    [
        *(("deg", 360.0), ("gon", 400.0), ("rev", 1.0), ("half-turns", 2.0), ("mdeg", 360e3)),
        *(("rad", 2.0 * math.pi), ("mrad", 2e3 * math.pi), ("arcmin", 21600.0), ("arcsec", 1296e3)),
    ],
)
def test_a_turn_is_two_pi_in_every_unit(tmp_path: Path, unit: str, turn: float) -> None:
    angle = CLOCKED_RAD * turn / (2.0 * math.pi)
    found = read(written(tmp_path, CLOCK_S, angle, f"time (s),angle ({unit})"))
    assert found.unit == "rad"
    np.testing.assert_allclose(found.values, CLOCKED_RAD, rtol=1e-12)


@pytest.mark.parametrize("per_second", [1, 10**3, 10**6, 10**9])
def test_a_clock_that_counts_from_a_date_is_read_in_its_own_unit(
    tmp_path: Path, per_second: int
) -> None:
    """Seconds, milliseconds, microseconds or nanoseconds since 1970: known by their size."""
    ticks = (
        1_700_000_000 * per_second + np.round(CLOCK_S * 1000).astype(np.int64) * per_second // 1000
    )
    time = ticks if per_second > 1 else 1_700_000_000.0 + CLOCK_S
    found = read(written(tmp_path, time, CLOCKED_RAD, "timestamp,angle_rad"))
    assert found.time_s[-1] - found.time_s[0] == pytest.approx(CLOCK_S[-1], abs=1e-5)


MINUTES_S, MINUTES_RAD = swing(6000, 50.0, 0.5)
RANDOM = np.random.default_rng(5)


def clocked(seconds: FloatArray, form: str) -> list[str]:
    """Times of day by the form's h, m and s."""
    return [form.format(h=int(t // 3600), m=int(t // 60) % 60, s=t % 60) for t in seconds]


def arrival(time: FloatArray) -> FloatArray:
    late: FloatArray = np.maximum.accumulate(time + RANDOM.exponential(0.1, len(time)))
    return late + 1e-6 * np.arange(len(time))


def torn(time: FloatArray) -> FloatArray:
    """A clock that counts the full second a row too late."""
    stamps = time.copy()
    stamps[49:-50:50] += 0.89
    return stamps


def set_ahead(time: FloatArray) -> FloatArray:
    """A clock that is 969.5 s ahead for some rows on end, thrice, until it is set."""
    stamps = time.copy()
    for first, rows in ((200, 11), (260, 16), (1500, 40)):
        stamps[first : first + rows] += 969.5
    return stamps


def slowing(time: FloatArray) -> FloatArray:
    return np.where(time < 100.0, np.floor(10.0 * time + 1e-9) / 10.0, time)


class Form(NamedTuple):
    """Stamps in the column `name`; how near to the truth they are read; what is said."""

    stamps: Callable[[FloatArray], list[str]]
    name: str = "t (s)"
    within_s: float = 0.002
    said: str = ""


FORMS = {
    "rounded": Form(lambda t: [f"{x:.1f}" for x in t], within_s=0.05, said="counted at 50 Hz"),
    "cut": Form(lambda t: [f"{np.floor(10 * x + 1e-9) / 10:.1f}" for x in t], within_s=0.05),
    "of three digits": Form(lambda t: [f"{x:.2E}" for x in t], within_s=0.5, said="rounded"),
    "of whole seconds": Form(lambda t: [f"{int(x + 1e-9)}" for x in t], within_s=0.5),
    "slower behind 100 s": Form(lambda t: [f"{x:.2f}" for x in slowing(t)], within_s=0.1),
    "a block of eight rows": Form(lambda t: [f"{x:.3f}" for x in np.repeat(t[7::8], 8)]),
    "newest first": Form(lambda t: [f"{x:.3f}" for x in t], said="newest row"),
    "a counter of 16 bits": Form(
        lambda t: [f"{(round(1e3 * x) + 40_000) % 2**16}" for x in t], "millis"
    ),
    "a counter of 32 bits": Form(
        lambda t: [f"{(round(1e6 * x) - 9_000_000) % 2**32}" for x in t], "micros"
    ),
    "milliseconds since 1970": Form(
        lambda t: [f"{1_700_000_000_000 + round(1e3 * x)}" for x in t], "TM", said="since 1970"
    ),
    "minutes beyond sixty": Form(lambda t: clocked(3540 + t, "{m:02d}:{s:06.3f}"), "time"),
    "times beyond midnight": Form(
        lambda t: clocked((86_370 + t) % 86_400, "{h:02d}:{m:02d}:{s:06.3f}"), "time"
    ),
    "dates beyond midnight": Form(
        lambda t: [
            f"2024-02-{28 + int(x >= 86_400)}T{of_day}"
            for x, of_day in zip(
                86_370 + t, clocked((86_370 + t) % 86_400, "{h:02d}:{m:02d}:{s:06.3f}"), strict=True
            )
        ],
        "time",
    ),
    "points in the time of day": Form(
        lambda t: clocked(54_540 + t, "10/01/2025 {h:02d}.{m:02d}.{s:06.3f}"), "time"
    ),
    "of arrival": Form(
        lambda t: [f"{x:.6f}" for x in arrival(t)], within_s=0.25, said="as of arrival"
    ),
    "one in fifty torn": Form(lambda t: [f"{x:.3f}" for x in torn(t)], said="interpolated"),
    "ahead until it is set": Form(
        lambda t: [f"{x:.3f}" for x in set_ahead(t)], said="interpolated"
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_rows_are_read_at_their_times(tmp_path: Path, form: str) -> None:
    stamps, name, within_s, said = FORMS[form]
    # Times of whole milliseconds, at which every stamp above is what the logger would write.
    rows = [f"{a},{x:.5f}\n" for a, x in zip(stamps(MINUTES_S), MINUTES_RAD, strict=True)]
    rows = rows[::-1] if form == "newest first" else rows
    path = tmp_path / "a.csv"
    path.write_text(f"{name},theta (rad)\n" + "".join(rows))
    recording = read(path)
    time_s = recording.time_s - recording.time_s[0]
    assert len(recording) == len(MINUTES_S)
    np.testing.assert_allclose(time_s, MINUTES_S, atol=within_s)
    np.testing.assert_allclose(recording.values, MINUTES_RAD, atol=1e-5)
    assert said in " ".join((*recording.notes, *recording.weak_guesses))


def test_a_wander_is_no_period_and_rows_before_a_clock_is_set_are_left_out(tmp_path: Path) -> None:
    """An hour with one decay in it: milliseconds since 1970, of which the first 70 are ahead."""
    time = np.arange(72_000) / 20.0
    yaw = np.repeat(RANDOM.normal(0.0, 20.0, 720), 100) + 90.0 * np.sin(np.pi * time / 900.0)
    pitch = np.where(time > 3000.0, np.exp(-(time - 3000.0) / 600.0), 0.0)
    pitch = 6.0 * pitch * np.sin(2.0 * np.pi * time / 1.8) + RANDOM.normal(0.0, 0.02, len(time))
    stamps = 1_492_552_800_000 + np.rint(1e3 * (time + 969.512 * (time < 3.5))).astype(np.int64)
    rows = [f"{t},{a:.2f},{x:.3f}\n" for t, a, x in zip(stamps, yaw, pitch, strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("TM,YW,PT\n" + "".join(rows[::-1]))
    recording = read(path)
    np.testing.assert_allclose(recording.time_s, time[70:] - 3.5, atol=1e-3)
    np.testing.assert_allclose(recording.values, pitch[70:], atol=1e-3)
    assert "70 row(s) at the ends left out" in " ".join(recording.notes)
    assert recording.metadata["recorded_at"] == "1492552803.500000 s since 1970"


def test_true_stamps_of_uneven_rows_stay(tmp_path: Path) -> None:
    kept = np.sort(RANDOM.choice(len(MINUTES_S), 2800, replace=False))
    lines = zip(MINUTES_S[kept], MINUTES_RAD[kept], strict=True)
    path = tmp_path / "a.csv"
    path.write_text("t (s),theta (rad)\n" + "".join(f"{t:.3f},{x:.5f}\n" for t, x in lines))
    np.testing.assert_allclose(read(path).time_s, MINUTES_S[kept], atol=1e-9)
