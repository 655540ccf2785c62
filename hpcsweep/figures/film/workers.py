"""Distribute the pieces of a film over ranks or processes."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from hpcsweep.figures.film.piece import Film, Request
from hpcsweep.figures.film.scene import Scene
from hpcsweep.parallel import farm
from hpcsweep.parallel.stopping import StopFlag


class Workers:
    """Distributor of pieces over ranks, or over processes if there is one rank."""

    def __init__(self, comm, processes: int, film: Film, advance: Callable[[int], None]):
        self._comm, self._film, self._advance = comm, film, advance
        self._pool = None
        if comm.size == 1 and processes > 1:
            self._pool = ProcessPoolExecutor(
                processes,
                multiprocessing.get_context("spawn"),
                _start,
                (film.request, film.folder),
            )

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *_exception) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def run(self, task: str, pieces: list[list[int]], scene: Scene | None, collect) -> bool:
        """Run a task for all pieces; return whether it was completed."""

        def on_report(_rank, value) -> None:
            count, result = value
            collect(result)
            self._advance(count)

        if self._pool is not None:
            jobs = [self._pool.submit(_do, task, scene, p, k) for k, p in enumerate(pieces)]
            for job in jobs:
                on_report(0, job.result())
            return True

        def compute(number, poll, report) -> None:
            poll()
            report(_run(self._film, task, scene, pieces[number], number))

        with StopFlag() as flag:
            return farm.run(self._comm, range(len(pieces)), compute, flag, on_report)


def _run(film: Film, task: str, scene: Scene | None, frames: list[int], number: int):
    if task == "survey" or scene is None:
        return len(frames), film.survey(frames)
    film.encode(scene, frames, number)
    return len(frames), None


_film: Film | None = None
"""The film of a worker process."""


def _start(request: Request, folder: Path) -> None:
    global _film
    _film = Film(request, folder)


def _do(task: str, scene: Scene | None, frames: list[int], number: int):
    assert _film is not None, "_start has run"
    return _run(_film, task, scene, frames, number)
