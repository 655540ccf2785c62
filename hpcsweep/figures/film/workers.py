"""Distribute the pieces of a film over ranks, or over processes if there is one rank."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from hpcsweep.parallel import farm
from hpcsweep.parallel.stopping import StopFlag


class Workers:
    """Distributor of pieces; each process has its own `Film`."""

    def __init__(self, comm, processes: int, film, advance: Callable[[int], None]):
        self._comm, self._film, self._advance = comm, film, advance
        self._pool = None
        if comm.size == 1 and processes > 1:
            context = multiprocessing.get_context("spawn")
            given = type(film), film.request, film.folder
            self._pool = ProcessPoolExecutor(processes, context, _start, given)

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *_exception) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def run(
        self,
        task: Callable[..., Any],
        pieces: list[list[int]],
        *arguments,
        collect: Callable[[Any], None] = lambda result: None,
    ) -> bool:
        """Call a method of the film for all pieces; return whether this was completed."""

        def on_report(_rank, value) -> None:
            count, result = value
            collect(result)
            self._advance(count)

        if self._pool is not None:
            jobs = [self._pool.submit(_do, task, piece, *arguments) for piece in pieces]
            for piece, job in zip(pieces, jobs, strict=True):
                on_report(0, (len(piece), job.result()))
            return True

        def compute(number, poll, report) -> None:
            poll()
            piece = pieces[number]
            report((len(piece), task(self._film, piece, *arguments)))

        with StopFlag() as flag:
            return farm.run(self._comm, range(len(pieces)), compute, flag, on_report)


_film: Any = None
"""The film of a worker process."""


def _start(film: Callable[..., Any], *arguments) -> None:
    global _film
    _film = film(*arguments)


def _do(task: Callable[..., Any], *arguments):
    return task(_film, *arguments)
