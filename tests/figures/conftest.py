"""A small campaign that the tests of the figures share."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

DPI = 100
"""Half of what figures have, unless a test says other: to draw and to pack pixels takes long."""


@pytest.fixture(autouse=True)
def coarse_pictures():
    from hpcsweep.figures import view

    with view.viewing(DPI):
        yield


@pytest.fixture(scope="session")
def file(tmp_path_factory):
    """A small campaign with exponents, computed once."""
    from tools import SMALL

    from hpcsweep.campaign import run as campaign
    from hpcsweep.job import parse_job
    from hpcsweep.parallel.mpi import Serial

    path = tmp_path_factory.mktemp("figure") / "small.h5"
    job = parse_job(f"{SMALL}lyapunov = true\n", "small", "small")
    assert campaign.run(job, path, Serial()) == 0
    return path


@pytest.fixture(scope="session")
def results(file):
    from hpcsweep import open_results

    return open_results(file)


@pytest.fixture
def drawn_figure(tmp_path):
    """Draw with a module, and give the figure that was saved."""
    from hpcsweep.figures import view

    def draw(module, results, **options):
        path = tmp_path / "drawn.png"
        figure = module.draw(results, **options)
        view.save(figure, path)
        assert path.stat().st_size > 10_000
        return figure

    return draw


@pytest.fixture
def still_film():
    """Make the picture of a film without a file, and an empty frame of it."""
    from tools import SMALL

    from hpcsweep.figures.film.frames import Survey
    from hpcsweep.figures.film.picture import Picture
    from hpcsweep.job import parse_job

    def make(color, keys, contacts=(), n_floors=2, amplitude=(0.1, 0.2), ranges=((-1, 1),)):
        job = parse_job(
            SMALL.replace("n_floors = 2", f"n_floors = {n_floors}").replace(
                "amplitude = {from = 0.02, to = 0.3, count = 11}",
                f"amplitude = {np.array(amplitude).tolist()}",
            ),
            "still",
            "still",
        )
        film = SimpleNamespace(
            study=job.study,
            structure=job.structure,
            coordinates=[],
            words=[f"$u_{floor + 1}$" for floor in range(n_floors)],
            measure=None,
            overlay=None,
            request=SimpleNamespace(color=color, width=960),
        )
        low, high = np.broadcast_to(ranges, (n_floors, 2)).astype(float).T
        shape = 2, len(amplitude)
        frame = {
            "poincare": np.full((*shape, 1, n_floors), np.nan),
            "orbit_period": np.ones(shape, int),
            "outcome": np.ones(shape, int),
            "contact": np.zeros(shape, np.uint64),
            "key": np.indices(shape)[0],
        }
        counts = Counter(dict(zip(contacts, range(len(contacts), 0, -1), strict=True)))
        return Picture(film, Survey((0, 3), low, high, {*keys}, counts)), frame

    return make
