"""The cache of compiled kernels: made anew when what they are made of changes, shared by all."""

import importlib
import pkgutil
import shutil
import subprocess
import sys
import time
import types
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
import pytest
from tools import environment, python

import hpcsweep
from hpcsweep.kernels import folders
from hpcsweep.kernels.compile import cache as jit
from hpcsweep.kernels.compile.decorators import Kernel
from hpcsweep.kernels.compile.entry_points import EntryPoint

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)

PACKAGE = Path(hpcsweep.__file__).parent


def kernels():
    """Return every compiled function of the package, with its module."""
    found = {}
    for info in pkgutil.walk_packages([str(PACKAGE)], "hpcsweep."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for value in vars(module).values():
            if isinstance(value, Kernel | EntryPoint):
                found[value.py_func] = value
    return found


def test_the_key_covers_every_module_that_kernels_and_their_constants_come_from():
    covered = set(jit.kernel_files())
    functions = kernels()
    assert len(functions) > 80
    for function in functions:
        own = Path(function.__code__.co_filename).resolve()
        if not own.is_relative_to(PACKAGE):
            continue
        assert own in covered, f"{own}: {function.__name__} is compiled from it"
        # the modules of the package that its module draws anything from
        for value in function.__globals__.values():
            name = value.__name__ if isinstance(value, types.ModuleType) else None
            name = name or getattr(value, "__module__", None) or ""
            if name.startswith("hpcsweep.") and not isinstance(value, type):
                source = Path(sys.modules[name].__file__).resolve()
                assert source in covered, f"{own.name} draws on {source}"


def test_rooms_declare_their_kernels_and_a_file_that_is_not_there_is_an_error(tmp_path):
    room, other = tmp_path / "room", tmp_path / "other"
    for folder in (room, room / "inner", other):
        folder.mkdir()
        (folder / "__init__.py").write_text("")
    (other / "one.py").write_text("")
    assert jit.kernel_files(tmp_path) == []
    (room / "__init__.py").write_text('"""A room."""\n\nKERNELS = (\n    "inner/*.py",\n)\n')
    (other / "__init__.py").write_text('KERNELS = ("one.py",)\n')
    assert jit.kernel_files(tmp_path) == [other / "one.py", room / "inner" / "__init__.py"]
    (room / "__init__.py").write_text('KERNELS = ("moved.py",)\n')
    with pytest.raises(FileNotFoundError, match=r"room/moved\.py"):
        jit.kernel_files(tmp_path)


CODE = """
import sys
sys.path.insert(0, sys.argv[1])
from hpcsweep.{module} import switch
from hpcsweep.kernels.compile import cache as jit
from hpcsweep.kernels.compile.entry_points import EntryPoint
switch(0.5, 3.0)
one = switch.dispatcher
print(jit.source_hash(), sum(one._cache_hits.values()), sum(one._cache_misses.values()))
"""
MODULE = "model.contact"


def started_in(folder: Path, cache: Path) -> tuple[str, int, int]:
    code = CODE.format(module=MODULE)
    done = python(code, folder, cwd=folder, NUMBA_CACHE_DIR=str(cache))
    key, hits, misses = done.stdout.split()
    return key, int(hits), int(misses)


@pytest.mark.slow
def test_the_cache_is_found_from_another_path_and_not_after_an_edit(tmp_path):
    for name in ("one", "two"):
        shutil.copytree(
            PACKAGE, tmp_path / name / "hpcsweep", ignore=shutil.ignore_patterns("__pycache__")
        )
    cache = tmp_path / "cache"
    key, hits, misses = started_in(tmp_path / "one", cache)
    assert (hits, misses) == (0, 1)
    assert started_in(tmp_path / "two", cache) == (key, 1, 0)
    source = (tmp_path / "two" / "hpcsweep").joinpath(*MODULE.split(".")).with_suffix(".py")
    text = source.read_text()
    source.write_text('"""Another text."""\n# a remark\n' + text.split('"""', 2)[2])
    assert started_in(tmp_path / "two", cache) == (key, 1, 0)
    source.write_text(text.replace("else 0.5", "else 0.25"))
    other, hits, misses = started_in(tmp_path / "two", cache)
    assert other != key
    assert (hits, misses) == (0, 1)


@pytest.mark.slow
def test_settings_of_numba_for_other_packages_are_left_alone():
    code = (
        "import numba; before = numba.config.CACHE_DIR\n"
        "import hpcsweep.solvers.flow\n"
        "assert numba.config.CACHE_DIR == before, numba.config.CACHE_DIR\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=environment())


HASHED = """
from hpcsweep.kernels.compile import cache
parsed, text = [], cache._program_text
cache._program_text = lambda source: parsed.append(1) or text(source)
print(cache.source_hash(), len(parsed))
"""


def hashed(cache: Path) -> tuple[str, bool]:
    """Key of the kernels, and whether their files were parsed for it."""
    done = python(HASHED, NUMBA_CACHE_DIR=str(cache))
    key, parsed = done.stdout.split()
    return key, int(parsed) > 0


def test_threads_parse_one_after_the_other(tmp_path, monkeypatch):
    """In some versions of Python to parse in several threads at once is a SystemError."""
    at_once, most = [], []

    def parsed(source):
        at_once.append(1)
        most.append(len(at_once))
        time.sleep(1e-4)
        at_once.pop()
        return "text"

    monkeypatch.setattr(jit, "_program_text", parsed)
    monkeypatch.setattr(jit.folders, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(jit.folders, "read_verified", lambda path: None)
    monkeypatch.setattr(jit.folders, "write_verified", lambda path, content: None)
    with ThreadPoolExecutor(4) as pool:
        keys = set(pool.map(lambda _: jit.source_hash.__wrapped__(), range(4)))
    assert len(keys) == 1
    assert len(most) == 4 * len(jit.kernel_files())
    assert max(most) == 1


@pytest.mark.slow
def test_files_that_have_not_changed_are_parsed_once(tmp_path):
    key, parsed = hashed(tmp_path)
    assert parsed
    assert hashed(tmp_path) == (key, False)
    (kept,) = (tmp_path / "sources").iterdir()
    for damaged in (b"", b"\xff", key[:-1].encode()):
        kept.write_bytes(damaged)
        assert hashed(tmp_path) == (key, True)
    assert hashed(tmp_path) == (key, False)
    (tmp_path / "file").write_text("no folder")
    assert hashed(tmp_path / "file" / "cache") == (key, True)


def test_what_is_not_as_it_was_written_counts_as_not_there(tmp_path):
    path, content = tmp_path / "a.kernel", bytes(range(256)) * 8
    folders.write_verified(path, content)
    whole = path.read_bytes()
    assert folders.read_verified(path) == content
    chosen = np.random.default_rng(1)
    for place in chosen.integers(0, 8 * len(whole), 300).tolist():
        damaged = bytearray(whole)
        damaged[place // 8] ^= 1 << place % 8
        path.write_bytes(damaged)
        assert folders.read_verified(path) is None, f"bit {place}"
    for cut in (b"", whole[:-1], whole[:15], whole + b"\0"):
        path.write_bytes(cut)
        assert folders.read_verified(path) is None
    path.unlink()
    assert folders.read_verified(path) is None
    path.mkdir()
    assert folders.read_verified(path) is None


@pytest.mark.slow
def test_a_damaged_kernel_is_compiled_again_and_mended(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "hpcsweep", ignore=shutil.ignore_patterns("__pycache__"))
    cache = tmp_path / "cache"
    key, hits, misses = started_in(tmp_path, cache)
    assert (hits, misses) == (0, 1)
    (kept,) = (cache / key).rglob("*.kernel")
    whole = kept.read_bytes()
    kept.write_bytes(whole[:5000] + bytes([whole[5000] ^ 4]) + whole[5001:])
    assert started_in(tmp_path, cache) == (key, 0, 1)
    assert started_in(tmp_path, cache) == (key, 1, 0)


STARTED = """
import sys
import numpy
from numba.core.runtime import rtsys
from hpcsweep import Structure
from hpcsweep.kernels.compile.decorators import Kernel
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.model.equations import MODEL, right_hand_side
from hpcsweep.model.kernel_model import kernel_model
FlowMap(Structure(), 0.445).advance([0.0] * 6, 0.06, 3)
modules = [one for name, one in sys.modules.items() if name.startswith("hpcsweep.")]
kernels = {id(one): one for each in modules for one in vars(each).values() if type(one) is Kernel}
declared = ["dispatcher" in vars(one) for one in kernels.values()]
print(len(declared), sum(declared), rtsys._init)
packed = MODEL.pack(kernel_model(Structure(), 0.445))
right_hand_side(0.0, numpy.zeros(6), 0.06, packed, numpy.zeros(6))
print(rtsys._init)
"""


def test_what_is_loaded_from_the_cache_declares_no_other_kernel_and_counts_no_reference():
    exec(STARTED, {})  # compiles them where they are not yet
    start = [sys.executable, "-c", STARTED]
    done = subprocess.run(start, env=environment(), capture_output=True, text=True, check=True)
    kernels, declared, counts, then = done.stdout.split()
    assert int(kernels) > 150
    assert int(declared) < 10
    assert (counts, then) == ("False", "True")
