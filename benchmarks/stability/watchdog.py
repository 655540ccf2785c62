"""Call a function on each of many items in a process of its own, under a time limit.

A compiled kernel that hangs cannot be interrupted from Python; its process can be ended.
"""

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

START_SECONDS = 300.0
"""Time limit (s) for a new process to answer: imports, and compilation on a cold cache."""


@dataclass(frozen=True)
class Lost:
    """An item without a result, and the reason."""

    reason: str


def _serve(function, connection):
    """Answer items with results, until None comes."""
    function(None)
    connection.send(None)
    while (item := connection.recv()) is not None:
        try:
            answer = function(item)
        except Exception as error:  # passed to the caller, who decides
            answer = Lost(f"{type(error).__name__}: {error}")
        connection.send(answer)


class _Worker:
    def __init__(self, function):
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(function, theirs), daemon=True)
        self.process.start()
        theirs.close()

    def receive(self, seconds):
        """Return the next answer, or a `Lost` that says what happened instead."""
        try:
            if self.connection.poll(seconds):
                return self.connection.recv()
        except (EOFError, ConnectionError):
            self.process.join(5.0)
            return Lost(f"its process died (exit code {self.process.exitcode})")
        return Lost(f"hang: no answer in {seconds:g} s")

    def close(self):
        self.process.kill()
        self.process.join()
        self.connection.close()


def each(function: Callable, items: Iterable, limit: Callable) -> Iterator[tuple]:
    """Yield (item, function(item)) for every item, with a `Lost` where there is no result.

    Parameters
    ----------
    function : callable
        Importable by name. Called with None first, to compile or load what it needs.
    items : iterable
        Picklable.
    limit : callable
        Return the time limit (s) of an item. After a hang a new process continues.
    """
    worker = None
    try:
        for item in items:
            if worker is None:
                worker = _Worker(function)
                ready = worker.receive(START_SECONDS)
                if ready is not None:
                    raise RuntimeError(f"the working process did not start: {ready.reason}")
            try:
                worker.connection.send(item)
                answer = worker.receive(limit(item))
            except ConnectionError:
                answer = Lost("its process died")
            if isinstance(answer, Lost) and not worker_alive(worker, answer):
                worker.close()
                worker = None
            yield item, answer
    finally:
        if worker is not None:
            worker.close()


def worker_alive(worker: _Worker, answer: Lost) -> bool:
    """Return whether the process can take another item: it answered, even with an error."""
    return not answer.reason.startswith(("hang", "its process")) and worker.process.is_alive()
