"""Compiling the separate kernels before they are needed: by several processes, with progress.

numba compiles under one lock in a process, so that only processes compile side by side. The types
of separate kernels are declared, and so each can be compiled without the others, the costliest
first. What a kernel took is kept beside the cache, and the next time foretells what is left.
"""

import contextlib
import gc
import importlib
import json
import math
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

from hpcsweep.kernels import folders, separate
from hpcsweep.kernels.fitting import Fit
from hpcsweep.kernels.separate import FittedKernels, Separate

SECONDS = "seconds.json"
"""Beside the cache: process time that each kernel took when it was last compiled (s)."""

COLLECTED_AFTER = 20_000
"""Objects that are made between two searches for garbage while a kernel is compiled."""


class Progress(NamedTuple):
    """How far the compilation has come."""

    done: int
    total: int
    name: str
    """Of the kernel compiled last, '' at the start."""
    left: float
    """Seconds to go, NaN as long as nothing is known of what kernels take."""


def processors() -> int:
    """Count the processors that this process may use."""
    return len(os.sched_getaffinity(0))


def missing(fitted: FittedKernels | None = None) -> list[Separate]:
    """Return the kernels, those for any structure or fitted ones, that are to be compiled yet."""
    asked = separate.ALL if fitted is None else fitted.all
    return [one for one in asked if not one.is_loaded and not one.is_kept]


def load_all(
    tell: Callable[[Progress], None] | None = None,
    jobs: int = 1,
    fitted: FittedKernels | None = None,
) -> None:
    """Compile all separate kernels, or load them from the cache.

    Parameters
    ----------
    tell : callable, optional
        Told of the progress, if there is anything to compile: at the start and after each kernel.
    jobs : int
        Processes that compile, at most.
    fitted : FittedKernels, optional
        In place of the kernels for any structure.
    """
    lost = missing(fitted)
    if lost:
        learnt = _learnt_seconds()
        if not _keep_seconds(learnt) and folders.own_folder() is None:
            # what another process compiles could not be handed over
            jobs = 1
        outlook = _Outlook(lost, learnt, jobs)
        if tell is not None:
            tell(outlook.progress(""))
        for one, seconds in _compile(lost, learnt, jobs):
            learnt[one.cost_name] = seconds
            outlook.done.append(one.name)
            if tell is not None:
                tell(outlook.progress(one.__name__))
        _keep_seconds(learnt)
    if fitted is None:
        separate.load_all()
    else:
        fitted.load()


class _Outlook:
    """Foretells what is left from what kernels took the last time and the pace of this one."""

    def __init__(self, lost: list[Separate], learnt: dict[str, float], jobs: int):
        known = [learnt[one.cost_name] for one in lost if one.cost_name in learnt]
        typical = sum(known) / len(known) if known else math.nan
        self.done: list[str] = []
        self._expected = {one.name: learnt.get(one.cost_name, typical) for one in lost}
        self._jobs = min(jobs, len(lost))
        self._begun = time.perf_counter()

    def progress(self, name: str) -> Progress:
        """Tell how far it is after a kernel of that name."""
        behind = sum(self._expected[one] for one in self.done)
        ahead = sum(self._expected.values()) - behind
        pace = 1.0 / self._jobs
        if behind > 0.0:
            pace = (time.perf_counter() - self._begun) / behind
        return Progress(len(self.done), len(self._expected), name, ahead * pace)


def _compile(
    lost: list[Separate], learnt: dict[str, float], jobs: int
) -> Iterator[tuple[Separate, float]]:
    """Compile kernels, the costliest first; yield each with the process time it took."""
    left = sorted(lost, key=lambda one: -learnt.get(one.cost_name, math.inf))
    groups = _groups(lost, learnt)
    if min(jobs, len(groups)) > 1:
        # where processes cannot be had, or one is killed for want of memory, this one goes on alone
        with contextlib.suppress(BrokenProcessPool, OSError, NotImplementedError):
            for one, seconds in _compile_side_by_side(groups, min(jobs, len(groups))):
                left.remove(one)
                yield one, seconds
    for one in list(left):
        yield one, _timed(one)


def _groups(lost: list[Separate], learnt: dict[str, float]) -> list[list[Separate]]:
    """Put the kernels of a module together, the costliest first.

    They share most of their parts, which a process types and lowers once. Where nothing is known,
    the largest groups come first, and callers before what they call.
    """
    found: dict[str, list[Separate]] = {}
    for one in reversed(lost):
        found.setdefault(one.__module__, []).append(one)

    def cost(group: list[Separate]) -> tuple[float, int]:
        return sum(learnt.get(one.cost_name, math.inf) for one in group), len(group)

    return sorted(found.values(), key=cost, reverse=True)


def _compile_side_by_side(
    groups: list[list[Separate]], jobs: int
) -> Iterator[tuple[Separate, float]]:
    """Compile groups of kernels, each in one process; a process that is done takes the next."""
    context = multiprocessing.get_context("spawn")
    with contextlib.ExitStack() as stack:
        pools = [
            stack.enter_context(ProcessPoolExecutor(1, context, _start_worker)) for _ in range(jobs)
        ]
        queue = list(groups)
        waiting: dict[Future, tuple[Separate, ProcessPoolExecutor]] = {}

        def hand_out(pool: ProcessPoolExecutor) -> None:
            for one in queue.pop(0) if queue else ():
                named = one.__module__, one.__name__
                waiting[pool.submit(_compile_named, *named, one.fit)] = one, pool

        for pool in pools:
            hand_out(pool)
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                one, pool = waiting.pop(future)
                seconds, said = future.result()
                for text in said:
                    folders.say_once(text)
                if not one.is_kept:
                    # the disk is full: what another process compiles cannot be handed over
                    for each in pools:
                        each.shutdown(cancel_futures=True)
                    return
                yield one, seconds
                if all(owner is not pool for _, owner in waiting.values()):
                    hand_out(pool)


def _start_worker() -> None:
    """Leave Ctrl-C, and what is to be said of the cache, to the process that waits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    folders.say_by(_unsaid.append)


_unsaid: list[str] = []


def _compile_named(module: str, name: str, fit: Fit | None) -> tuple[float, list[str]]:
    """Compile a kernel into the cache; return the process time, and what is to be said."""
    one = getattr(importlib.import_module(module), name)
    return _timed(one if fit is None else FittedKernels(fit)[one]), _unsaid


def _timed(one: Separate) -> float:
    begun = time.process_time()
    with _rarely_collecting():
        one.load()
    return time.process_time() - begun


@contextlib.contextmanager
def _rarely_collecting() -> Iterator[None]:
    """Let Python look for garbage less often: numba makes many objects and drops few of them."""
    thresholds = gc.get_threshold()
    gc.set_threshold(COLLECTED_AFTER, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def _learnt_seconds() -> dict[str, float]:
    """Read what kernels took the last time; empty if that is not known."""
    try:
        found = json.loads((folders.cache_root() / SECONDS).read_bytes())
        return {str(name): float(seconds) for name, seconds in found.items()}
    except (OSError, ValueError, AttributeError, TypeError):
        return {}


def _keep_seconds(seconds: dict[str, float]) -> bool:
    """Keep what kernels took; tell, and say, whether the folder can be written."""
    rounded = {name: round(value, 2) for name, value in sorted(seconds.items())}
    try:
        folders.write_whole(folders.cache_root() / SECONDS, json.dumps(rounded, indent=1).encode())
    except OSError as error:
        folders.say_unwritable(error.strerror or str(error))
        return False
    return True
