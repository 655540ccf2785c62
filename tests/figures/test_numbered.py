"""Numbers of special points: near ones share a label, which keeps clear of lines."""

import numpy as np

from hpcsweep.figures import style
from hpcsweep.figures.diagrams import branches as numbered


def test_near_points_share_a_label_with_their_numbers():
    at = np.array([[0.0, 0.0], [3.0, 2.0], [50.0, 0.0], [5.0, -4.0], [51.0, 1.0]])
    groups = numbered.together(at)
    assert groups == [[0, 1, 3], [2, 4]]


def test_labels_keep_clear_of_lines_and_within_the_panel():
    figure, axes = style.new_grid(1, 1, (4.0, 3.0))
    axis = axes[0, 0]
    axis.plot([0.0, 1.0], [0.0, 1.0])
    axis.set(xlim=(0, 1), ylim=(0, 1))
    figure.draw_without_rendering()
    x = np.array([0.0, 0.5, 0.5, 1.0])
    numbered.number(axis, x, x)
    assert [text.get_text() for text in axis.texts] == ["1", "2,3", "4"]
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    for text in axis.texts:
        box = text.get_window_extent(renderer)
        corners = axis.transData.inverted().transform(box.corners())
        assert corners.min() >= -0.005
        assert corners.max() <= 1.005
        below = corners[:, 1] < corners[:, 0]
        assert below.all() or not below.any()


def test_the_list_widens_the_figure_by_its_columns():
    from matplotlib.lines import Line2D

    figure, _ = style.new_grid(1, 1, (7.2, 3.0))
    each = int(3.0 / numbered.ROW) - 3
    rows = [str(k) for k in range(each + 2)]
    numbered.list_beside(figure, rows, [Line2D([], [])] * len(rows), "title")
    assert figure.get_size_inches()[0] == 7.2 + 2 * numbered.COLUMN_WIDTH
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == rows
