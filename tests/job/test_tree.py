import datetime
import math
import random
import struct
import tomllib

import numpy as np
import pytest
from together import together
from tools import SMALL, assert_same_datasets, hpcsweep, shipped

from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.job.keys import every_key
from hpcsweep.job.tree import MAX_BASES, merge, write

BASE = """
name = "base"

[structure]
n_floors = 2
stiffness_ratio = 300.0
damping_ratio = [0.06, 0.03]

[sweep]
omega = {from = 0.5, to = 0.8, count = 4}
amplitude = {from = 0.02, to = 0.3, count = 11}
"""
KEYS = every_key()
"""Of every job in jobs/ when each was written out in full."""


@pytest.fixture
def base(tmp_path):
    (tmp_path / "base.toml").write_text(BASE)
    return tmp_path / "base.toml"


def extend(base, text: str, name: str = "own"):
    path = base.parent / f"{name}.toml"
    path.write_text(f'extends = "{base.name}"\n{text}')
    return path


def refused(path, *words: str, settings: tuple[str, ...] = ()) -> str:
    with pytest.raises(JobError) as error:
        load_job(path, settings)
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message
    return message


# --- extends


def test_what_is_given_replaces_and_all_else_is_inherited(base):
    path = extend(base, "[structure]\nstiffness_ratio = 100.0\n[output]\nlyapunov = true\n")
    job, below = load_job(path), load_job(base)
    assert job.structure.stiffness_ratio == 100.0
    assert job.structure.damping_ratio == below.structure.damping_ratio
    assert np.array_equal(job.study.omega, below.study.omega)
    assert job.settings.metrics == below.settings.metrics | {"lyapunov"}
    written_out = BASE.replace("300.0", "100.0") + "[output]\nlyapunov = true\n"
    assert job.fingerprint == parse_job(written_out, "x", "x").fingerprint


def test_a_range_and_a_list_are_replaced_whole(base):
    text = "[structure]\ndamping_ratio = 0.05\n[sweep]\namplitude = {from=0.1, to=0.2, step=0.05}\n"
    job = load_job(extend(base, text))
    assert job.study.amplitude == pytest.approx([0.1, 0.15, 0.2])
    assert job.structure.damping_ratios.tolist() == [0.05, 0.05]
    message = refused(extend(base, "[sweep]\nomega = {to = 0.9}\n"), "sweep.omega.from is missing")
    assert message.startswith(f"{base.parent / 'own.toml'} (extends base.toml): ")


def test_tables_of_a_model_and_of_matrices_are_merged_key_by_key(base):
    model = 'file = "a.npz"\noutputs = ["1"]\ninfluence = "UX"\nreduce = {modes = 5}\n'
    given = {"structure": {"model": tomllib.loads(model), "gap": {"from": 1.0}}}
    own = {"structure": {"model": {"file": "b.npz", "reduce": {"error": 0.1}}, "gap": {"to": 2.0}}}
    assert merge(given, own)["structure"] == {
        "model": {"file": "b.npz", "outputs": ["1"], "influence": "UX", "reduce": {"error": 0.1}},
        "gap": {"to": 2.0},
    }
    text = "[structure.matrices]\nmass = [1, 2]\nstiffness = [[2, -1], [-1, 1]]\n"
    base.write_text(f"{text}damping = [[0.2, 0], [0, 0]]\n{BASE[BASE.index('[sweep]') :]}")
    job = load_job(extend(base, "[structure.matrices]\nmass = [3, 4]\n"))
    assert job.structure.mass_matrix.diagonal().tolist() == [3.0, 4.0]
    assert job.structure.damping_matrix[0, 0] == 0.2


def test_a_name_is_not_inherited(base):
    assert load_job(base).name == "base"
    own = extend(base, "")
    assert load_job(own).name == "own"
    assert load_job(extend(own, "", "third")).name == "third"
    own.write_text('extends = "base.toml"\nname = "given"\n')
    assert load_job(own).name == "given"


def test_a_path_is_relative_to_the_file_that_says_it(base, monkeypatch, tmp_path_factory):
    folder = base.parent / "inner"
    folder.mkdir()
    (folder / "middle.toml").write_text('extends = "../base.toml"\n[sweep]\nomega = 0.7\n')
    (base.parent / "top.toml").write_text('extends = "inner/middle.toml"\n')
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    job = load_job(base.parent / "top.toml")
    assert job.study.omega.tolist() == [0.7]
    assert job.structure.stiffness_ratio == 300.0
    (base.parent / "whole.toml").write_text(f'extends = "{base}"\n')
    assert load_job(base.parent / "whole.toml").fingerprint == load_job(base).fingerprint


def chain(folder, n_bases: int):
    """Write job0, which extends job1, and so on; the last stands alone."""
    for index in range(n_bases):
        (folder / f"job{index}.toml").write_text(f'extends = "job{index + 1}.toml"\n')
    (folder / f"job{n_bases}.toml").write_text(BASE)
    return folder / "job0.toml"


def test_a_chain_may_be_long_but_not_too_long(tmp_path):
    assert load_job(chain(tmp_path, MAX_BASES)).structure.stiffness_ratio == 300.0
    refused(chain(tmp_path, MAX_BASES + 1), "job8.toml: extends = 'job9.toml': ", "8 files at most")


@together(
    "text, words",
    [
        ("extends = 3", ("own.toml: extends = 3: ", "the name of one job file")),
        ('extends = ["base.toml"]', ("own.toml: extends = ['base.toml']: ", "one job file")),
        ('extends = ""', ("own.toml: extends = '': ",)),
        ('extends = "a\\nb"', ("own.toml: extends = 'a\\nb': ",)),
        ("[extends]", ("own.toml: extends = {}: ",)),
        ('extends = "absent.toml"', ("extends = 'absent.toml': ", "absent.toml: cannot be read")),
        ('extends = "."', ("cannot be read",)),
        ('extends = "own.toml"', ("own.toml: extends = 'own.toml': ", "own.toml -> own.toml")),
        ('extends = "loop.toml"', ("loop.toml: extends = 'own.toml': ", "own.toml -> loop.toml")),
        ('extends = "latin.toml"', ("extends = 'latin.toml': ", "UTF-8")),
        ('extends = "broken.toml"', ("extends = 'broken.toml': ", "broken.toml: not valid TOML")),
        ('extend = "base.toml"', ("unknown key 'extend'", "did you mean 'extends'")),
        ('[structure]\nextends = "base.toml"', ("unknown key 'structure.extends'",)),
        ("n = " + "[" * 100_000, ("own.toml: not valid TOML: n: ",)),
        ("n = " + "9" * 5_000, ("own.toml: not valid TOML: n: ", "digits")),
    ],
)
def test_each_mistake_with_extends_is_one_line(base, text, words):
    own = base.parent / "own.toml"
    own.write_text(text)
    (base.parent / "loop.toml").write_text('extends = "own.toml"')
    (base.parent / "latin.toml").write_bytes(b"name = '\xe4'")
    (base.parent / "broken.toml").write_text("[structure")
    assert refused(own, *words).startswith(str(base.parent))


def test_a_mistake_in_any_file_names_what_the_job_is_built_on(base):
    base.write_text(BASE.replace("stiffness", "stifness"))
    message = refused(extend(base, ""), "structure.stifness_ratio", "'stiffness_ratio'")
    assert message.startswith(f"{base.parent / 'own.toml'} (extends base.toml): ")


# --- set on the command line


@together(
    "setting, value",
    [
        ("structure.stiffness_ratio=100", 100.0),
        ("structure.stiffness_ratio = 1e2", 100.0),
        ("structure.sharpness=inf", math.inf),
        ("structure.damping_ratio=[0.1, 0.2]", (0.1, 0.2)),
        ("sweep.initial_state=[0.1, 0.0, 0.0, 0.0]", [0.1, 0.0, 0.0, 0.0]),
        ('sweep.initial_state="rest"', [0.0] * 4),
        ("output.lyapunov=true", True),
        ("sweep.omega={from = 0.25, to = 0.75, count = 3}", [0.25, 0.5, 0.75]),
        ("sweep={omega = 0.5}", [0.5]),
        ("sweep.omega=0.5  # a comment", [0.5]),
        ('name="other"', "other"),
    ],
)
def test_values_are_set_in_toml(base, setting, value):
    job = load_job(base, [setting])
    key = setting.partition("=")[0].strip().split(".")[-1]
    found = {
        "stiffness_ratio": job.structure.stiffness_ratio,
        "sharpness": job.structure.sharpness,
        "damping_ratio": job.structure.damping_ratio,
        "initial_state": job.study.initial_state.tolist(),
        "omega": job.study.omega.tolist(),
        "sweep": job.study.omega.tolist(),
        "lyapunov": "lyapunov" in job.settings.metrics,
        "name": job.name,
    }
    assert found[key] == value
    assert job.study.amplitude.size == 11


def test_of_two_settings_the_later_holds_and_settings_come_after_files(base):
    own = extend(base, "[structure]\nstiffness_ratio = 1.0\n")
    settings = ["structure.stiffness_ratio=2", "sweep.omega=0.6", "structure.stiffness_ratio=3"]
    job = load_job(own, settings)
    assert job.structure.stiffness_ratio == 3.0
    assert job.study.omega.tolist() == [0.6]
    again = parse_job(job.text, "x", "x")
    assert again.fingerprint == job.fingerprint


def test_settings_that_are_valid_only_together_are_judged_together(base):
    settings = ["sweep.sampling_cycles=20", "sweep.max_orbit_period=10"]
    assert load_job(base, settings).settings.max_orbit_period == 10
    base.write_text(BASE + "max_orbit_period = 16\n")
    assert load_job(base, settings).settings.sampling_cycles == 20
    refused(base, "sweep.max_orbit_period = 16", settings=("sweep.sampling_cycles=20",))


@together(
    "setting, words",
    [
        ("structure.stiffness_ratio=-1", ("structure.stiffness_ratio", "at least 0", "-1")),
        ("structure.stifness_ratio=1", ("unknown key", "did you mean 'stiffness_ratio'")),
        ("stiffness_ratio=1", ("unknown key 'stiffness_ratio'", "it belongs in [structure]")),
        ("structure=1", ("structure = 1: must be a table",)),
        ("sweep.omega=1979-05-27", ("sweep.omega", "must be a number")),
        (
            "sweep.initial_state=rest",
            ("not a key and a value of TOML", 'initial_state="rest"'),
        ),
        ("structure.stiffness_ratio=", ("not a key and a value of TOML",)),
        ("structure.stiffness_ratio=[1", ("not a key and a value of TOML",)),
        ("structure.stiffness_ratio=" + "9" * 5_000, ("not a key and a value of TOML",)),
        ("structure.stiffness_ratio=" + "[" * 100_000, ("not a key and a value of TOML",)),
        ("structure.n_floors=0x" + "f" * 5_000, ("does not fit into 64",)),
        ("structure.stiffness_ratio", ("must be TABLE.KEY=VALUE",)),
        ("", ("must be TABLE.KEY=VALUE",)),
        ("=1", ("must be TABLE.KEY=VALUE",)),
        ("# structure.stiffness_ratio=1", ("must be TABLE.KEY=VALUE",)),
        ("structure.n_floors=2\nname='x'", ("must be TABLE.KEY=VALUE",)),
        ("name='\udcff'", ("must be TABLE.KEY=VALUE",)),
        ("sweep.amplitude.from=0.1", ("sweep.amplitude is set whole",)),
        ('vary."building[0].mass".count=9', ('vary."building[0].mass" is set whole',)),
        ("extends='other.toml'", ("can only be said in a job file",)),
    ],
)
def test_each_mistake_in_a_setting_is_one_line_that_names_it(base, setting, words):
    message = refused(base, "--set", *words, settings=(setting,))
    if setting.isprintable():
        assert f"--set {setting[:60]}" in message
    assert len(message) < 400


@together("opened, closed", [("[", "]"), ("{a = ", "}")])
def test_brackets_of_any_depth_are_refused_in_one_line(base, opened, closed):
    for depth in (*range(2, 600, 7), 10_000):
        setting = f"sweep.omega={opened * depth}1{closed * depth}"
        refused(base, "sweep.omega=", settings=(setting,))


# --- text


def test_a_job_without_either_keeps_its_own_text(tmp_path):
    text = "# mine\r\n" + SMALL
    (tmp_path / "a.toml").write_bytes(text.encode())
    assert load_job(tmp_path / "a.toml").text == text


def test_the_text_is_the_whole_job_in_the_order_of_the_keys(base):
    own = extend(base, '[output]\nblock = 7\n[sweep]\ndirections = ["up"]\n')
    job = load_job(own, ["structure.sharpness=inf", "structure.n_floors=2"])
    assert job.text == (
        "# own.toml\n"
        "# extends base.toml\n"
        "# with structure.sharpness=inf\n"
        "# with structure.n_floors=2\n"
        "[structure]\n"
        "n_floors = 2\n"
        "stiffness_ratio = 300.0\n"
        "sharpness = inf\n"
        "damping_ratio = [0.06, 0.03]\n"
        "\n"
        "[sweep]\n"
        "omega = {from = 0.5, to = 0.8, count = 4}\n"
        "amplitude = {from = 0.02, to = 0.3, count = 11}\n"
        'directions = ["up"]\n'
        "\n"
        "[output]\n"
        "block = 7\n"
    )
    assert parse_job(job.text, "", "own").fingerprint == job.fingerprint


LETTERS = [*map(chr, range(0x180)), *"\u2028\ufeff\ufffe漢\U0001f40d", *(10 * "\"\\'\n.=#[]{}")]


class Trees(random.Random):
    """Odd trees, the same on every machine."""

    def word(self) -> str:
        return "".join(self.choices(LETTERS, k=self.randrange(9)))

    def key(self) -> str:
        return self.choice([self.word(), self.word(), "omega", "n_floors"])

    def number(self) -> float:
        (value,) = struct.unpack("d", self.randbytes(8))  # every order of magnitude alike
        return self.choice([0.0, -0.0, math.inf, 5e-324, self.gauss(), value, value])

    def date(self) -> datetime.date:
        return datetime.date.fromordinal(self.randint(1, datetime.date.max.toordinal()))

    def time(self) -> datetime.time:
        microsecond = self.choice([0, self.randrange(10**6)])
        return datetime.time(
            self.randrange(24), self.randrange(60), self.randrange(60), microsecond
        )

    def value(self, depth: int = 0):
        kind = self.randrange(10 if depth < 4 else 7)
        if kind < 7:
            value = (
                self.random() < 0.5,
                self.randint(-(2 ** self.randrange(90)), 2 ** self.randrange(90)),
                self.number(),
                self.word(),
                self.date(),
                datetime.datetime.combine(self.date(), self.time()),
                self.time(),
            )[kind]
            return 0.5 if value != value else value  # no NaN: it is not equal to itself
        n = self.randrange(5)
        if kind == 7:
            return [self.value(depth + 1) for _ in range(n)]
        return {self.key(): self.value(depth + 1) for _ in range(n)}

    def tree(self) -> dict:
        names = [self.choice([self.key(), *list(KEYS)[1:]]) for _ in range(self.randrange(6))]
        return {name: self.value() for name in names}


ODD = [Trees(seed).tree() for seed in range(500)]


@together("tree", ODD)
def test_what_is_written_reads_back_equal(tree):
    found = tomllib.loads(write(tree, KEYS))
    assert found == tree
    assert repr(_sorted(found)) == repr(_sorted(tree))  # 1 is not 1.0, 0.0 is not -0.0


def _sorted(value):
    if isinstance(value, dict):
        return sorted((key, _sorted(item)) for key, item in value.items())
    return [_sorted(item) for item in value] if isinstance(value, list) else value


@together("tree", ODD)
def test_the_text_depends_on_the_tree_not_on_the_order_of_known_keys(tree):
    known = {name: {key: 1 for key in keys} for name, keys in KEYS.items() if name}
    backward = {n: dict(reversed(t.items())) for n, t in reversed(known.items())}
    assert write(merge(known, tree), KEYS) == write(merge(backward, tree), KEYS)
    assert merge(merge({}, tree), tree) == tree


# --- the jobs that are shipped


@pytest.mark.slow
def test_every_shipped_job_loads():
    assert {"demo.toml", "figure3.toml", "figure3-described.toml", "ci.toml"} <= {
        path.name for path in shipped()
    }
    for job in shipped().values():
        assert job.study.n_runs > 0


@pytest.mark.slow
def test_every_shipped_job_is_as_its_text_says():
    for path, job in shipped().items():
        again = parse_job(job.text, path.name, path.stem)
        assert (again.fingerprint, again.name) == (job.fingerprint, path.stem)
        made = "extends =" in path.read_text() or job.study.kind == "records"
        assert made == (job.text != path.read_text())


# --- campaigns


def one_line(done, *words: str) -> None:
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if "hpcsweep" in line]
    assert len(lines) == 1
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in lines[0]


def test_mistakes_leave_nothing_behind(tmp_path, small_job):
    own = tmp_path / "own.toml"
    own.write_text('extends = "absent.toml"\n')
    one_line(hpcsweep(0, "run", own, cwd=tmp_path), "own.toml: extends = 'absent.toml': ")
    setting = "structure.stifness_ratio=1"
    done = hpcsweep(0, "run", small_job, "--set", setting, cwd=tmp_path)
    one_line(done, f"--set {setting}", "did you mean 'stiffness_ratio'")
    one_line(hpcsweep(0, "run", small_job, "--set", cwd=tmp_path), "--set")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["own.toml", "small.toml"]


@pytest.mark.mpi
def test_mistakes_on_many_ranks_take_one_line(tmp_path, small_job):
    done = hpcsweep(2, "run", small_job, "--set", "sweep.omega=0", cwd=tmp_path)
    one_line(done, "--set sweep.omega=0", "must be from 0.0001")
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


@pytest.mark.slow
@pytest.mark.mpi
def test_all_ranks_run_the_whole_job_and_the_file_tells_it(tmp_path, small_job):
    own = tmp_path / "own.toml"
    own.write_text('extends = "small.toml"\n[structure]\nsharpness = inf\n')
    setting = ("--set", "structure.stiffness_ratio=100")
    written_out = tmp_path / "plain.toml"
    written_out.write_text(SMALL.replace("4e3", "inf").replace("300.0", "100.0"))
    assert hpcsweep(0, "run", written_out, "-o", tmp_path / "plain.h5").returncode == 0
    path = tmp_path / "own.h5"
    done = hpcsweep(2, "run", own, *setting, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert_same_datasets(path, tmp_path / "plain.h5")
    shown = hpcsweep(0, "status", path, "--job").stdout
    assert shown.startswith("# own.toml\n# extends small.toml\n# with structure.stiffness_ratio=")
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "back.toml").write_text(shown)
    assert hpcsweep(0, "run", alone / "back.toml", cwd=alone).returncode == 0
    assert_same_datasets(alone / "back.h5", tmp_path / "plain.h5")
    one_line(hpcsweep(0, "run", own, "-o", path), "another job", "-o")
    assert hpcsweep(0, "run", written_out, "-o", path).returncode == 0
