import numpy as np
import pytest

from hpcsweep.figures import orbit_diagram, style
from hpcsweep.figures.regions import Region, contact_regions


def test_contact_regions_are_maximal_and_short_ones_are_absorbed():
    up = [0] * 5 + [4] * 6 + [6] + [4] * 5 + [6] * 8
    down = [0] * 5 + [4] * 12 + [6] * 4 + [7] * 4
    contact = np.array([up, down])
    valid = np.ones_like(contact, bool)
    assert contact_regions(contact, valid) == [
        Region(0, 4, (0,)),
        Region(5, 16, (4,)),
        Region(17, 20, (6,)),
        Region(21, 24, (6, 7)),
    ]
    valid[:, 21:] = False
    assert contact_regions(contact, valid)[-1] == Region(17, 20, (6,))


def test_names():
    assert style.contact_name(0b110, 3) == "C23"
    assert style.contact_name(0, 3) == "none"
    assert style.contact_name(0b100000000011, 12) == "C1,2,12"
    assert [style.roman(k) for k in (1, 4, 8, 9, 14, 42)] == [
        "i",
        "iv",
        "viii",
        "ix",
        "xiv",
        "xlii",
    ]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    from conftest import SMALL

    from hpcsweep import campaign, open_results
    from hpcsweep.job import parse_job
    from hpcsweep.mpi import Serial

    path = tmp_path_factory.mktemp("figure") / "small.h5"
    assert campaign.run(parse_job(SMALL, "small", "small"), path, Serial()) == 0
    return open_results(path)


@pytest.mark.parametrize("color", ["direction", "contact", "period"])
def test_orbit_diagram_is_drawn(results, tmp_path, color):
    from PIL import Image

    path = tmp_path / "o.png"
    orbit_diagram.draw(results, path, omega=0.7, color=color)
    with Image.open(path) as picture:
        assert picture.width > 1000
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    colours = {tuple(pixel) for pixel in pixels[::7]}
    assert tuple(int(style.PALETTE[0][k : k + 2], 16) for k in (1, 3, 5)) in colours


def test_what_is_not_in_the_file_cannot_be_drawn(results, tmp_path):
    with pytest.raises(style.PlotError, match=r"output\.poincare"):
        orbit_diagram.draw(results.drop_vars("poincare"), tmp_path / "o.png")
    with pytest.raises(style.PlotError, match="no run"):
        orbit_diagram.draw(results.assign(outcome=results["outcome"] * 0), tmp_path / "o.png")
    assert list(tmp_path.iterdir()) == []
