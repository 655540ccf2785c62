"""Every command of an installed hpcsweep, once, in an empty folder: smoke.py HPCSWEEP MPIRUN.

Needs nothing of the repository, and of Python only its own library. `.ci/package` runs it on an
installation that is read-only.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

PLOTS = {
    "orbit": ("--color", "contact"),
    "phase": ("--amplitude", "0.2"),
    "frames": (),
    "map": ("--value", "lyapunov"),
    "metrics": (),
    "benefit": (),
    **dict.fromkeys(("time", "loop", "section", "spectrum"), ("--amplitude", "0.2")),
    "response": (),
}
"""Every kind of figure of a sweep, with what is requested besides."""
ATTRACTOR_PLOTS = {"attractors": ("--floor", "3"), "shares": (), "number": ("--sweep", "study.h5")}
"""Those of a study of attractors."""
BASIN_PLOTS = {"basins": ()}
"""Those of a study of basins."""
VARY_PLOTS = {"vary": (), "measures": ()}
"""Those of a job that varies a key."""
RECORD_PLOTS = {
    "ida": (),
    "fragility": ("--threshold", "0.02"),
    "profile": (),
    "spectra": (),
    "floor-spectra": (),
    "history": (),
    "hysteresis": (),
    "energy": (),
}
"""Those of a study of records."""
ELASTIC_PLOTS = {"pounding": (), "separation": ()}
"""Those of one in which nothing yields."""
PORTFOLIO_PLOTS = {"portfolio": ("--against", "building[0].storey_stiffness")}
"""Those of a study of records that varies a key."""
BRANCH_PLOTS = {"branches": ("--sweep", "study.h5")}
"""Those of a study of branches."""
BRANCHES = ('study.kind="branches"', 'branches.seeds="study.h5"', "sweep.omega=0.445")
RECORDS = """
[study]
kind = "records"
[[building]]
mass = [1.0, 1.0]
storey_stiffness = 900.0
yield_drift = 0.01
[[building]]
mass = [1.0]
storey_stiffness = 200.0
[pounding]
gap = 0.005
stiffness = 1e4
[records]
synthetic = {count = 4, dt = 0.02, duration = 10.0}
scale = {by = "pga", from = 0.1, to = 5.0, count = 40}
"""
BASINS = (
    'study.kind="basins"',
    "study.starts=8",
    "study.max_cycles=300",
    "study.horizontal=[-0.5, 0.0, 0.5]",
    "study.vertical=[-0.5, 0.5]",
    "sweep.omega=0.445",
    "sweep.amplitude=0.125",
)
ATTRACTORS = ('study.kind="attractors"', "study.starts=8", "study.max_cycles=300")
SMALL = (
    "sweep.omega={from = 0.44, to = 0.45, count = 3}",
    "sweep.amplitude={from = 0.02, to = 0.25, count = 12}",
    "sweep.transient_cycles=40",
    "sweep.sampling_cycles=32",
    "output.lyapunov=true",
)
"""Three frames in place of the template's one, with every variable that a figure needs, the last of
what branches do not have."""
EACH = """
import json, sys
from hpcsweep.commands import cli
for line in json.loads(sys.argv[1]):
    assert cli.main(line) == 0, line
"""
TIMEOUT = 1800
"""Seconds for one command: the first may have to compile the kernels."""


class Installed:
    """The commands of an installation, and which of them have run.

    Parameters
    ----------
    program, mpirun : str
    """

    def __init__(self, program: str, mpirun: str):
        self._program, self._mpirun = program, mpirun
        self.used: set[str] = set()

    def __call__(self, *arguments: str, ranks: int = 0, makes: str = "") -> str:
        """Run a command to its good end; give what it printed.

        Parameters
        ----------
        ranks : int
            0: without mpirun.
        makes : str
            File that is not there before, and is not empty after.
        """
        self.used.add(arguments[0])
        assert not (makes and Path(makes).exists()), makes
        launcher = [self._mpirun, "-n", str(ranks)] if ranks else []
        print("hpcsweep", *arguments, flush=True)
        said = self._run(*launcher, self._program, *arguments)
        assert not makes or Path(makes).stat().st_size > 0, f"{makes} was not made"
        return said

    def each(self, lines: list[list[str]]) -> None:
        """Run commands to their good ends in one process, which loads its libraries once."""
        self._run(str(Path(self._program).with_name("python")), "-c", EACH, json.dumps(lines))

    def _run(self, *line: str) -> str:
        done = subprocess.run(line, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        assert done.returncode == 0, f"exit code {done.returncode}:\n{done.stdout}{done.stderr}"
        assert "Traceback" not in done.stderr, done.stderr
        return done.stdout


def listed(text: str) -> set[str]:
    """Return the names of the commands that --help lists."""
    return set(re.findall(r"^    (\w+) ", text.split("COMMAND\n")[1].split("options:")[0], re.M))


def check(hpcsweep: Installed) -> None:
    """Run every command; AssertionError where one does not do what it is for."""
    every = listed(hpcsweep("--help"))
    assert re.match(r"hpcsweep \d+\.\d+", hpcsweep("--version"))
    assert "ready in" in hpcsweep("warmup", "--jobs", "2")
    hpcsweep("new", "study.toml", makes="study.toml")
    given = [word for setting in SMALL for word in ("--set", setting)]
    assert "#SBATCH --ntasks=" in hpcsweep("run", "study.toml", *given, "--dry-run")
    hpcsweep("run", "study.toml", *given, "-o", "one.h5", makes="one.h5")
    hpcsweep("run", "study.toml", *given, "-o", "study.h5", ranks=2, makes="study.h5")
    state = json.loads(hpcsweep("status", "study.h5", "--json"))
    assert state["complete"]
    assert state["runs_done"] == 72
    assert state["sessions"][0]["ranks"] == 2
    summary = json.loads(hpcsweep("summary", "study.h5", "--json"))
    assert summary
    assert hpcsweep("validate", "study.h5", "--samples", "6")
    kinds = re.search(r"--kind \{([\w,-]+)\}", hpcsweep("plot", "--help"))[1].split(",")
    own = {*VARY_PLOTS, *ATTRACTOR_PLOTS, *BASIN_PLOTS, *RECORD_PLOTS, *BRANCH_PLOTS}
    assert set(kinds) == {*PLOTS, *PORTFOLIO_PLOTS, *ELASTIC_PLOTS, *own}
    own = [word for setting in ATTRACTORS for word in ("--set", setting)]
    hpcsweep("run", "study.toml", *given, *own, "-o", "each.h5", ranks=2, makes="each.h5")
    own = [word for setting in BASINS for word in ("--set", setting)]
    hpcsweep("run", "study.toml", *given, *own, "-o", "slice.h5", ranks=2, makes="slice.h5")
    own = [word for setting in (*SMALL[:-1], *BRANCHES) for word in ("--set", setting)]
    hpcsweep("run", "study.toml", *own, "-o", "curves.h5", ranks=2, makes="curves.h5")
    gaps = 'vary."structure.gap"=[0.9, 1.0, 1.1]'
    own = ("--set", gaps, "--set", "output.storey_drift=true")
    hpcsweep("run", "study.toml", *given, *own, "-o", "gaps.h5", ranks=2, makes="gaps.h5")
    assert "mode 1" in hpcsweep("describe", "study.toml")
    Path("records.toml").write_text(RECORDS)
    hpcsweep("run", "records.toml", makes="records.h5")
    Path("elastic.toml").write_text(RECORDS.replace("yield_drift = 0.01\n", ""))
    hpcsweep("run", "elastic.toml", makes="elastic.h5")
    storeys = ("--set", 'vary."building[0].storey_stiffness"=[800.0, 900.0, 1000.0]')
    hpcsweep("run", "records.toml", *storeys, "-o", "storeys.h5", makes="storeys.h5")
    assert "median" in hpcsweep("fragility", "records.h5", "--threshold", "0.02")
    hpcsweep("table", "records.h5", "-o", "records.csv", makes="records.csv")
    finer = ("--set", "sweep.omega=[0.44, 0.4425, 0.445, 0.4475, 0.45]", "--reuse", "study.h5")
    hpcsweep("run", "study.toml", *given, *finer, "-o", "finer.h5", makes="finer.h5")
    hpcsweep("split", "study.toml", *given, "-n", "2", makes="study-2of2.toml")
    parts = [f"study-{k}of2.h5" for k in (1, 2)]
    for part in parts:
        hpcsweep("run", part.replace(".h5", ".toml"), makes=part)
    assert "72 runs of 2 parts" in hpcsweep("merge", *parts, "-o", "whole.h5", makes="whole.h5")
    drawn = (
        ("study.h5", PLOTS),
        ("gaps.h5", VARY_PLOTS),
        ("each.h5", ATTRACTOR_PLOTS),
        ("slice.h5", BASIN_PLOTS),
        ("curves.h5", BRANCH_PLOTS),
        ("records.h5", RECORD_PLOTS),
        ("elastic.h5", ELASTIC_PLOTS),
        ("storeys.h5", PORTFOLIO_PLOTS),
    )
    hpcsweep("plot", "study.h5", makes="study.png")
    hpcsweep.each(
        [
            ["plot", file, "--kind", kind, *more, "-o", f"{kind}.png"]
            for file, plots in drawn
            for kind, more in plots.items()
        ]
    )
    for kind in kinds:
        assert Path(f"{kind}.png").read_bytes().startswith(b"\x89PNG")
    for film in ("study.mp4", "study.gif"):
        hpcsweep("animate", "study.h5", "--width", "640", "-o", film, makes=film)
    hpcsweep("explore", "study.h5", "--branches", "curves.h5", makes="study.html")
    hpcsweep("explore", "records.h5", makes="records.html")
    for page in ("study.html", "records.html"):
        assert "<html" in Path(page).read_text()
    hpcsweep("pack", "study.h5", "-o", "packed.h5", makes="packed.h5")
    assert json.loads(hpcsweep("status", "packed.h5", "--json"))["complete"]
    used = {name for name in hpcsweep.used if not name.startswith("-")}
    assert used == every, f"not tried: {every - used}"


if __name__ == "__main__":
    check(Installed(*sys.argv[1:]))
    print("every command of the installed package works")
