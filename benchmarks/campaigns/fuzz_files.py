"""Kinds of cases of the fuzzer about what users give: models, tables of rows, options of commands.

See `fuzz`.
"""

import argparse
import contextlib
import functools
import io
import random
import tempfile
from pathlib import Path

import numpy as np
from fuzz_kinds import POINT, STUDIES, Damaged
from odd_values import BUILDINGS, ODD
from stability.matrix_lies import FORMATS, LIES, judge, model
from tools import GAPS, RECORDS, REFINED, SEEDS, SMALL, VARY, YIELDING_RECORDS

from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.describe import describe
from hpcsweep.commands import cli
from hpcsweep.commands.outputs import PICTURE, TABLE, kind_of
from hpcsweep.figures.options import figures
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.job.keys import every_key
from hpcsweep.job.models import ARGUMENTS
from hpcsweep.job.structures import BUILDING, ISOLATION
from hpcsweep.job.tree import parse_toml, write
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Layout, with_inputs

FEW = {"count = 4, seed = 3": "count = 2, seed = 3", "duration = 10.0": "duration = 3.0"}
FEW |= {"to = 5.0, count = 5": "to = 5.0, count = 2", "count = 11": "count = 4"}
ROWS = """
[vary]
rows = [{name = "=A", "pounding.gap" = 0.02}, {name = "b", "pounding.gap" = 0.1}]
"""
MADE = {
    **STUDIES,
    "sweep": SMALL,
    "along": GAPS,
    "vary": SMALL + VARY,
    "refined": REFINED,
    "records": RECORDS,
    "rows": RECORDS + ROWS,
    "yielding": YIELDING_RECORDS,
    "seeds": SEEDS,
    "branches": f'{SEEDS}[study]\nkind = "branches"\n[branches]\nseeds = "seeds.h5"\nsteps = 40\n',
}
"""Jobs whose results are drawn and written as tables."""
MODEL = f'[structure]\ndamping_ratio = 0.02\n[structure.model]\nfile = "{{}}"\n{POINT}'
CONTACT = '[[structure.contact]]\ndirection = "{}"\ngap = 0.1\nstiffness = 1e4\n'
KEYS = {
    "structure.stiffness_ratio": (50.0, 200),
    "structure.gap": (0.5, 1.5, 2),
    "sweep.transient_cycles": (10, 20),
    "structure.tension": (True, False),
}
"""Keys of rows of a table, and values of theirs."""
GOOD = {
    "building[0].mass": ([1.0, 1.0], [2.0, 1.0]),
    "building[0].mass[1]": (1.0, 2.0, 3.0),
    "building[0].storey_stiffness": (900.0, [900.0, 800.0]),
    "building[1].period": (0.3, 0.5),
    "pounding.gap": (0.01, 0.02, 0.05),
    "pounding.stiffness": (1e4, 2e4),
}
"""Keys of rows of a portfolio, and values of theirs."""
TEXTS = (
    *("nan", "inf", "-1", "0", "1", "2", "0.5", "1e300", "1e-300", "9" * 400, "x", "", " ", "\n"),
    *("=1+1", "\0", "\udcff", "é", "a,b", ",", "drift,x", "A:1", "all", "1e400=1", "=", "a="),
)
"""What options are given beside what they ask for."""
AT = {
    "rows": ("structure=b", "structure==A"),
    "vary": ("gap=0.5", "stiffness_ratio=100", "gap=1.5"),
}
"""Values of the keys that jobs of `MADE` vary."""
PLACES = ("A", "B", "1", "2", "A1", "B3", "A:1")
WORDS = ("drift", "acceleration", "drift,force", "outcome", "contact,drift", "storey_drift")
RIGHT = {"--what": WORDS, "--response": WORDS, "--place": PLACES, "--floor": PLACES}
FILES = ("case.h5", "other.h5")
NUMBERS = ("0.1", "0.3", "0.5", "0.9", "1", "2", "60")
NAMES = (*["a{}"] * 12, "no/a{}", "a", "a.h5", "a.toml", "a\udcff{}", "x" * 300 + "{}")
ENDS = {
    "plot": (".png", ".png", ".svg", ".pdf", ".jpg", ".PNG", ".webp"),
    "table": (".csv", ".csv", ".CSV", ".xlsx", ".parquet", ".txt"),
}


def _asked(job_text: str, folder: Path, name: str) -> str:
    """Load a job and describe it: it is refused in one line, or has a size."""
    path = folder / name
    path.write_bytes(job_text.encode(errors="surrogateescape"))
    try:
        job = load_job(path)
        said = list(describe(job))
        if Layout(with_inputs(job)).file_size() <= 0 or any("\n" in text for _, text in said):
            raise Damaged(f"{said} of {job_text}")
    except JobError as error:
        if len(str(error).splitlines()) != 1:
            raise Damaged(f"{error!r} of {job_text}") from None
        return "refused in one line"
    return "accepted, every solver starts"


def _spoiled(data: bytes, rng: random.Random) -> bytes:
    """Flip, cut out or put in bytes."""
    made = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 2, 20))):
        at, odd = rng.randrange(len(made)), rng.choice((rng.randrange(256), *b'\0\n;,."-e9 \xff'))
        size = rng.choice((0, 1, 1, 1, 2, len(made) // 3))
        made[at : at + size] = bytes([odd]) * rng.choice((0, 1, 1, 1, 300))
        made = made or bytearray(b"\0")
    return bytes(made)


def models(folder: Path, rng: random.Random) -> str:
    """Write matrices in one of ten formats, with a lie, with damaged bytes, or odd keys beside."""
    kind = rng.choice([one for one in FORMATS if one != "mat" or rng.random() < 0.2])
    seed = rng.randrange(2**32)
    if rng.random() < 0.4:
        found, said = judge(folder, kind, rng.choice((*LIES, "")), seed)
        if found == "wrong":
            raise Damaged(f"a model of {kind}, {seed}, is read wrong: {said}")
        return "refused in one line" if found == "refused" else "result equal"
    numbers = np.random.default_rng(seed)
    paths = FORMATS[kind](folder, model(numbers), "", numbers)
    table = parse_toml(MODEL + CONTACT.format("1.UX" if kind == "npz" else "1"), "job")
    table["structure"]["model"]["file"] = [path.name for path in paths]
    if rng.random() < 0.7:
        path = rng.choice(paths)
        path.write_bytes(_spoiled(path.read_bytes(), rng))
    for key in rng.sample((*ARGUMENTS, "names"), rng.choice((0, 1, 2))):
        right = {"modes": rng.randrange(-1, 9)}, ["2"], [1.0, 0.0, 0.0], [[0.0, 1.0, 0.0]], "1"
        table["structure"]["model"][key] = rng.choice((*right, *right, *ODD))
    return _asked(write(table, every_key()), folder, "case.toml")


def rows(folder: Path, rng: random.Random) -> str:
    """Write a table of rows as spreadsheets do; what is not damaged is read as it was written."""
    separator, point = rng.choice((",.", ";.", ";,", "\t."))
    keys = rng.sample(list(KEYS), rng.randrange(1, 5))
    given = [[rng.choice(KEYS[key]) for key in keys] for _ in range(rng.randrange(1, 6))]
    lines = [["name", *(f'"{key}"' if rng.random() < 0.3 else key for key in keys)]]
    for k, own in enumerate(given):
        cells = [str(one).upper() if isinstance(one, bool) else str(one) for one in own]
        lines.append([f"row {k}", *(cell.replace(".", point) for cell in cells)])
    text = rng.choice(("\n", "\r\n")).join(separator.join(line) for line in lines)
    text = rng.choice(("", "", f"sep={separator}\n")) + text + rng.choice(("", "\n", "\n;;\n"))
    data = text.encode(rng.choice(("utf-8", "utf-8-sig", "utf-16", "latin-1")))
    damaged = rng.random() < 0.6
    (folder / "rows.csv").write_bytes(_spoiled(data, rng) if damaged else data)
    job = f'{SMALL}[vary]\nrows = "rows.csv"\n'
    found = _asked(job, folder, "case.toml")
    if not damaged and len({*map(str, given)}) == len(given):
        if found == "refused in one line":
            raise Damaged(f"refused: {text!r}")
        whole = parse_toml(load_job(folder / "case.toml").text, "job")["vary"]["rows"]
        if [[row[key] for key in keys] for row in whole] != given:
            raise Damaged(f"{whole} of {text!r}")
    return found


def portfolios(folder: Path, rng: random.Random) -> str:
    """Vary keys of buildings under records, by rows and lists, with odd values and without."""
    tree = parse_toml('[study]\nkind = "records"\n' + BUILDINGS, "job")
    tree["records"] = {"synthetic": {"count": 1, "duration": 2.0}}
    known = [f"building[{rng.randrange(3)}].{key}" for key in BUILDING]
    known += [f"building[0].isolation.{key}" for key in ISOLATION]
    known += ["pounding.restitution", "records.scale.values", "pounding[0]", "name", "rows", ""]
    keys = [*rng.sample([*GOOD], rng.randrange(1, 4)), *rng.sample(known, rng.choice((0, 0, 1, 2)))]
    odd, n = rng.choice((0.0, 0.05, 0.5)), rng.choice((0, 1, 2, 2, 3))
    rows = [{key: rng.choice(GOOD.get(key, ODD)) for key in keys} for _ in range(n)]
    for row in rows:
        row |= {key: rng.choice(ODD) for key in keys if rng.random() < odd}
    tree["vary"] = {"rows": rows}
    if rng.random() < 0.2:
        tree["vary"][rng.choice(known)] = rng.choice(([0.1, 0.2], rng.choice(ODD)))
    return _asked(write(tree, every_key()), folder, "case.toml")


@functools.cache
def results(kind: str) -> tuple[bytes, str]:
    """Return the bytes of the file of one of `MADE`, and what it holds."""
    text = MADE[kind]
    for much, little in FEW.items():
        text = text.replace(much, little)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if kind == "branches":
            (folder / "seeds.h5").write_bytes(results("seeds")[0])
            text = text.replace("seeds.h5", str(folder / "seeds.h5"))
        job = parse_job(text, kind, kind, folder)
        if campaign.run(job, folder / "a.h5", Serial()):
            raise Damaged(f"the job of {kind} does not run")
        return (folder / "a.h5").read_bytes(), job.study.content


def of_options(command: str, folder: Path, rng: random.Random) -> str:
    """Draw a file, or write its table, with options of every kind: a whole output, or one line."""
    kind, place = rng.choice(list(MADE)), folder / "out"
    source, (data, _) = folder / FILES[0], results(kind)
    source.write_bytes(_spoiled(data, rng) if rng.random() < 0.1 else data)
    (folder / FILES[1]).write_bytes(results(rng.choice(list(MADE)))[0])
    line = [command, str(source), *_options(command, kind, folder, rng)]
    place.mkdir()
    output = place / rng.choice(NAMES).format(rng.choice(ENDS[command]))
    if rng.random() < 0.1:
        with contextlib.suppress(OSError):
            output.write_bytes(b"of somebody")
    before = {path: path.read_bytes() for path in place.iterdir()}
    code, told = said([*line, "-o", str(output)])
    left = {path: path.read_bytes() for path in place.iterdir()}
    new = [path for path in left if left[path] != before.get(path)]
    if code == 0 and [kind_of(path) for path in new] == [KINDS[command]]:
        return "result equal"
    lines = told.splitlines()
    refused = code == 2 and len(lines) == 1 and lines[0].startswith("hpcsweep: error: ")
    if not refused or left != before:
        raise Damaged(f"{code}, {told[-400:]!r}, {[*left]}, {kind}: {line[2:]}")
    return "refused in one line"


def _options(command: str, kind: str, folder: Path, rng: random.Random) -> list[str]:
    """Return some options of a command, most of those that go with a file, and as they ask."""
    parser, line = argparse.ArgumentParser(), []
    cli.COMMANDS[command].configure(parser)
    known = {one.option_strings[-1]: one for one in parser._actions[1:] if one.option_strings}
    fit = [flag for flag in known if flag not in ("--output", "--kind")]
    if command == "plot" and rng.random() < 0.9:
        drawn = [one for one in figures().values() if results(kind)[1] in one.draws]
        figure = rng.choice(drawn)
        line = ["--kind", figure.name]
        fit = [*(option.flag for option in figure.options), "--xlim", "--ylim", "--dpi", "--at"]
    for flag in rng.sample(fit if rng.random() < 0.95 else [*known], rng.choice((0, 1, 1, 2))):
        one = known[flag]
        is_file = one.metavar == "FILE"
        right = RIGHT.get(flag, [str(folder / name) for name in FILES] if is_file else NUMBERS)
        right = AT.get(kind, ["x=1"]) if flag == "--at" else right
        n = {None: 1, 0: 0, "+": rng.randrange(1, 4)}.get(one.nargs, one.nargs)
        texts = (one.choices or right) if rng.random() < 0.9 else TEXTS
        line += [flag, *sorted(str(rng.choice([*texts])) for _ in range(n))]
    return line


KINDS = {"plot": PICTURE, "table": TABLE}


def said(line: list[str]) -> tuple[int, str]:
    """Return the exit code of a command, and what it writes to standard error."""
    told = io.StringIO()
    with contextlib.redirect_stderr(told), contextlib.redirect_stdout(io.StringIO()):
        try:
            code = cli.main(line)
        except SystemExit as end:
            code = end.code
    return code, told.getvalue()
