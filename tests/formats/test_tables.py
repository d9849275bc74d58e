"""One swing in the tables that laboratories, loggers, phones and programs write."""

from pathlib import Path

import numpy as np
import pytest

from pendpipe.formats import ReadOptions

from .cases import ANGLE, DEGREES, RATE, TIME, Case, check, clock, each, swing, text, with_lines

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
