"""Try what a failing disk and a hostile user do: fuzz.py --cases N --seed S --kind K --json.

Each case damages one thing at random (bytes of a results file, its journal, a job's text, the
moment at which a file goes away, the environment of a command) and asks all that read it. It must
end in one of the `ALLOWED` ways. What else happens, an exception that is no line for the user, a
wrong number, more than `MAX_SECONDS` or `MAX_BYTES`, is counted as `OTHERWISE` and reported with
the seed that does it again.
"""

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import string
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import ClassVar

import fuzz_files
import fuzz_kinds
import h5py
import numpy as np
from stability import watchdog
from tools import SMALL, command, datasets, environment, shipped

from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.status import status
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import (
    Layout,
    StoreError,
    WriteError,
    open_layout,
    open_results,
    pack,
    with_inputs,
)
from hpcsweep.store.commit import Blocks
from hpcsweep.store.rows import Offsets
from hpcsweep.studies.blocks import Block
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import Study

ALLOWED = (
    "result equal",
    "result equal, damaged blocks missing",
    "refused in one line",
    "accepted, every solver starts",
    "ended in one line",
)
OTHERWISE = "otherwise"
FOLDER = "HPCSWEEP_FUZZ_FOLDER"
MAX_SECONDS = 20.0
"""Of processor time: a busy machine is not a hang."""
LONGEST_WAIT = 180.0
"""Seconds until a case counts as one that hangs, whatever it does."""
MAX_BYTES = 2**30
"""Of memory that a case may add."""
SHARE_RUN = 0.25
"""Of damaged files that are run again too."""
READERS = ("hpcsweep.store.opening", "hpcsweep.store.frames", "hpcsweep.campaign.status")
"""Commands that call `open_layout`; `validate` and `run` check for themselves."""
WEIGHTS = {
    "metadata": 4,
    "data": 3,
    "packed": 2,
    "cut": 1,
    "journal": 4,
    "job": 8,
    "removed": 0.5,
    "environment": 0.05,
    "study": 6,
    "kernel": 2,
    "output": 2,
    "link": 1,
    "threads": 2,
    "record": 6,
    "session": 3,
    "range": 6,
    "yield": 6,
    "model": 8,
    "rows": 6,
    "portfolio": 8,
    "table": 4,
    "plot": 3,
}
"""Kinds of cases, and how often each is chosen."""


class Unexpected(AssertionError):
    """A case that ended otherwise."""


def forge(path: Path, name: str, value: int) -> None:
    """Write a value into the last run of a file under a checksum that holds."""
    from hpcsweep.store.opening import job_of

    layout = Layout(job_of(path))
    offsets = Offsets(path)
    with Blocks(path, layout) as blocks:
        block = layout.study.path(layout.study.n_tasks - 1)[-1]
        start = blocks.start_of(block, block.begin)
        rows = {key: np.array(values) for key, values in blocks.read(block).items()}
        rows[name][-1] = value
        checksum = np.array([blocks.checksum(block, start, rows)], "<u8")
    with path.open("r+b") as file:
        for key, place, values in (
            (name, block.first, rows[name]),
            ("commit", block.place, checksum),
        ):
            file.seek(offsets.at(key, place))
            file.write(values.tobytes())


def one_line(error: Exception, path: Path | None = None) -> str:
    """Make sure that an error is one line that names the file."""
    said = str(error)
    if len(said.splitlines()) != 1 or (path is not None and path.name not in said):
        raise Unexpected(f"message: {said!r}")
    return said


class Once:
    """Puts to a file's bytes once what several readers ask of them, most of a case's time."""

    def __init__(self, function: Callable):
        self._function = function
        self._bytes: bytes | None = None
        self._answer = self._refused = None

    def __call__(self, path: Path):
        try:
            found = Path(path).read_bytes()
        except OSError:
            return self._function(path)
        if found != self._bytes:
            self._bytes, self._answer, self._refused = None, None, None
            try:
                self._answer = self._function(path)
            except StoreError as error:
                error.__context__ = None  # it would keep the file's objects
                self._refused = error
            self._bytes = found
        if self._refused is not None:
            raise self._refused.with_traceback(None)
        return self._answer

    @contextlib.contextmanager
    def standing_for(self, *modules: str):
        """Take the function's place in modules that have it by its name."""
        name = self._function.__name__
        for module in modules:
            setattr(sys.modules[module], name, self)
        try:
            yield
        finally:
            for module in modules:
                setattr(sys.modules[module], name, self._function)


class Patient:
    """Files of one small job that are damaged, case by case."""

    def __init__(self, folder: Path):
        warnings.simplefilter("ignore")
        self.opened = Once(open_layout)
        self.folder = folder
        self.job = parse_job(SMALL.replace("count = 4", "count = 2"), "fuzz", "fuzz")
        self.whole = folder / "whole.h5"
        self.path = folder / "case.h5"
        if not self.whole.exists():
            if campaign.run(self.job, self.whole, Serial()) != 0:
                raise Unexpected("the undamaged job does not run")
            pack(self.whole, folder / "packed.h5")
        self.files = {
            "metadata": self.whole,
            "packed": folder / "packed.h5",
            **{kind: fuzz_kinds.study_file(kind, folder) for kind in fuzz_kinds.STUDIES},
        }
        self.bytes = {kind: path.read_bytes() for kind, path in self.files.items()}
        self.results = {kind: open_results(path) for kind, path in self.files.items()}
        self.datasets = datasets(self.whole)
        self.journal_text = Path(f"{self.whole}.journal").read_bytes()
        self.places = {"metadata": _outside(self.whole)}
        self.inside = np.setdiff1d(
            np.arange(len(self.bytes["metadata"])), self.places["metadata"]
        ).tolist()

    @cached_property
    def texts(self) -> list[str]:
        """Jobs whose text is changed."""
        return [job.text for job in shipped().values()] + [SMALL]

    # results files

    def metadata(self, rng: random.Random) -> str:
        """Flip bytes that belong to no result."""
        return self._damaged("metadata", self.places["metadata"], rng)

    def packed(self, rng: random.Random) -> str:
        """Flip bytes of a packed file, wherever."""
        return self._damaged("packed", range(len(self.bytes["packed"])), rng)

    def of_study(self, rng: random.Random) -> str:
        """Flip bytes of a file of another kind of study, wherever."""
        kind = rng.choice(list(fuzz_kinds.STUDIES))
        return self._damaged(kind, range(len(self.bytes[kind])), rng)

    def _damaged(self, kind: str, places, rng: random.Random) -> str:
        data = bytearray(self.bytes[kind])
        for _ in range(rng.choice((1, 1, 1, 4, 40))):
            data[rng.choice(places)] ^= 1 << rng.randrange(8) if rng.random() < 0.7 else 255
        self.path.write_bytes(data)
        found = self._read(self.results[kind], kind == "packed" or kind in fuzz_kinds.STUDIES)
        if kind != "metadata" or rng.random() > SHARE_RUN:
            return found
        try:
            code = campaign.run(self.job, self.path, Serial())
        except StoreError as error:
            one_line(error, self.path)
            return found
        if code != 0 or not self._same_datasets():
            raise Unexpected(f"run gave {code}, and other results")
        if self._read(self.results[kind]) != "result equal":
            raise Unexpected("run says complete on a file that cannot be opened")
        return found

    def _read(self, expected, holes: bool = False) -> str:
        """Ask every reader; they must agree."""
        answers = set()
        for reader in (open_results, status, summarize):
            try:
                found = reader(self.path)
            except StoreError as error:
                one_line(error, self.path)
                answers.add("refused")
                continue
            if reader is open_results and not found.equals(expected):
                if not (holes and _only_holes(found, expected)):
                    raise Unexpected("open_results gives other results")
                answers.add("holes")
        sound = None
        with contextlib.suppress(StoreError):
            sound = validate(self.path, samples=0).sound
        if "refused" in answers or "holes" in answers:
            if sound:
                raise Unexpected(f"validate says sound, others {answers}")
            return (
                "refused in one line"
                if "refused" in answers
                else "result equal, damaged blocks missing"
            )
        return "result equal"

    def _same_datasets(self) -> bool:
        found = datasets(self.path)
        return found.keys() == self.datasets.keys() and all(
            np.array_equal(found[name], values) for name, values in self.datasets.items()
        )

    def data(self, rng: random.Random) -> str:
        """Flip bytes of results and checksums: blocks go, no value is wrong, run restores them."""
        data = bytearray(self.bytes["metadata"])
        for _ in range(rng.choice((1, 1, 3, 100))):
            data[rng.choice(self.inside)] ^= 1 << rng.randrange(8)
        self.path.write_bytes(data)
        found = self._read(self.results["metadata"], holes=True)
        if rng.random() < SHARE_RUN:
            if campaign.run(self.job, self.path, Serial()) != 0 or not self._same_datasets():
                raise Unexpected("run does not restore the results")
            if not validate(self.path, samples=0).sound:
                raise Unexpected("not sound after run")
        return found

    def cut(self, rng: random.Random) -> str:
        """Cut a file short, or put something behind it."""
        data = self.bytes[rng.choice(("metadata", "packed"))]
        size = rng.randrange(len(data) + 100)
        self.path.write_bytes(data[:size] + rng.randbytes(max(size - len(data), 0)))
        found = self._read(self.results["metadata"])
        if size < len(data) and found != "refused in one line":
            raise Unexpected(f"a file cut short is {found}")
        return found

    # what lies beside

    def journal(self, rng: random.Random) -> str:
        """Damage the journal: no result depends on it."""
        shutil.copyfile(self.whole, self.path)
        lines = self.journal_text.splitlines()
        for _ in range(rng.choice((1, 2, 10))):
            line = rng.randrange(len(lines))
            lines[line] = rng.choice(_JOURNAL_CHANGES)(lines[line], rng)
        Path(f"{self.path}.journal").write_bytes(b"\n".join(lines))
        status(self.path)
        summarize(self.path)
        if rng.random() < SHARE_RUN:
            with h5py.File(self.path, "r+") as file:
                file["commit"][0, 1, 1] = 0
            if campaign.run(self.job, self.path, Serial()) != 0 or not self._same_datasets():
                raise Unexpected("run gives other results")
        return "result equal"

    # jobs

    def job_text(self, rng: random.Random) -> str:
        """Damage a job's text, or give a key a value of any kind."""
        text = rng.choice(self.texts)
        for _ in range(rng.choice((1, 1, 1, 3))):
            text = rng.choice(_JOB_CHANGES)(text, rng)
        path = self.folder / "case.toml"
        path.write_bytes(text.encode(errors="surrogateescape"))
        try:
            job = with_inputs(load_job(path))
        except JobError as error:
            one_line(error)
            return "refused in one line"
        study = job.study
        layout = Layout(job)
        if layout.file_size() <= 0 or not job.fingerprint:
            raise Unexpected("a job without a size")
        for task in {0, study.n_tasks - 1}:
            try:
                _start(*study.part_of(study.path(task)[0]))
            except StoreError as error:  # seeds of branches, of a file that is not there
                one_line(error)
                return "refused in one line"
        return "accepted, every solver starts"

    # moments

    def removed(self, rng: random.Random) -> str:
        """Take the file away, or shorten it, in mid-run."""
        moment, change = rng.randrange(1, 12), rng.choice(_REMOVALS)

        class Display(Silent):
            left = moment

            def advance(_, runs: int) -> None:
                Display.left -= 1
                if Display.left == 0:
                    change(self.path)

        try:
            code = campaign.run(self.job, self.path, Serial(), progress=lambda *_: Display())
        except (WriteError, StoreError) as error:
            one_line(error, self.path)
            if Path(f"{self.path}.lock").exists():
                raise Unexpected("the lock is left") from None
            return "ended in one line"
        raise Unexpected(f"run gave {code} on a file that was taken away")

    def environment(self, rng: random.Random) -> str:
        """Start a command in an odd environment."""
        shutil.copyfile(self.whole, self.path)
        names = {"closed": rng.choice(("0<&-", "1>&-", "2>&-", "0<&- 1>&- 2>&-"))}
        names["full"] = rng.choice(("1>/dev/full", "2>/dev/full"))
        how = rng.choice(tuple(names))
        what = rng.choice(("status", "run", "summary"))
        arguments = [what, str(self.path)]
        if what == "run":
            text = self.folder / "case.toml"
            text.write_text(self.job.text)
            odd = rng.choice(("plain.h5", "na\udcffme.h5", "x" * 250 + ".h5"))
            arguments = [what, str(text), "-o", str(self.folder / odd)]
        line = " ".join(map(_quoted, command(0, *arguments)))
        done = subprocess.run(
            ["/bin/sh", "-c", os.fsencode(f"{line} {names[how]}")],
            env=environment(),
            capture_output=True,
            timeout=120,
            check=False,
        )
        if done.returncode not in (0, 1, 2) or b"Traceback" in done.stderr:
            raise Unexpected(f"{line} {names[how]}: {done.returncode} {done.stderr[-300:]!r}")
        if datasets(self.path).keys() != self.datasets.keys() or not self._same_datasets():
            raise Unexpected(f"{line} {names[how]} changed the results")
        return "result equal" if done.returncode == 0 else "ended in one line"

    KINDS: ClassVar = {
        "metadata": metadata,
        "data": data,
        "packed": packed,
        "cut": cut,
        "journal": journal,
        "job": job_text,
        "removed": removed,
        "environment": environment,
        "study": of_study,
        "kernel": lambda self, rng: fuzz_kinds.kernel(self.folder, rng),
        "output": lambda self, rng: fuzz_kinds.output(self.whole, self.folder, rng),
        "link": lambda self, rng: fuzz_kinds.link(self.whole, self.folder, rng),
        "threads": lambda self, rng: fuzz_kinds.threads(rng),
        "record": lambda self, rng: fuzz_kinds.ground_motion(self.folder, rng),
        "session": lambda self, rng: fuzz_kinds.session(self.folder, rng),
        "range": lambda self, rng: fuzz_kinds.ranges(rng),
        "yield": lambda self, rng: fuzz_kinds.yielding(self.folder, rng),
        "model": lambda self, rng: fuzz_files.models(self.folder, rng),
        "rows": lambda self, rng: fuzz_files.rows(self.folder, rng),
        "portfolio": lambda self, rng: fuzz_files.portfolios(self.folder, rng),
        "table": lambda self, rng: fuzz_files.of_options("table", self.folder, rng),
        "plot": lambda self, rng: fuzz_files.of_options("plot", self.folder, rng),
    }

    def case(self, kind: str, seed: int) -> str:
        """Do one case and clean up behind it."""
        rng = random.Random(f"{kind} {seed}")
        try:
            with self.opened.standing_for(*READERS):
                return self.KINDS[kind](self, rng)
        finally:
            for path in self.folder.iterdir():
                if path.is_dir():
                    shutil.rmtree(path)
                elif path.name.partition(".")[0] not in ("whole", "packed", *fuzz_kinds.STUDIES):
                    path.unlink()


class _TimeIsUp(Exception):
    """A run that has started."""


def _until(deadline: float) -> None:
    if time.monotonic() > deadline:
        raise _TimeIsUp


def _start(part: Study, block: Block) -> None:
    """Start runs of a part of a study: in its first and last frames, or those of a block."""
    if not isinstance(part, RunGrid):
        with contextlib.suppress(_TimeIsUp):
            part.compute(block, part.initial_state, partial(_until, time.monotonic() + 0.1))
        return
    settings = replace(part.settings, transient_cycles=0, sampling_cycles=1, max_points=None)
    quick = replace(part, settings=settings)
    for frame in {int(part.frames.argmax()), int(part.frames.argmin())}:
        poll = partial(_until, time.monotonic() + 0.1)
        for place in {0, len(part.amplitudes_of(frame)) - 1}:
            with contextlib.suppress(_TimeIsUp):
                quick.runs_at(frame, np.array([place]), part.initial_state, poll)


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def _outside(path: Path) -> list[int]:
    """Return the bytes of a file that belong to no variable of its runs."""
    inside = np.zeros(path.stat().st_size, bool)
    with h5py.File(path, "r") as file:
        for data in file.values():
            if data.ndim > 2:
                first = data.id.get_offset()
                inside[first : first + data.id.get_storage_size()] = True
    return np.flatnonzero(~inside).tolist()


def _only_holes(found, expected) -> bool:
    """Return whether all results are equal but for runs that are said to be missing."""
    missing = found["outcome"].values == 0
    for name, values in expected.data_vars.items():
        if name == "commit":
            continue
        left, right = found[name].values, values.values
        if left.shape[:3] == missing.shape:
            left, right = left[~missing], right[~missing]
        if left.tobytes() != right.tobytes():
            return False
    return True


def _flip_text(line: bytes, rng: random.Random) -> bytes:
    data = bytearray(line or b" ")
    data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


ODD_VALUES = (
    *("1e400", "-1", "0", "NaN", "Infinity", "[]", "{}", "null", "true", '"x"', "[[1]]"),
    *("9" * 400, "1e308", "-1e308", "0.5", "9223372036854775808", '"\\u0000"', "5e-324"),
)


def _odd_record(line: bytes, rng: random.Random) -> bytes:
    try:
        record = json.loads(line)
        key = rng.choice(list(record.keys()))
    except (AttributeError, ValueError, IndexError, TypeError, RecursionError):
        return b"{}"
    text = json.dumps({**record, key: "@"})
    return text.replace('"@"', rng.choice(ODD_VALUES)).encode()


_JOURNAL_CHANGES = (
    _flip_text,
    _odd_record,
    _odd_record,
    lambda line, rng: line[: rng.randrange(len(line) + 1)],
    lambda line, rng: rng.randbytes(rng.randrange(60)),
    lambda line, rng: b"[" * 5000,
    lambda line, rng: rng.choice((b"7", b"[1]", b'"x"', b"null", b"9" * 5000)),
)

KEYS = (
    *("structure.n_floors", "structure.stiffness_ratio", "structure.sharpness"),
    *("structure.damping_ratio", "sweep.omega", "sweep.amplitude", "sweep.directions"),
    *("sweep.transient_cycles", "sweep.sampling_cycles", "sweep.max_orbit_period"),
    *("sweep.period_tolerance", "sweep.initial_state", "solver.method", "solver.rtol"),
    *("solver.skip", "output.poincare", "output.max_points", "output.block", "study.kind"),
    *("study.points", "name", "extends"),
)
ODD_TOML = (
    *("-1", "0", "1", "nan", "inf", "-inf", "[]", "{}", "true", '"x"', "[[1, 2]]", '[["up"]]'),
    *("9" * 400, "9" * 5000, "0x" + "f" * 5000, "1e308", "-1e308", "5e-324", "1e-300", "1e300"),
    *("9223372036854775808", '"\\u0000"', "1979-05-27", "[" * 5000, '"' + "n" * 300 + '"', "1e12"),
    *("{from = 1e-300, to = 1e300, count = 3}", "{from = 1, to = 2, step = 1e-300}"),
    *("{from = 0.1, to = 0.2, count = 10000000}", "[1e-308, 1e308]", "10000000", "64", '"bdf"'),
    *('"points"', '"flow"', "[0.1, 0.2]", "0.3", "1e-12", "1e17", '"rest"', '"../x"', '"none"'),
    *("{from = -1e308, to = 1e308, count = 5}", "[1, [2]]", '"a' + "b" * 20000 + '"', "1_000"),
)


def _odd_value(text: str, rng: random.Random) -> str:
    return _with(text, rng.choice(KEYS), rng.choice(ODD_TOML))


def _extreme(text: str, rng: random.Random) -> str:
    """Return numbers of every size that the check may let pass to the solvers."""
    size = rng.choice((2, 12, 100, 308))
    numbers = [repr(10 ** rng.uniform(-size, size)) for _ in range(2)]
    for key, value in (
        ("structure.stiffness_ratio", numbers[0]),
        ("structure.sharpness", rng.choice((numbers[0], "inf"))),
        ("structure.damping_ratio", numbers[0]),
        ("sweep.omega", numbers[0]),
        ("sweep.omega", f"[{numbers[0]}, {numbers[1]}]"),
        ("sweep.amplitude", numbers[0]),
        ("sweep.period_tolerance", numbers[0]),
        ("structure.n_floors", str(rng.randint(1, 64))),
        ("solver.method", rng.choice(('"bdf"', '"flow"'))),
    ):
        if rng.random() < 0.25:
            text = _with(text, key, value)
    return text


def _with(text: str, key: str, value: str) -> str:
    table, _, name = key.rpartition(".")
    lines = text.splitlines()
    for place, line in enumerate(lines):
        if line.split("=")[0].strip() == name:
            lines[place] = f"{name} = {value}"
            return "\n".join(lines)
    header = f"[{table}]"
    if not table:
        return f"{name} = {value}\n{text}"
    if header in lines:
        lines.insert(lines.index(header) + 1, f"{name} = {value}")
        return "\n".join(lines)
    return f"{text}\n{header}\n{name} = {value}\n"


def _flip_char(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    char = rng.choice(("\0", "\udcff", "[", "]", "=", '"', "\n", "9", rng.choice(string.printable)))
    return text[:at] + char + text[at + rng.randrange(2) :]


def _drop_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines() or [""]
    del lines[rng.randrange(len(lines))]
    return "\n".join(lines)


_JOB_CHANGES = (
    _odd_value,
    _odd_value,
    _extreme,
    _extreme,
    _extreme,
    _extreme,
    _flip_char,
    _flip_char,
    _drop_line,
    lambda text, rng: text + "\n" + "k" * rng.choice((10, 20000)) + " = 1\n",
    lambda text, rng: "a." * rng.choice((3, 3000)) + "b = 1\n" + text,
    lambda text, rng: text[: rng.randrange(len(text) + 1)],
)


def _cut_in_use(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def _replace(path: Path) -> None:
    path.rename(f"{path}.old")
    path.write_bytes(b"of somebody else")


_REMOVALS = (Path.unlink, lambda path: path.rename(f"{path}.old"), _replace, _cut_in_use)


class _Server:
    """Does cases in a process of its own; see `watchdog.each`."""

    patient: Patient | None = None
    before = 0


def serve(item: tuple[str, int] | None) -> tuple[str, str] | None:
    """Do one case; (outcome, what happened)."""
    if item is None:
        _Server.patient = Patient(Path(tempfile.mkdtemp(dir=os.environ[FOLDER])))
        _Server.before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return None
    assert _Server.patient is not None
    begun = time.process_time()
    try:
        outcome = _Server.patient.case(*item)
    except Exception as error:
        return OTHERWISE, f"{type(error).__name__}: {error}"[:400]
    if (taken := time.process_time() - begun) > MAX_SECONDS:
        return OTHERWISE, f"no answer in {taken:.3g} s of processor time"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    grown, _Server.before = 1024 * (peak - _Server.before), peak
    if grown > MAX_BYTES:
        return OTHERWISE, f"{grown / 1e9:.3g} GB of memory"
    return (outcome, "") if outcome in ALLOWED else (OTHERWISE, outcome)


def fuzz(cases: int, seed: int, kinds: list[str]) -> tuple[dict[str, Counter], list[str]]:
    """Do cases; outcomes by kind, and what ended otherwise. Ctrl-C ends it with what is known."""
    rng = random.Random(seed)
    weights = [WEIGHTS[kind] for kind in kinds]
    items = [(kind, seed + n) for n, kind in enumerate(rng.choices(kinds, weights, k=cases))]
    table: dict[str, Counter] = {kind: Counter() for kind in kinds}
    reported = []
    # in memory, where there is a file system of that kind: nobody pulls its plug
    base = Path("/dev/shm") if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="fuzz", dir=base) as folder:
        os.environ[FOLDER] = folder
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command has it
        try:
            answers = watchdog.each(serve, items, lambda item: LONGEST_WAIT)
            for done, (item, answer) in enumerate(answers, 1):
                lost = isinstance(answer, watchdog.Lost)
                outcome, what = (OTHERWISE, answer.reason) if lost else answer
                table[item[0]][outcome] += 1
                if outcome == OTHERWISE:
                    reported.append(f"{item[0]!r}, seed {item[1]}: {what}")
                    print(reported[-1], file=sys.stderr, flush=True)
                if done % 100 == 0:
                    print(f"{done} of {cases}", file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            print("stopped; so far:", file=sys.stderr)
    return table, reported


def as_text(table: dict[str, Counter]) -> str:
    """Write kinds x outcomes."""
    columns = (*ALLOWED, OTHERWISE)
    lines = ["| | cases | " + " | ".join(columns) + " |", "|---|" + "---:|" * (len(columns) + 1)]
    total: Counter = Counter()
    for kind, counts in table.items():
        total += counts
        cells = [str(counts[name]) for name in columns]
        lines.append(f"| {kind} | {counts.total()} | " + " | ".join(cells) + " |")
    cells = [str(total[name]) for name in columns]
    return "\n".join([*lines, f"| all | {total.total()} | " + " | ".join(cells) + " |"])


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", choices=tuple(WEIGHTS))
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    begun = time.monotonic()
    table, reported = fuzz(options.cases, options.seed, options.kind or list(WEIGHTS))
    if options.json:
        print(json.dumps({"table": table, "otherwise": reported}, indent=1))
    else:
        print(as_text(table))
        print(*reported, f"{time.monotonic() - begun:.0f} s", sep="\n")
    return 1 if reported else 0


if __name__ == "__main__":
    # started in the background, it would not hear Ctrl-C
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    sys.exit(main())
