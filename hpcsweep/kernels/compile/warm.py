"""Compile the entry points before they are needed, in several processes, with progress.

numba compiles under one lock in a process, so that only processes compile in parallel: two take 22
s instead of 38 (measured). The types of entry points are declared, so that each can be compiled
without the others.
"""

import contextlib
import gc
import importlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from hpcsweep.kernels import folders
from hpcsweep.kernels.compile.entry_points import EntryPoint, SpecialisedKernels
from hpcsweep.kernels.compile.specialise import Specialisation

COLLECTED_AFTER = 20_000
"""Objects created between two garbage collections while a kernel is compiled."""


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def missing(wanted: list[EntryPoint]) -> list[EntryPoint]:
    """Return the kernels that are not compiled yet."""
    return [kernel for kernel in wanted if not kernel.is_loaded and not kernel.is_kept]


def load_all(
    wanted: list[EntryPoint],
    tell: Callable[[int, int], None] | None = None,
    jobs: int = 1,
) -> None:
    """Compile entry points, or load them from the cache.

    Parameters
    ----------
    wanted : list of EntryPoint
        From `entry_points.with_called`, or specialised ones of these.
    tell : callable, optional
        Called with the number of compiled kernels and the total, at the start and after each
        kernel, unless there is nothing to compile.
    jobs : int
        Most processes that compile.
    """
    lost = missing(wanted)
    if lost:
        if not folders.is_writable() and folders.own_folder() is None:
            # kernels compiled by another process could not be passed on
            jobs = 1
        if tell is not None:
            tell(0, len(lost))
        for done, _ in enumerate(_compile(lost, jobs), 1):
            if tell is not None:
                tell(done, len(lost))
    for kernel in wanted:
        kernel.load()


def _compile(lost: list[EntryPoint], jobs: int) -> Iterator[EntryPoint]:
    """Compile kernels; yield each when it is ready."""
    groups = _groups(lost)
    left = [kernel for group in groups for kernel in group]
    if min(jobs, len(groups)) > 1:
        # without processes, or if one is killed for lack of memory, this one goes on alone
        with contextlib.suppress(BrokenProcessPool, OSError, NotImplementedError):
            for kernel in _compile_side_by_side(groups, min(jobs, len(groups))):
                left.remove(kernel)
                yield kernel
    for kernel in list(left):
        _load(kernel)
        yield kernel


def _groups(lost: list[EntryPoint]) -> list[list[EntryPoint]]:
    """Group kernels by module, the largest group first, callers before their callees.

    They share most of their inlined parts, which a process types and lowers once.
    """
    by_module: dict[str, list[EntryPoint]] = {}
    for kernel in reversed(lost):
        by_module.setdefault(kernel.__module__, []).append(kernel)
    return sorted(by_module.values(), key=len, reverse=True)


def _compile_side_by_side(groups: list[list[EntryPoint]], jobs: int) -> Iterator[EntryPoint]:
    """Compile groups of kernels, each in one process; a free process takes the next."""
    context = multiprocessing.get_context("spawn")
    with contextlib.ExitStack() as stack:
        pools = [
            stack.enter_context(ProcessPoolExecutor(1, context, _start_worker)) for _ in range(jobs)
        ]
        queue = list(groups)
        waiting: dict[Future, tuple[EntryPoint, ProcessPoolExecutor]] = {}

        def hand_out(pool: ProcessPoolExecutor) -> None:
            for kernel in queue.pop(0) if queue else ():
                named = kernel.__module__, kernel.__name__
                waiting[pool.submit(_compile_named, *named, kernel.specialisation)] = kernel, pool

        for pool in pools:
            hand_out(pool)
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                kernel, pool = waiting.pop(future)
                for text in future.result():
                    folders.say_once(text)
                if not kernel.is_kept:
                    # the disk is full: kernels compiled by another process cannot be passed on
                    for each in pools:
                        each.shutdown(cancel_futures=True)
                    return
                yield kernel
                if all(owner is not pool for _, owner in waiting.values()):
                    hand_out(pool)


def _start_worker() -> None:
    """Leave Ctrl-C, and messages about the cache, to the waiting process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    folders.set_printer(_unsaid.append)


_unsaid: list[str] = []


def _compile_named(module: str, name: str, specialisation: Specialisation | None) -> list[str]:
    """Compile a kernel into the cache; return messages about the cache."""
    kernel = getattr(importlib.import_module(module), name)
    gc.freeze()  # modules and earlier kernels stay
    _load(kernel if specialisation is None else SpecialisedKernels(specialisation)[kernel])
    return _unsaid


def _load(kernel: EntryPoint) -> None:
    """Load a kernel with rarer garbage collection: numba creates many objects and drops few."""
    thresholds = gc.get_threshold()
    gc.set_threshold(COLLECTED_AFTER, *thresholds[1:])
    try:
        kernel.load()
    finally:
        gc.set_threshold(*thresholds)
