"""Colours and names the figures share: legible in print and to the colour-blind."""

from pathlib import Path

import numpy as np

PALETTE = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#E69F00",
    "#332288",
    "#882255",
    "#117733",
    "#999933",
)
"""Okabe and Ito's colours, then Tol's."""
UNDECIDED = "#8c8c8c"
DPI = 200


class PlotError(ValueError):
    """What was asked cannot be drawn; the message is one line for the user."""


def contact_name(contact: int, n_floors: int) -> str:
    """Write a contact set as C with the numbers of its floors, e.g. C23; 'none' if empty."""
    floors = [str(i + 1) for i in range(n_floors) if contact >> i & 1]
    if not floors:
        return "none"
    return "C" + (",".join(floors) if n_floors > 9 else "".join(floors))


def new_figure(n_rows: int, height: float, width: float = 7.2):
    """Make a figure of stacked panels with a common horizontal axis.

    Returns
    -------
    figure, list of axes
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        n_rows, 1, figsize=(width, height), sharex=True, squeeze=False, layout="constrained"
    )
    for axis in axes[:, 0]:
        axis.grid(True, color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, list(axes[:, 0])


def save(figure, path: Path) -> None:
    """Write a figure to disk and free it."""
    from matplotlib import pyplot

    try:
        figure.savefig(path, dpi=DPI)
    except ValueError as error:
        raise PlotError(f"{path}: {error}") from None
    finally:
        pyplot.close(figure)


def roman(number: int) -> str:
    """Write a positive number in lower-case Roman numerals."""
    digits = ((100, "c"), (90, "xc"), (50, "l"), (40, "xl"), (10, "x"), (9, "ix"), (5, "v"))
    text = ""
    for value, letters in (*digits, (4, "iv"), (1, "i")):
        while number >= value:
            text += letters
            number -= value
    return text


def nearest_frame(omegas: np.ndarray, omega: float | None) -> int:
    """Return the frame nearest to a frequency, the first if none is asked for."""
    if omega is None:
        return 0
    if not np.isfinite(omega):
        raise PlotError(f"--omega {omega}: must be finite")
    return int(np.argmin(np.abs(omegas - omega)))
