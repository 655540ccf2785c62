"""Flags: sliders that slip back home, p = 0, with less force than they have slipped out with.

Where p > 0 a flag slips out at F and back at R < F until it is home, and sticks between; likewise
below, with the signs turned. At home +-F are its limits. Beside a spring alpha k its loop through
F_y = F / (1 - alpha) comes back to the line of the first loading at the force R / (1 - alpha).
Along a path of p the work of the force is F where p goes out and R where it comes back,

    F out - R back = (F - R) / 2 (out + back) + (F + R) / 2 (out - back),    out - back = |p|,

of which the flag takes the former, and gives the latter back.
"""


def flag_modes(key: int, out: float, back: float) -> list[tuple[tuple, list[tuple]]]:
    """Return the modes of a flag that slips at elongations `out` and `back`, those at home first.

    To each side it slips out, sticks and slips back, see `hpcsweep.model.slider.Slider.modes`.
    """
    home = [(1, 1.0, 1.0, 0.0, out), (4, -1.0, 1.0, 0.0, -out)]
    modes: list[tuple[tuple, list[tuple]]] = [((0, 0, 0.0, 0.0), [*home])]
    for m, s in (1, 1.0), (4, -1.0):
        far, near, turns = s * out, s * back, (0.0, 1.0 / out, 0.0, 0.0, 1.0)
        comes_home = (0, -s, 1.0, 0.0, near, 0.0, 1.0, -near)
        ends = [(m, s, 1.0, 0.0, far, 1.0), (m + 2, -s, 1.0, 0.0, near, 1.0)]
        modes += [
            ((0, key, -far, 0.0), [(m + 1, -s, *turns, -far)]),
            ((0, 0, 0.0, 1.0), [*ends]),
            ((0, key, -near, 0.0), [(m + 1, s, *turns, -near), comes_home]),
        ]
    return modes
