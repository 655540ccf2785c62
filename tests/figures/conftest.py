"""A small campaign that the tests of the figures share."""

import pytest

DPI = 100
"""Half of what figures have, unless a test says other: to draw and to pack pixels takes long."""


@pytest.fixture(autouse=True)
def coarse_pictures():
    from hpcsweep.figures import style

    with style.resolution(DPI):
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
def drawn_figure(monkeypatch, tmp_path):
    """Draw with a module, and give the figure that was saved."""
    from hpcsweep.figures import style

    def draw(module, results, **options):
        kept = []

        def keep(figure, path):
            kept.append(figure)
            style.save(figure, path)

        monkeypatch.setattr(module, "save", keep)
        path = tmp_path / "drawn.png"
        module.draw(results, path, **options)
        assert path.stat().st_size > 10_000
        return kept[0]

    return draw
