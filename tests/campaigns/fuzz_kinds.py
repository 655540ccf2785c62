"""Kinds of cases of the fuzzer beside those of one small job: see `fuzz`."""

import contextlib
import io
import random
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from hpcsweep import Contact, Structure, stroboscopic_points
from hpcsweep.campaign import run as campaign
from hpcsweep.commands import cli
from hpcsweep.job import parse_job
from hpcsweep.kernels import folders
from hpcsweep.kernels.compile.cache import SUFFIX, kept_in
from hpcsweep.parallel.mpi import Serial
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
