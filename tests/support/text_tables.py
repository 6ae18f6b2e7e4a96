"""Text tables as instruments and spreadsheets write them, and what becomes of each: read, or refused with words.

Python (test_text_tables.py) and Kotlin (test_kotlin.py) read the same ones.
"""

import json
import re
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_chart

NM = list(range(380, 731, 5))
COUNTS = [100 + 27 * (nm - 380) for nm in NM]
"""100 to 9,550, straight: the 8th is the first above 1,000."""


class Table(NamedTuple):
    """One file."""

    text: str
    words: str | None = None  # a regular expression of the refusal's message; None if it is read
    kind: str = "lamp"  # or "chart"


def english(value: float, digits: int = 0) -> str:
    return f"{value:,.{digits}f}"


def german(value: float, digits: int = 0) -> str:
    return english(value, digits).translate(str.maketrans(",.", ".,"))


def grouped(mark: str) -> list[str]:
    """The counts with a thousands separator."""
    return [english(value).replace(",", mark) for value in COUNTS]


def table(values: list[str], mark: str = ",", nm: str = "{}", head: str = "", end: str = "\n") -> str:
    return head + "".join(f"{nm.format(w)}{mark}{value}{end}" for w, value in zip(NM, values, strict=True))


PLAIN = [str(value) for value in COUNTS]
SHARES = [f"{value / 10_000:.4f}" for value in COUNTS]
COMMAS = [value.replace(".", ",") for value in SHARES]
QUOTED = [f'"{english(value)}"' for value in COUNTS]
DOUBT = r"line 8: '1[,.]045' may be a decimal number or have a thousands separator"
SEPARATOR = r"line 8: '.*' has a thousands separator"
BLOCK = table(PLAIN, head="nm,counts\n")


def third(values: Iterable[float], mark: str = ",", head: str = "") -> str:
    """The lamp with another number beside each of its own."""
    return table([f"{count}{mark}{value!r}" for count, value in zip(COUNTS, values, strict=True)], mark, head=head)


def pixels(outside: float, inside: float = 0.0) -> str:
    """A spectrometer's 2048 pixels, 339 to 1025 nm: the counts, with noise outside and inside 380 to 720 nm."""
    nm = np.linspace(339.5, 1025.0, 2048)
    sign = np.where(np.arange(2048) % 2 == 0, 1.0, -1.0)
    power = np.where((nm > 380) & (nm < 720), 5000.0 + inside * sign, outside * sign)
    return "".join(f"{a:.3f}\t{b:.2f}\n" for a, b in zip(nm, power, strict=True))


def rawtoaces(columns: tuple[str, ...] = ("power",)) -> str:
    rows = {str(nm): [float(value)] * len(columns) for nm, value in zip(NM, COUNTS, strict=True)}
    spectra = {"units": "relative", "index": {"main": list(columns)}, "data": {"main": rows}}
    return json.dumps({"header": {"schema_version": "0.1.0", "illuminant": "lamp"}, "spectral_data": spectra})


def one_row(values: list[str], rows: int = 1) -> str:
    head = ",".join(["name", "CCT", *(f"{nm}nm" for nm in NM)])
    return "\n".join([head, *[",".join(["lamp", "5503", *values])] * rows, ""])


def cgats(*rows: list[str], before: str = "", end: str = "END_DATA\n") -> str:
    """A lamp by its bands, as Argyll writes it."""
    fields = " ".join(f"SPEC_{nm}" for nm in NM)
    lines = "".join(" ".join(row) + "\n" for row in rows)
    return f"{before}BEGIN_DATA_FORMAT\n{fields}\nEND_DATA_FORMAT\nBEGIN_DATA\n{lines}{end}"


def chart(field: str = "{}", mark: str = ",", *, turned: bool = False, down: bool = False, scale: float = 1.0) -> str:
    """The Classic's table every 10 nm; `turned`: from 720 nm downwards; `down`: a column for each patch."""
    known = read_chart("classic24")
    nodes = np.arange(0, WAVELENGTHS.size, 20)[:: -1 if turned else 1]
    names = [f"{'ABCD'[i // 6]}{i % 6 + 1}" for i in range(24)]
    values: Floats = scale * known.values[:, nodes]
    lines = [["patch", *(field.format(f"{WAVELENGTHS[i]:g}") for i in nodes)]]
    lines += [[name, *(f"{v:.6f}" for v in row)] for name, row in zip(names, values, strict=True)]
    if down:
        lines = [list(line) for line in zip(*lines, strict=True)]
    return "\n".join(mark.join(line) for line in lines) + "\n"


def chart_in_cgats(field: str, mark: str, scale: float = 1.0) -> str:
    """The same with a number, a quoted name and L* before each patch's bands."""
    head, *rows = (line.partition(mark) for line in chart(field, mark, scale=scale).splitlines())
    lines = [f'{i}{mark}"{name}"{mark}50{mark}{bands}\n' for i, (name, _, bands) in enumerate(rows, 1)]
    fields = mark.join(["SAMPLE_ID", "SAMPLE_NAME", "LAB_L", head[2]])
    return (
        f'CGATS.17\nORIGINATOR "test"\nBEGIN_DATA_FORMAT\n{fields}\nEND_DATA_FORMAT\n'
        f"NUMBER_OF_SETS 24\nBEGIN_DATA\n{''.join(lines)}END_DATA\n"
    )


LAMPS = {
    # thousands separators
    "quoted": Table(table(QUOTED), DOUBT),
    "quoted, with decimals": Table(table([f'"{english(value, 1)}"' for value in COUNTS]), SEPARATOR),
    "English, tabs": Table(table(grouped(","), "\t"), DOUBT),
    "English, unquoted": Table(table(grouped(",")), "line 8 has 3 numbers, line 1 has 2"),
    "German": Table(table([german(value, 1) for value in COUNTS], ";"), SEPARATOR),
    "German, whole": Table(table(grouped("."), ";"), DOUBT),
    "German, mixed": Table(table(["9.000", *COMMAS[1:]], ";"), r"line 1: '9\.000' may be"),
    "Swiss": Table(table(grouped("'"), ";"), SEPARATOR),
    "blank": Table(table(grouped(" "), ";"), SEPARATOR),
    "no-break space": Table(table(grouped("\u00a0"), " "), SEPARATOR),
    "underscore": Table(table(grouped("_"), ";"), SEPARATOR),
    "one row, quoted": Table(one_row(QUOTED), "line 2: '1,045' may be"),
    # decimal commas and points
    "decimal commas": Table(table(COMMAS, ";", head="nm;W\n", end=";\n")),
    "decimal commas, three digits": Table(table([f"{value + 5000:,}" for value in COUNTS], ";")),
    "decimal commas, blanks": Table(table(COMMAS, " ", "{},0")),
    "decimal commas, Excel": Table("sep=;\n" + table(COMMAS, ";")),
    "decimal commas, unquoted": Table(table(COMMAS), "Where a comma separates the columns|no standard deviation"),
    "two decimals, unquoted": Table(table([f"{value},{nm % 10:02}" for nm, value in zip(NM, COUNTS, strict=True)]),
                                    "no standard deviation"),
    "three decimals": Table(table([f"{value:.3f}" for value in COUNTS])),
    # text around the table, and in it
    "closing marker": Table("Data from L.txt Node\nTrigger mode: 0\n>>>>>Begin Spectral Data<<<<<\n" + pixels(5.0)
                            + ">>>>>End Spectral Data<<<<<\n"),
    "noise outside": Table(pixels(400.0)),
    "noise inside": Table(pixels(0.0, 5100.0), "negative power from 380 to 720 nm"),
    "photometry behind": Table(BLOCK + "[Photometry]\nCCT,5503\nRa,98.1\nTM-30,96,101\nmeasured by hand\n"),
    "flicker behind": Table(BLOCK + "Flicker\ntime,value\n" + "".join(f"{i / 1000},{i % 7}\n" for i in range(500))),
    "flicker, long": Table(BLOCK + "ms,value\n" + "".join(f"{i},{i % 7}\n" for i in range(999)),
                           "line 73, 'ms,value', stands between two tables"),
    "comments": Table("% a remark\n// one more\n! and one\n" + table(PLAIN).replace("\n400", "\n# x\n400")),
    "remark in a line": Table(table([*PLAIN[:9], PLAIN[9] + " peak", *PLAIN[10:]]), "line 10, '425,1315 peak', is"),
    "no number": Table(table([*PLAIN[:9], "x", *PLAIN[10:]]), "line 10, '425,x', is not a wavelength and a number"),
    "units in each line": Table(table(PLAIN, end=",W\n"), "line 1: 'W' is not a number"),
    "several columns": Table(table(PLAIN, ";", head="Wave;Sample;Dark;Reference\n", end=";100;90\n"),
                             "line 2 has 4 numbers; its header, line 1, reads 'Wave;Sample;Dark;Reference'"),
    "two lamps": Table(table(PLAIN, head="nm,lamp A,lamp B\n", end=",5\n"), "line 1, reads 'nm,lamp A,lamp B'"),
    "two lamps, unnamed": Table(third(reversed(COUNTS)), "no standard deviation"),
    "a deviation": Table(third(value / 100 for value in COUNTS)),
    "a deviation, named": Table(third((value / 100 for value in COUNTS), "\t", "nm\tW/m2\tpower_sigma\n")),
    "a deviation below 0": Table(third(-value / 100 for value in COUNTS), "no standard deviation"),
    "a deviation of no number": Table(third(np.nan * value for value in COUNTS), "no standard deviation"),
    "no wavelengths": Table("\n".join(PLAIN), "no line has a wavelength and a number; line 1 reads '100'"),
    # forms
    "descending": Table("".join(reversed(table(SHARES).splitlines(keepends=True)))),
    "one row": Table(one_row(PLAIN)),
    "two rows": Table(one_row(PLAIN, 2), "holds 2 spectra, from line 2 on"),
    "nm in each line": Table(table(COMMAS, ";", "{} nm", head="Peak;550\n")),
    "meter": Table(table(PLAIN, nm="Spectral Data {}[nm]", head='E [lx],"1,234"\n')),
    "meter, two tables": Table(
        "".join(f"{nm}nm\t1\n" for nm in NM[::2]) + table(PLAIN, "\t", "{}nm", head="CCT\t5503\n")
    ),
    "meter, no number": Table(table(["x", *PLAIN[1:]], nm="{}nm"), "line 1: 'x' is not a number"),
    "meter, two numbers": Table(table([f"{value},2" for value in PLAIN], nm="{}nm"), "line 1 has 2 values at 380 nm"),
    "meter, nothing": Table(table([""] * len(NM), "\t", "{}nm"), "line 1 has 0 values at 380 nm"),
    "meter, five lines": Table("".join(f"{nm}nm,1\n" for nm in NM[:5]), "line 1 reads '380nm,1'"),
    "rawtoaces": Table(rawtoaces()),
    "rawtoaces' camera": Table(rawtoaces(("R", "G", "B")), "not an illuminant of rawtoaces: its columns are r, g, b"),
    "other JSON": Table('{"wavelengths": [380], "spd": [1]}', "its keys are wavelengths, spd"),
    "a list": Table('[{"wavelength": 380, "power": 1}]', "it is a list"),
    "old Mac": Table(table(PLAIN, end="\r")),
    # units
    "micrometres": Table("".join(f"{nm / 1000:.3f},1\n" for nm in NM), "from 0.38 to 0.73, as in micrometres"),
    "ångströms": Table("".join(f"{nm}0,1\n" for nm in NM), "from 3800 to 7300, as in ångströms"),
    "wavenumbers": Table("".join(f"{1e7 / nm:.1f},1\n" for nm in NM), "as in wavenumbers"),
    "twice": Table(table(PLAIN) + "730,5\n", "do not increase: 730 is followed by 730"),
    "bands": Table(cgats(PLAIN)),
    "a surface": Table(cgats(PLAIN, before='MEAS_TYPE "REFLECTIVE"\n'), "of a surface, not of light"),
    "a film": Table(cgats(PLAIN, before='MEAS_TYPE "TRANSMISSIVE"\n'), "of a surface, not of light"),
    "cut off": Table(cgats(PLAIN, end=""), "has no END_DATA"),
    "cut off in a number": Table(cgats(PLAIN, end="")[:-3], "has no END_DATA"),
    "a band less": Table(cgats(PLAIN[1:]), "line 5: .* has 70 cells, its header, line 1, 71"),
    "bands of two lamps": Table(cgats(PLAIN, PLAIN), "holds 2 spectra"),
    "no bands": Table("BEGIN_DATA_FORMAT", "has no table of spectra"),
    # values
    "negative": Table(table(["-900", *PLAIN[1:]]), "negative"),
    "not a number": Table(table(["nan", *PLAIN[1:]]), "not a number"),
    "no power": Table(table(["0"] * len(NM)), "no power"),
    "from 420 nm": Table("".join(f"{nm},1\n" for nm in NM[8:]), "covers only 420 to 730 nm"),
    "three lines": Table("380,1\n550,1\n720,1\n", "only 3 wavelengths"),
    "nothing": Table("", "no line has a wavelength and a number"),
    "a remark alone": Table("# nothing\n", "no line has a wavelength and a number"),
}  # fmt: skip

CHARTS = {
    **{f"header {field}": (chart(field), None)
       for field in ("{}_NM", "R({})", "{}-nm", "λ={}", "{} [nm]", "SPECTRAL_NM{}")},
    "descending columns": (chart(turned=True), None),
    "descending rows": (chart(turned=True, down=True), None),
    "rows": (chart(down=True), None),
    "percent": (chart(scale=100.0), None),
    "behind a preamble": ("My instrument,v1\n\n# a note\n" + chart("R_{}"), None),
    "CGATS": (chart_in_cgats("SPECTRAL_NM{}", "\t"), None),
    "CGATS of percent": (chart_in_cgats("SPEC_{}", " ", 100.0), None),
    "German": (chart("{} nm", ";").replace(".", ","), None),
    "a short line": (chart().replace("B2,", "", 1), "line 9: .* has 35 cells, its header, line 1, 36"),
    "a remark behind": (chart() + "measured by hand\n", "line 26: .* has 1 cells"),
    "an empty cell": (re.sub("(?m)^B1,[^,]*", "B1,", chart()), "line 8: an empty cell is not a number"),
    "no number": (chart().replace("\nB1,0", "\nB1,x", 1), "line 8: 'x.*' is not a number"),
    "micrometres": (re.sub("(?m)^[3-7]", r"0.\g<0>", chart(down=True)), "from 0.38 to 0.72, as in micrometres"),
    "no table": ("hello\nworld\n", "no line has ten wavelengths.* line 1 reads 'hello'"),
}  # fmt: skip

TABLES = {f"lamp, {name}": each for name, each in LAMPS.items()} | {
    f"chart, {name}": Table(text, words, "chart") for name, (text, words) in CHARTS.items()
}
