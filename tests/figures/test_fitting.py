"""Words and legends stay within the picture, names of different contact sets stay different."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from hpcsweep.figures import style
from hpcsweep.figures.diagrams import orbit_diagram, sweep
from hpcsweep.figures.labels import broken, legend_below
from hpcsweep.figures.style import limit_amplitudes, new_grid, rarer_sets, set_name, set_names
from hpcsweep.model.structure import Structure


def within(figure) -> bool:
    """Return whether head and legends lie between the sides of a figure."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    words = [*figure.legends, *([figure._suptitle] if figure._suptitle else [])]
    boxes = [one.get_window_extent(renderer) for one in words]
    assert boxes
    return all(box.x0 >= 0 and box.x1 <= figure.bbox.width for box in boxes)


def handles(count: int, letters: int) -> list:
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=f"{k:0{letters}}") for k in range(count)]


def test_a_legend_has_as_many_columns_as_fit():
    figure, _ = new_grid(1, 1, (4.0, 3.0))
    control = figure.legend(handles=handles(8, 14), ncols=8, fontsize=8)
    assert not within(figure)
    control.remove()
    title = "Runs: no contact 13.3 %, periodic 75.0 %, long period 3.3 %, chaotic 8.3 %; more " * 2
    legend = legend_below(figure, handles(8, 14), title)
    assert within(figure)
    assert 1 < legend._ncols < 8
    assert "\n" in legend.get_title().get_text()
    assert legend.get_title().get_text().split() == title.split()
    legend.remove()
    assert legend_below(figure, handles(8, 1), "few", 4)._ncols == 4
    assert within(figure)


def test_lines_break_between_parts_only_where_they_must():
    assert broken("a b c\nd", lambda line: len(line) < 4, " ") == "a b\nc\nd"
    assert broken("one; two; three", lambda line: len(line) < 10, "(?<=;) ") == "one; two;\nthree"
    part = "Sa(1 s; 5 %) = 2,  yes; no"
    assert broken(part, lambda line: len(line) < 12) == "Sa(1 s; 5 %) = 2,\nyes; no"
    assert broken("unbreakable", lambda line: False, " ") == "unbreakable"


def test_a_head_of_many_varied_keys_stays_within_the_picture():
    figure, _ = new_grid(1, 1, (4.0, 3.0))
    keys = [f"building_{k}_damping_ratio = 0.02" for k in range(4)]
    assert within(style.head(figure, ", ".join(keys)))
    assert figure._suptitle.get_text().split(",") == [keys[0], *(f"\n{key}" for key in keys[1:])]


@pytest.mark.parametrize("module", [sweep.frames, orbit_diagram.orbit])
def test_a_figure_of_one_frequency_keeps_its_words(module, results, drawn_figure):
    one = results.isel(omega=[0])
    options = {"color": "contact"} if module is orbit_diagram.orbit else {}
    assert within(drawn_figure(module, one, **options))


def test_shortened_names_of_different_sets_differ():
    labels = Structure(12, gap_left=1.0).contact_labels
    common = sum(1 << k for k in (0, 2, 4, 6, 8, 10, 12, 14, 16))
    sets = [common | 1 << k for k in range(18, 24)]
    short = [set_name(contact, labels) for contact in sets]
    assert len(set(short)) < len(sets)
    names = set_names(sets, labels)
    assert len(set(names)) == len(sets)
    assert set_names([*sets, sets[0]], labels)[-1] == names[0]
    few = [0, 0b110, 0b1110]
    assert set_names(few, 12) == [set_name(contact, 12) for contact in few]
    assert (rarer_sets(1), rarer_sets(2)) == ("1 rarer set", "2 rarer sets")


def test_outer_points_of_few_amplitudes_have_room():
    _, axes = new_grid(1, 1, (4.0, 3.0))
    axis = axes[0, 0]
    limit_amplitudes(axis, np.array([1.0, 3.0]))
    assert axis.get_xlim() == pytest.approx((0.96, 3.04))
    limit_amplitudes(axis, np.array([2.0]))
    low, high = axis.get_xlim()
    assert low < 2.0 < high
    limit_amplitudes(axis, np.linspace(0.0, 1.0, style.FEW + 1))
    assert axis.get_xlim() == (0.0, 1.0)


def test_two_motions_of_one_contact_set_are_told_by_their_number():
    assert orbit_diagram._names((1, 3), 2, None) == ["C1", "C12"]
    assert orbit_diagram._names((1, 1), 2, None) == ["2 × C1"]


def test_regions_of_shortened_sets_stay_two_and_are_listed_whole():
    import xarray

    labels = Structure(12, gap_left=1.0).contact_labels
    common = sum(1 << k for k in (0, 2, 4, 6, 8, 10, 12, 14, 16))
    sets = [0] * 30 + [common | 1 << 19] * 5 + [common | 1 << 21] * 5
    contact = np.array([sets, sets], np.uint64)
    amplitude = np.linspace(0.1, 0.2, 40)
    frame = xarray.Dataset(
        {"contact": (("direction", "amplitude"), contact)}, {"amplitude": amplitude}
    )
    _, axes = new_grid(1, 1, (5.0, 3.0))
    done = np.ones(contact.shape, bool)
    study = SimpleNamespace(run_dims=("direction", "omega", "amplitude"))
    one = SimpleNamespace(along=amplitude, runs=frame, done=done, study=study)
    note = orbit_diagram._mark_regions([axes[0, 0]], one, labels, np.zeros(40, bool))
    shown = [text.get_text() for text in axes[0, 0].texts]
    assert [one.split("\n")[0] for one in shown] == ["(i)", "(ii)", "(iii)"]
    assert shown[1].endswith("...")
    assert shown[1] != shown[2]
    told = note.replace("\u00a0", " ")
    assert "(i) to (iii): amplitudes of one contact set" in told
    for number, last in (("ii", "8"), ("iii", "10")):
        assert f"({number}) C1,3,5,7,9,11,1L,3L,5L,{last}L" in told
