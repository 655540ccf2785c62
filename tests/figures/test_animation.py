"""The film: decoded again, looked at pixel by pixel."""

import re
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tools import SMALL, hpcsweep, spot

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.commands import cli
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures.film import film
from hpcsweep.figures.film.film import check
from hpcsweep.figures.film.frames import Film, Request, joined
from hpcsweep.figures.film.picture import Picture
from hpcsweep.figures.palette import DIRECTIONS, MOTION_COLOURS, contact_colour, motion_place
from hpcsweep.figures.style import classes_of
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Frames, StoreError

WIDTH = 640


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("film") / "small.h5"
    assert campaign.run(parse_job(SMALL, "small", "small"), path, Serial()) == 0
    return path


@pytest.fixture(scope="module")
def made(results) -> Request:
    request = Request(results, results.with_name("small.mp4"), fps=10, width=WIDTH)
    check(request)
    assert film.make(request, Serial()) == 4
    return request


def decode(path: Path) -> tuple[np.ndarray, str]:
    """Decode a film: pictures (k, height, width, 3), and what ffmpeg says of it."""
    said = subprocess.run(
        [film.find_ffmpeg(), "-hide_banner", "-i", str(path)], capture_output=True, text=True
    ).stderr
    width, height = map(int, re.search(r"Video: .*?, (\d+)x(\d+)", said).groups())
    call = [film.find_ffmpeg(), "-v", "error", "-i", str(path)]
    raw = subprocess.run(
        [*call, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    ).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3), said


def picture_of(request: Request) -> Picture:
    view = Film(request)
    return Picture(view, joined([*map(view.survey, view.order)]))


def rgb(colour: str) -> np.ndarray:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])


@pytest.mark.slow
def test_film_has_the_asked_frames_and_plays_everywhere(made):
    pictures, said = decode(made.output)
    assert pictures.shape[0] == 4
    assert pictures.shape[2] == WIDTH
    assert pictures.shape[1] % 2 == 0
    assert "h264" in said
    assert "yuv420p" in said
    assert "bt709" in said
    assert re.search(r"10 fps", said)
    assert re.search(r"Duration: 00:00:00\.40", said)
    content = made.output.read_bytes()
    assert 0 < content.index(b"moov") < content.index(b"mdat")
    for before, after in pairwise(pictures):
        changed = np.abs(before.astype(int) - after).max(axis=2) > 60
        assert changed.mean() > 1e-3


def test_point_pixels_of_the_decoded_film_are_where_they_should_be(made):
    pictures, _ = decode(made.output)
    data = open_results(made.file)
    panels = picture_of(made).panels
    for k, a, floor in np.ndindex(4, data.sizes["amplitude"], 2):
        u = float(data["poincare"].values[0, k, a, 0, floor])
        colour = spot(pictures[k], panels[floor], float(data["amplitude"][a]), u, 1)
        # the other sweep's colour is 213 away, the background 255
        assert np.abs(colour - rgb(DIRECTIONS["up"])).max(axis=1).min() < 90, (k, a, floor)
    # between two columns of points there is none
    between = float(data["amplitude"][5:7].mean())
    for u in np.linspace(*panels[0].get_ylim(), 50)[2:-2]:
        assert min(spot(picture, panels[0], between, u).min() for picture in pictures) > 190


def test_a_point_covers_its_place_and_no_more(still_film):
    """Points lie where matplotlib draws their values, and only there does a frame differ."""
    given = "direction", (0, 1), (), 2, (0.05, 0.1, 0.2), ((-1, 1), (-0.2, 0.7))
    picture, frame = still_film(*given)
    blank = picture.draw(0.55, frame).astype(int)
    frame["poincare"][0, 1, 0] = 0.3, -0.1
    drawn = picture.draw(0.55, frame)
    y, x = np.nonzero(np.abs(drawn - blank).max(axis=2))
    for panel, u in zip(picture.panels, (0.3, -0.1), strict=True):
        assert tuple(*spot(drawn, panel, 0.1, u)) == tuple(rgb(DIRECTIONS["up"]))
        column, row = panel.transData.transform((0.1, u))
        own = np.abs(len(drawn) - row - y) < 30
        assert y[own].mean() + 0.5 == pytest.approx(len(drawn) - row, abs=1)
        assert x[own].mean() + 0.5 == pytest.approx(column, abs=1)
        assert 9 <= own.sum() < 80
    assert (picture.draw(0.55, frame) == drawn).all()
    frame["poincare"][:] = np.nan
    assert (picture.draw(0.55, frame) == blank).all()


def test_bands_tell_the_contact_sets(made):
    data = open_results(made.file).isel(omega=0)
    picture = picture_of(made)
    assert set(picture.sets) >= set(np.unique(data["contact"].values).tolist())
    painted = picture.paint(0)
    for d, a in np.ndindex(*data["contact"].shape):
        wanted = rgb(contact_colour(int(data["contact"][d, a]), 2))
        shown = spot(painted, picture.bands, float(data["amplitude"][a]), d + 0.15)
        assert shown[0] == pytest.approx(wanted, abs=6)


@pytest.mark.slow
def test_gif_has_the_same_pictures_in_exact_colours(results, tmp_path):
    from PIL import Image

    request = Request(results, tmp_path / "o.gif", every=2, color="period", width=480, fps=20)
    check(request)
    assert film.make(request, Serial()) == 2
    view = picture_of(request)
    p1 = MOTION_COLOURS[motion_place(MotionClass.PERIODIC, 1)]
    with Image.open(request.output) as gif:
        assert gif.n_frames == 2
        assert gif.info["loop"] == 0
        assert gif.info["duration"] == 50
        for k, frame in enumerate((0, 2)):
            gif.seek(k)
            picture = np.asarray(gif.convert("RGB")).astype(int)
            wanted = view.paint(frame)
            assert np.abs(picture - wanted).mean() < 1
            own = np.all(wanted == rgb(p1), axis=2)
            assert own.sum() > 20
            assert np.abs(picture[own] - rgb(p1)).max() <= 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["o.gif"]


@pytest.mark.slow
@pytest.mark.parametrize("color", ["contact", "period"])
def test_colours_tell_the_class_of_the_run(made, tmp_path, color):
    request = replace(made, color=color)
    picture = picture_of(request)
    results = open_results(made.file)
    classes = classes_of(results)[0, 1]
    data = results.isel(omega=1, direction=0)
    painted = picture.paint(1)
    of = {
        "contact": lambda a: contact_colour(int(data["contact"][a]), 2),
        "period": lambda a: MOTION_COLOURS[motion_place(classes[a], data["orbit_period"][a])],
    }[color]
    for a in range(data.sizes["amplitude"]):
        at = float(data["amplitude"][a]), float(data["poincare"][a, 0, 0])
        assert spot(painted, picture.panels[0], *at)[0].tolist() == rgb(of(a)).tolist()


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks_make_the_same_film(made, monkeypatch):
    folder = made.output.parent
    common = ("--fps", "10", "--width", WIDTH)
    done = hpcsweep(2, "animate", made.file, "-o", folder / "ranks.mp4", *common)
    assert done.returncode == 0, done.stderr
    assert "4 frames" in done.stdout
    monkeypatch.setattr(film, "PIECE", 2)
    pieces = replace(made, output=folder / "pieces.mp4")
    assert film.make(pieces, Serial()) == 4
    assert (folder / "ranks.mp4").read_bytes() == made.output.read_bytes()
    assert len(decode(pieces.output)[0]) == 4
    assert not [p for p in folder.iterdir() if p.name.startswith(".")]


@pytest.mark.slow
@pytest.mark.mpi
def test_a_failing_encoder_ends_all_ranks(results, tmp_path):
    """No rank waits for ever, nothing is left behind."""
    out = tmp_path / "o.mp4"
    done = hpcsweep(2, "animate", results, "-o", out, IMAGEIO_FFMPEG_EXE="/bin/false")
    assert done.returncode != 0
    assert "ffmpeg ended with code 1" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_single_frames_are_read_as_the_whole_file_is(results, tmp_path):
    copy = tmp_path / "c.h5"
    content = bytearray(results.read_bytes())
    frames = Frames(results)
    block, _ = next(frames._blocks.verify(2))
    place = frames._blocks.places(block)["drift"][0]
    frames.close()
    content[place] ^= 1
    copy.write_bytes(content)
    whole = open_results(copy)
    assert 0 < int((whole["outcome"] == 0).sum()) < whole["outcome"].size
    frames = Frames(copy)
    for k in range(whole.sizes["omega"]):
        for name, values in frames.read(k, ("poincare", "contact", "outcome")).items():
            np.testing.assert_array_equal(values, whole[name].values[:, k])
    with pytest.raises(StoreError, match=r"output\.lyapunov"):
        frames.read(0, ("lyapunov",))
    frames.close()


def test_mistakes_take_one_line_and_write_nothing(results, tmp_path, capsys, monkeypatch):
    def fails(*arguments: object) -> str:
        assert cli.main(["animate", *map(str, arguments)]) == 2
        error = capsys.readouterr().err
        assert error.startswith("hpcsweep: error: ")
        assert error.count("\n") == 1
        assert list(tmp_path.iterdir()) == []
        return error

    out = tmp_path / "o.mp4"
    assert ".mp4 or .gif" in fails(results, "-o", tmp_path / "o.avi")
    assert "cannot be written" in fails(results, "-o", tmp_path / "no" / "o.mp4")
    assert "even" in fails(results, "-o", out, "--width", 641)
    assert "50" in fails(results, "-o", tmp_path / "o.gif", "--fps", 60)
    assert "cannot be read" in fails(tmp_path / "none.h5", "-o", out)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    assert "video" in fails(results, "-o", out)


def test_what_is_not_there_is_refused(results, tmp_path):
    up = parse_job(
        SMALL.replace("[output]", "[output]\ncontact = false").replace(
            "[sweep]", '[sweep]\ndirections = ["up"]'
        ),
        "up",
        "up",
    )
    path = tmp_path / "up.h5"
    assert campaign.run(up, path, Serial()) == 0
    request = Request(path, tmp_path / "o.mp4", width=WIDTH)
    with pytest.raises(StoreError, match=r"output\.contact"):
        check(replace(request, color="contact"))
    check(request)
    assert film.make(request, Serial()) == 4
    assert len(decode(request.output)[0]) == 4
    with pytest.raises(RuntimeError, match="ffmpeg ended with code"):
        film.encode(tmp_path / "none", tmp_path / "x.mp4", 25.0)


@pytest.mark.slow
def test_legends_keep_to_the_picture(still_film):
    """A dozen floors have long names of contact sets: what has no room is left out."""
    sets = [*range(4095, 4065, -1)]
    picture, _ = still_film("contact", sets, sets, 12)
    (legend,) = picture.figure.legends
    box, whole = legend.get_window_extent(), picture.figure.bbox
    assert 0 < box.x0 < box.x1 < whole.x1
    assert 0 < box.y0 < box.y1 < picture.panels[0].bbox.y0
    assert [text.get_text() for text in legend.texts][-1] == "16 rarer sets"
