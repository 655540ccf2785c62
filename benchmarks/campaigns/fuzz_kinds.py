"""Kinds of cases of the fuzzer beside those of one small job: see `fuzz`."""

import contextlib
import copy
import functools
import io
import math
import os
import random
import shutil
import signal
import tempfile
import threading
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path

import numpy as np
from odd_values import ODD
from tools import ATTRACTORS, BASINS, RECORDS, REFINED, SMALL, VARY, datasets

from hpcsweep import Contact, Slider, Structure, read_record, stroboscopic_points
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.describe import describe
from hpcsweep.commands import cli
from hpcsweep.job import JobError, parse_job
from hpcsweep.job.keys import every_key
from hpcsweep.job.structures import BUILDING, ISOLATION
from hpcsweep.job.tree import write
from hpcsweep.kernels import folders
from hpcsweep.kernels.compile.cache import SUFFIX, kept_in
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import STOP_SIGNALS, StopFlag
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Lock, StoreError, is_packed, open_results, pack

SHORT = "transient_cycles = 20\nsampling_cycles = 32\n"
GRID = f"[sweep]\nomega = [0.6, 0.9]\namplitude = [0.2, 0.3, 0.5]\n{SHORT}"
POINT = f"[sweep]\nomega = 0.7\namplitude = 0.3\n{SHORT}"
ONE = "[structure]\nn_floors = 1\nstiffness_ratio = 100.0\n"
MATRICES = """
[structure]
sharpness = inf
damping_ratio = 0.02
[structure.matrices]
mass = [1.0, 2.0]
stiffness = [[1.5, -0.5], [-0.5, 1.0]]
[[structure.contact]]
direction = [1.0, -1.0]
gap = 0.1
stiffness = 50.0
"""
STUDIES = {
    "points": f'{ONE}{GRID}[study]\nkind = "points"\n',
    "attractors": f'{ONE}{GRID}[study]\nkind = "attractors"\nstarts = 8\n',
    "basins": f"""{ONE}{POINT}[study]
kind = "basins"
starts = 8
horizontal = {{from = -1.0, to = 1.0, count = 6}}
vertical = {{from = -1.0, to = 1.0, count = 5}}
""",
    "matrices": f"{MATRICES}{GRID}",
}
"""Jobs whose files are damaged, by kind."""
SESSIONS = {
    "sweep": SMALL.replace("count = 4", "count = 2"),
    "vary": SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 3") + VARY,
    "points": f'{ONE}{GRID}[study]\nkind = "points"\n',
    "attractors": ATTRACTORS.replace("count = 6", "count = 3"),
    "basins": BASINS,
    "records": RECORDS.replace("count = 5", "count = 3"),
    "refined points": REFINED,
    "refined basins": BASINS.replace(
        "starts = 16", "starts = 16\nrefine = {levels = 2, wrong = 0.4}"
    ),
}
"""Jobs that are stopped and resumed, by kind."""
YIELDS = {
    "mass": [2.5e5, 2e5],
    "storey_stiffness": [3e8, 2e8],
    "storey_height": 3.2,
    "yield_drift": [0.016, 0.012],
    "hardening": 0.03,
}
WEIGHED = {"p_delta": True, "weight": 2.4e6, "collapse_drift": 0.3}
BEARINGS = {"slab_mass": 3e5, "radius": 2.2, "friction": 0.06, "gap": 0.1, "wall_stiffness": 2e9}
BY_MATRICES = {
    "matrices": {"mass": [2e4, 1e4], "stiffness": [[8e6, -3e6], [-3e6, 3e6]]},
    "contact": [{"direction": [0.0, 1.0], "gap": 0.02, "stiffness": 1e8}],
    "slider": [
        {"direction": [1.0, 0.0], "stiffness": 2e7, "strength": 4e4},
        {"direction": [-1.0, 1.0], "stiffness": 1e7, "strength": 2e4, "name": "brace"},
    ],
}
YIELDING = (
    {
        "structure": {
            **YIELDS,
            **WEIGHED,
            "gap": 0.05,
            "stiffness_ratio": 20.0,
            "sharpness": math.inf,
        }
    },
    {"structure": BY_MATRICES},
    {"building": [{**YIELDS, **WEIGHED}]},
    {"building": [{**YIELDS, "isolation": BEARINGS}]},
    {
        "building": [YIELDS, {**YIELDS, **WEIGHED, "isolation": BEARINGS}],
        "pounding": {"gap": 0.02, "stiffness": 2e9, "restitution": 0.6},
    },
)
"""Structures that yield, of which keys are changed."""
MORE_KEYS = {
    "structure": tuple(YIELDS) + tuple(WEIGHED) + ("yield_force", "slider", "rayleigh"),
    "building": BUILDING,
    "isolation": ISOLATION,
    "slider": tuple(field.name for field in fields(Slider)),
}
UNITS = {"length": "m", "mass": "kg", "time": "s"}
SHAKEN = {
    "study": {"kind": "records"},
    "units": UNITS,
    "records": {
        "synthetic": {"count": 1, "seed": 3, "dt": 0.02, "duration": 4.0},
        "scale": {"values": [0.5, 4.0]},
    },
    "output": {"energy": True},
}
SWEPT = {
    "units": UNITS,
    "sweep": {"omega": 20.0, "amplitude": [1e4, 1e6], "transient_cycles": 10},
}
SWEPT["sweep"] |= {"sampling_cycles": 32, "classify_cycles": 100}
SHARE_RUN = 1 / 30
"""Of jobs of what yields that are run, of those that are accepted."""
LONGEST_RUN = 3.0 + campaign.STOP_MARGIN
"""Seconds after which they are stopped in good order."""
MAX_SESSIONS = 25
"""Sessions from which on nothing stops a campaign any more."""
WRITERS = ("plot", "explore", "animate")


class Damaged(AssertionError):
    """Something was lost, or is not what it was."""


def study_file(kind: str, folder: Path) -> Path:
    """Make the file of one of `STUDIES`."""
    path = folder / f"{kind}.h5"
    if not path.exists() and campaign.run(parse_job(STUDIES[kind], kind, kind), path, Serial()):
        raise Damaged(f"the job of {kind} does not run")
    return path


def kernel(folder: Path, rng: random.Random) -> str:
    """Damage a copy of a file of the kernel cache: it counts as not there."""
    kept = sorted(path for root in kept_in() for path in root.rglob(f"*{SUFFIX}"))
    source = rng.choice(kept)
    content, copy = folders.read_verified(source), folder / f"copy{SUFFIX}"
    if content is None:
        raise Damaged(f"{source} does not hold")
    data = bytearray(source.read_bytes())
    if rng.random() < 0.2:
        data = data[: rng.randrange(len(data))]
    else:
        for _ in range(rng.choice((1, 1, 3))):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    copy.write_bytes(data)
    found = folders.read_verified(copy)
    if found is not None and found != content:
        raise Damaged("a damaged kernel is taken for sound")
    return "result equal" if found == content else "refused in one line"


def output(whole: Path, folder: Path, rng: random.Random) -> str:
    """Name a file of another kind as the output of a command: it stays as it is."""
    place = folder / "outputs"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    names = [f"a{suffix}" for suffix in (".h5", ".toml", ".h5.journal", ".txt")]
    contents = [
        whole.read_bytes(),
        b"[sweep]\n",
        Path(f"{whole}.journal").read_bytes(),
        bytes(rng.randrange(1, 256) for _ in range(rng.randrange(1, 40))),
    ]
    at = rng.randrange(4)
    target = place / names[at]
    target.write_bytes(contents[at])
    named = target
    if rng.random() < 0.5:
        named = place / rng.choice(("link.png", "link.html", "link.mp4"))
        if rng.random() < 0.5:
            named.symlink_to(target)
        else:
            named.hardlink_to(target)
    command = rng.choice(WRITERS)
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            code = cli.main([command, str(whole), "-o", str(named)])
        except SystemExit as end:
            code = end.code
    if target.read_bytes() != contents[at]:
        raise Damaged(f"{command} -o {named.name} has written over {target.name}")
    if code != 2 or len(said.getvalue().splitlines()) != 1:
        raise Damaged(f"{command} -o {named.name}: {code}, {said.getvalue()!r}")
    return "refused in one line"


def link(whole: Path, folder: Path, rng: random.Random) -> str:
    """Read, lock or pack a file through links to it."""
    path, first = folder / "linked.h5", folder / "first.h5"
    for name in (path, first, Path(f"{path}.journal")):
        name.unlink(missing_ok=True)
    shutil.copy(whole, path)
    first.symlink_to(path if rng.random() < 0.5 else path.name)
    expected = open_results(path)
    if Lock(first).path != Lock(path).path:
        raise Damaged("a link has a lock of its own")
    if not open_results(first).identical(expected):
        raise Damaged("a link gives other results")
    if rng.random() < 0.3:
        pack(first)
        if not (first.is_symlink() and is_packed(path)):
            raise Damaged("pack does not pack the file of a link")
        if not open_results(first).identical(expected):
            raise Damaged("the packed file gives other results")
        return "result equal"
    with contextlib.suppress(StoreError):
        pack(path, first)
        raise Damaged("pack writes over a link")
    return "result equal"


def threads(rng: random.Random) -> str:
    """Ask for motions of any structure in four threads: each is what one thread gives."""
    chosen = np.random.default_rng(rng.randrange(2**32))
    n = int(chosen.integers(1, 5))
    contacts = [
        Contact(tuple(chosen.normal(size=n)), float(chosen.choice([0.0, 0.3, 1.0])), 50.0)
        for _ in range(int(chosen.integers(0, 4)))
    ]
    structure = Structure.from_matrices(
        10 ** chosen.uniform(-1, 1, n),
        np.diag(10 ** chosen.uniform(0, 1, n)),
        contacts,
        damping_ratio=0.05,
        sharpness=float(chosen.choice([1e3, np.inf])),
    )
    states = chosen.normal(size=(4, 2 * n)) * 10.0 ** chosen.integers(-6, 2)
    amplitude = float(10 ** chosen.uniform(-8, 1))

    def points(state) -> bytes:
        try:
            return stroboscopic_points(structure, amplitude, 0.9, state, 12).tobytes()
        except ArithmeticError as error:
            return str(error).encode()

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(points, states))
    if together != [points(state) for state in states]:
        raise Damaged("threads give other results")
    return "result equal"


SIZES = {
    "g": (9.80665, ("g", "G", "G'S", "g's")),
    "%g": (0.0980665, ("%g", "% g", "percent of g", "%G")),
    "mg": (0.00980665, ("mg", "milli-g", "milli g")),
    "m/s2": (1.0, ("m/s2", "m/s^2", "m/s/s", "m.s-2", "m s-2", "m/s**2", "m/s²", "M/SEC/SEC")),
    "cm/s2": (0.01, ("cm/s2", "CM/SEC/SEC", "gal", "Gal", "cm s^-2", "cm/sec^2", "cm/s/s")),
    "mm/s2": (0.001, ("mm/s2", "mm/s/s", "mm.s-2", "mm per second squared")),
    "in/s2": (0.0254, ("in/s2", "IN/SEC/SEC", "inch/s^2")),
    "ft/s2": (0.3048, ("ft/s2", "FT/SEC2", "feet/s/s")),
}
"""Units of records in m/s^2, and their spellings."""
NO_UNITS = ("counts", "V", "furlong/s2", "cm/s", "cm", "mm/s", "bananas", "m/s3", "km/fortnight")
NAMING = (
    *("Acceleration in {}", "Acceleration time series in {}", "IN UNITS OF {}", "UNITS: {}"),
    *("The units are ({})", "acc ({})", "Acceleration ({})", "Accelaration time history [{}]"),
)
SAYING = (
    *("NPTS= {n}, DT= {dt} SEC", "NDATA: {n}\nSAMPLING_INTERVAL_S: {dt}", "{n} {dt} NPTS, DT"),
    "Number of Data : {n}\nTime Increment (s) : {dt}",
    " {n} points of accel data equally spaced at {dt} sec",
    "Number of points: {n}\nSampling rate (Hz): {hertz:g}",
    "Sampling interval (ms): {ms:g}\nNumber of samples = {n}",
)
TITLES = (
    *(
        "A RECORD",
        "PGA (g): 0.35",
        "Max. acc. 12.1 cm/s2",
        "PLANT UNIT 2, BASEMENT",
        "Vs30 (m/s): 300",
    ),
    *("Vs30 (m/s): 300", "Peak velocity 5 cm/s"),
    *("A house (Tokyo), component N-S", "Epicentral distance (km): 12"),
    *("EL CENTRO, 5/19/1940", "# made by hand", "Depth: 5 km", "DATA_TYPE: ACCELERATION", "-----"),
)


def ground_motion(folder: Path, rng: random.Random) -> str:
    """Write a record under a header of many words, and perhaps damage it: its values, or a line."""
    unit = rng.choice(list(SIZES))
    dt, n = rng.choice((0.005, 0.01, 0.02, 0.025, 1 / 128)), rng.randrange(4, 40)
    values = [round(rng.uniform(-1, 1), 4) for _ in range(n)]
    named = rng.choice(SIZES[unit][1]) if rng.random() < 0.8 else ""
    header = rng.sample(TITLES, rng.randrange(4))
    said = rng.random() < 0.6
    layout = rng.choice(("times", "ms", "one", *(("single", "many") if said else ())))
    damage = rng.choice(("", "", "", "unit", "asked", "short", "step", "word", "kind", "known"))
    wrong = damage in ("asked", "unit", "kind") and bool(named)
    if wrong and damage != "asked":
        named = "cm/s" if damage == "kind" else rng.choice(NO_UNITS)
    if said:
        told = 2 * dt if damage == "step" else dt
        line = rng.choice(SAYING).format(n=n, dt=repr(told), hertz=1 / told, ms=1000 * told)
        if dt == 1 / 128 or not named:
            line = (
                line.replace("NPTS", "NDATA")
                if "NPTS, DT" not in line
                else SAYING[1].format(n=n, dt=repr(told))
            )
        header.append(line)
        wrong |= damage == "step" and layout in ("times", "single", "ms")
    in_columns = layout in ("times", "ms") and (layout == "ms" or rng.random() < 0.5)
    if named and not in_columns:
        header.insert(rng.randrange(len(header) + 1), rng.choice(NAMING).format(named))
    if in_columns:
        time = "ms" if layout == "ms" else "s"
        header.append(f"t ({time})" + rng.choice((", ", ";", "  ")) + f"a ({named or 'N-S'})")
    start = rng.choice((0.0, 0.0, 10.0, 225.0))
    times = [start + dt * j for j in range(n)]
    if layout == "single":
        times = [float(np.float32(time)) for time in times]
    cells = [f"{value:10.5f}" for value in values]
    if layout in ("times", "single", "ms"):
        scale = 1000 if layout == "ms" else 1
        cells = [f"{scale * t:12.7f}{cell}" for t, cell in zip(times, cells, strict=True)]
    per_line = rng.choice((1, 3, 5, 8)) if layout == "many" else 1
    rows = ["".join(cells[j : j + per_line]) for j in range(0, n, per_line)]
    if damage == "short":
        del rows[rng.randrange(1, len(rows)) if len(rows) > 1 else 0]
        wrong |= said or layout in ("times", "ms")
        # the last time is not missed where nobody says how many there are
        wrong &= said
    if damage == "word":
        at = rng.randrange(len(rows))
        rows[at] = rows[at][:-3] + rng.choice(("*****", "x", "NaN", "0.1x"))
        wrong = True
    ends = rng.choice(((), ("*** End Data ***",), ("\x1a",), ("", "")))
    text = "\n".join((*header, *rows, *ends))
    if rng.random() < 0.3:
        text = text.replace("\n", "\r\n")
    path = folder / "record.txt"
    path.write_bytes(text.encode(rng.choice(("utf-8", "latin-1", "utf-16", "utf-8-sig"))))
    asked = (
        rng.choice([one for one in SIZES if one != unit]) if damage == "asked" and named else unit
    )
    known = 3 * dt if damage == "known" else dt if layout == "one" or rng.random() < 0.3 else None
    wrong |= damage == "known" and (said or layout in ("times", "ms"))
    if damage == "known" and not wrong:
        known = dt
    wrong |= damage == "step" and said and known is not None
    dt = 2 * dt if damage == "step" and said else dt
    gravity = rng.choice((9.81, 9.80665))
    try:
        record = read_record(path, unit=asked, gravity=gravity, dt=known)
    except ValueError as error:
        if "\n" in str(error):
            raise Damaged(f"{error!r} is not one line") from None
        if not (wrong or damage == "short"):
            raise Damaged(f"{error} for {text!r}") from None
        return "refused in one line"
    in_g = unit in ("g", "%g", "mg")
    expected = np.array(values) * SIZES[unit][0] * (gravity / 9.80665 if in_g else 1.0)
    if wrong or (
        damage != "short"
        and (record.dt != dt or not np.allclose(record.acceleration, expected, rtol=1e-12, atol=0))
    ):
        raise Damaged(f"{record} in {asked} of {text!r}")
    return "result equal"


@functools.cache
def uninterrupted(kind: str) -> dict[str, np.ndarray]:
    """Return the results of one of `SESSIONS`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "whole.h5"
        if campaign.run(parse_job(SESSIONS[kind], "job", "job"), path, Serial()):
            raise Damaged(f"the job of {kind} does not run")
        return datasets(path)


class AtLook(StopFlag):
    """Is set from a look on."""

    def __init__(self, look: int):
        super().__init__()
        self._left = look

    def is_set(self) -> bool:
        self._left -= 1
        return self._left < 0 or super().is_set()


def session(folder: Path, rng: random.Random) -> str:
    """Stop a campaign by signals, time limits and at looks, and resume it until it is complete."""
    kind = rng.choice(list(SESSIONS))
    expected, path = uninterrupted(kind), folder / "case.h5"
    job = parse_job(SESSIONS[kind], "job", "job")
    for turn in range(MAX_SESSIONS + 1):
        how = rng.choice(("signal", "limit", "look")) if turn < MAX_SESSIONS else ""
        flag = AtLook(int(10 ** rng.uniform(0, 3))) if how == "look" else StopFlag()
        hours = rng.uniform(0.0, 0.3) / 3600 if how == "limit" else None
        number = rng.choice(STOP_SIGNALS)
        timer = threading.Timer(rng.uniform(0.0, 0.3), os.kill, (os.getpid(), number))
        # a signal before or after the flag listens does nothing, but SIGHUP ignored stays so
        before = {stop: signal.signal(stop, lambda *_: None) for stop in STOP_SIGNALS}
        try:
            with flag:
                if how == "signal":
                    timer.start()
                try:
                    code = campaign.run(job, path, Serial(), max_hours=hours, flag=flag)
                except SystemExit as end:  # before the first run
                    code = end.code
            timer.cancel()
            if how == "signal":
                timer.join()
        finally:
            for stop, handler in before.items():
                signal.signal(stop, handler)
        if code not in (campaign.COMPLETE, campaign.STOPPED) or (not how and code):
            raise Damaged(f"{kind}: a session that is stopped by {how} ends with {code}")
        if code == campaign.COMPLETE:
            break
    found = datasets(path)
    other = [
        name for name, values in expected.items() if not np.array_equal(found.get(name), values)
    ]
    if other or found.keys() != expected.keys():
        raise Damaged(f"{kind}: stopped {turn} times it has other {other}")
    return "result equal"


def values_of(rng: random.Random) -> str:
    """Write numbers of a frequency or an amplitude, in one of the ways that jobs have."""

    def number() -> str:
        usual = f"{rng.uniform(0, 2):.{rng.randrange(1, 17)}f}", str(rng.randrange(-2, 30))
        odd = (
            f"{10 ** rng.uniform(-20, 20):.3e}",
            "inf",
            "nan",
            "0.0",
            "-0.0",
            "1e308",
            "true",
            "'a'",
        )
        return rng.choice(usual if rng.random() < 0.8 else odd)

    how = rng.choice(("number", "list", "range", "range", "range"))
    if how == "number":
        return number()
    if how == "list":
        return f"[{', '.join(number() for _ in range(rng.randrange(6)))}]"
    parts = {"from": number(), "to": number()}
    for key in rng.sample(("count", "step"), rng.choice((1, 1, 1, 1, 0, 2))):
        parts[key] = str(rng.randrange(-1, 200)) if rng.random() < 0.6 else number()
    if rng.random() < 0.05:
        parts[rng.choice(("until", "By", "counts"))] = number()
    if rng.random() < 0.05:
        del parts[rng.choice(("from", "to"))]
    return "{" + ", ".join(f"{key} = {value}" for key, value in parts.items()) + "}"


def ranges(rng: random.Random) -> str:
    """Give frequencies and amplitudes: they are refused in one line, or are what is written."""
    omega, amplitude = values_of(rng), values_of(rng)
    try:
        study = parse_job(
            f"[sweep]\nomega = {omega}\namplitude = {amplitude}\n", "job", "job"
        ).study
    except JobError as error:
        if len(str(error).splitlines()) != 1 or "sweep." not in str(error):
            raise Damaged(f"omega = {omega}, amplitude = {amplitude}: {error}") from None
        return "refused in one line"
    for text, found in ((omega, study.omega), (amplitude, study.amplitude)):
        given = tomllib.loads(f"x = {text}")["x"]
        if isinstance(given, dict):
            low, high = float(given["from"]), float(given["to"])
            step = given.get("step", (high - low) / (given.get("count", 2) - 1))
            right = found[0] == low and np.allclose(np.diff(found), step, rtol=1e-6)
            right &= bool(high - step * (1 + 1e-9) < found[-1] <= high * (1 + 1e-12))
            right &= found.size == given.get("count", found.size)
        else:
            right = np.array_equal(found, np.ravel(np.array(given, float)))
        if not right or not np.isfinite(found).all():
            raise Damaged(f"{text} is read as {found}")
    return "accepted, every solver starts"


def yielding(folder: Path, rng: random.Random) -> str:
    """Change keys of a structure that yields: it is refused in one line, or energies balance."""
    tree = copy.deepcopy(rng.choice(YIELDING) | rng.choice((SHAKEN, SWEPT)))
    if rng.random() < 0.1:
        tree["study"] = {"kind": rng.choice(("points", "attractors", "basins", "records"))}
    for _ in range(rng.choice((0, 1, 1, 2, 4))):
        _changed(tree, rng)
    text = write(tree, every_key())
    try:
        job = parse_job(text, "case.toml", "case")
        said = list(describe(job))
    except JobError as error:
        if len(str(error).splitlines()) != 1 or not str(error).startswith("case.toml: "):
            raise Damaged(f"{error!r} of {text}") from None
        return "refused in one line"
    if any("\n" in words for _, words in said):
        raise Damaged(f"{said} of {text}")
    path = folder / "case.h5"
    if rng.random() < SHARE_RUN:
        code = campaign.run(job, path, Serial(), max_hours=LONGEST_RUN / 3600)
        if code == campaign.STOPPED:  # a slab of grams on bearings for tonnes is followed closely
            return "ended in one line"
        if code != campaign.COMPLETE:
            raise Damaged(f"{code} of {text}")
        with open_results(path) as results:
            _check_motions(results, job.structure, text)
    return "accepted, every solver starts"


def _check_motions(results, structure, text: str) -> None:
    """Look for what no motion of sliders does."""
    good = results["outcome"].values == Outcome.COMPLETE
    if not structure.sliders or not good.any():
        return
    worst = 0.0
    if "energies" in results:
        found = results["energies"].values[good]
        worst = np.max(np.abs(found[:, 0] - found[:, 1:].sum(axis=1)) / np.abs(found).max(axis=1))
    if "slider_force" in results:
        strength = np.array([one.strength for one in structure.sliders])
        over = (results["slider_force"].values[good] / strength).max() - 1.0
        worst = max(worst, over)
    if not worst < 1e-8 or not np.isfinite(results["ductility"].values[good]).all():
        raise Damaged(f"a balance that is off by {worst:g} of {text}")


def _changed(tree: dict, rng: random.Random) -> None:
    """Change a value of a structure: its size, its sign, its kind; or take it away, or add one."""
    found = [one for one in _tables("", tree) if one[1]]
    _, table = rng.choice(found)
    key = rng.choice(list(table) if isinstance(table, dict) else range(len(table)))
    how = rng.choice((*("size",) * 8, "sign", "odd", "gone", "again", "more", "more"))
    value = table[key]
    if how == "more":
        for name, below in rng.sample(found, len(found)):
            if name in MORE_KEYS and isinstance(below, dict):
                added = 10 ** rng.uniform(-3, 8), rng.choice(ODD)
                below[rng.choice(MORE_KEYS[name])] = rng.choice(added)
                break
    elif how == "gone":
        del table[key]
    elif how == "again":
        table[key] = [copy.deepcopy(value)] * rng.choice((1, 2, 3))
    elif how == "odd":
        table[key] = rng.choice(ODD)
    elif isinstance(value, int | float) and abs(value) < 1e300:
        table[key] = -value if how == "sign" else value * 10 ** rng.uniform(-2, 2)


def _tables(name: str, below) -> list[tuple[str, dict | list]]:
    """Return all tables and lists in a tree, with the keys of each."""
    found = [(name, below)]
    for key, value in below.items() if isinstance(below, dict) else enumerate(below):
        if isinstance(value, dict | list):
            found += _tables(key if isinstance(below, dict) else name, value)
    return found
