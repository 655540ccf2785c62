"""A stiff slider against Newmark's sliding block, which has a closed form between two samples.

`bash benchmarks/run.sh sliding_block` takes the mass on a slider of strength m g to its rigid
limit: its lasting elongation under a record tends to the displacement of a block on friction, of
which the acceleration relative to the ground is -a(t) -+ g while it slides, a(t) linear between the
samples; it stops where its velocity, a parabola, is 0, and starts where |a| passes g (Newmark,
Geotechnique 15 (1965) 139). The spring rings when the block stops, without damping, and starts it
early: the distance falls slower than 1/k, faster than 1/sqrt(k). Nothing is taken from the package.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import math
from itertools import pairwise

import numpy as np

import hpcsweep

STIFFNESSES = tuple(10.0**power for power in range(3, 10))
"""k / m, 1/s^2."""


def roots(polynomial: list[float], before: float) -> list[float]:
    """Return the roots of a polynomial, highest power first, above 0 and before a time."""
    found = np.roots(np.trim_zeros(np.array(polynomial), "f"))
    real = found[np.isreal(found)].real
    return sorted(float(root) for root in real if 1e-13 < root < before)


def slid(samples: np.ndarray, dt: float, g: float) -> tuple[float, float]:
    """Return the displacement of a block at the end, and the way it has slid, from rest."""
    x, path, v, side = 0.0, 0.0, 0.0, 0
    for first, second in pairwise(np.asarray(samples, float).tolist()):
        t, slope = 0.0, (second - first) / dt
        while t < dt:
            a, left = first + slope * t, dt - t
            if side == 0:
                # at once where |a| is beyond g, or is g and grows
                beyond = abs(a) > g or (math.isclose(abs(a), g, rel_tol=1e-12) and a * slope > 0)
                if beyond:
                    side = -1 if a > 0 else 1
                    continue
                passes = [hit for level in (g, -g) for hit in roots([slope, a - level], left)]
                t += min(passes, default=left)
                continue
            # v(s) = v - (a + side g) s - slope s^2 / 2
            stops = roots([-0.5 * slope, -(a + side * g), v], left)
            s = stops[0] if stops else left
            way = v * s - 0.5 * (a + side * g) * s**2 - slope * s**3 / 6.0
            v -= (a + side * g) * s + 0.5 * slope * s**2
            x, path, t = x + way, path + abs(way), t + s
            if stops:
                v, side = 0.0, 0
    return x, path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--friction", type=float, default=1.0, help="g, m/s^2")
    options = parser.parse_args()
    record = hpcsweep.synthetic_records(1, seed=1, duration=30.0)[0]
    x, path = slid(record.acceleration, record.dt, options.friction)
    known = f"PGA {record.peak:.3g} m/s^2, friction {options.friction:g}"
    print(f"{known}: at {x:.6f} m, slid {path:.6f} m")
    for k in STIFFNESSES:
        slider = hpcsweep.Slider((1.0,), k, options.friction)
        structure = hpcsweep.Structure.from_matrices([1.0], [[0.0]], [], sliders=[slider])
        found = hpcsweep.response(structure, record)
        print(
            f"k / m = {k:.0e} 1/s^2: lasting {found.plastic[0]:.6f} m, error "
            f"{abs(found.plastic[0] - x) / path:.1e} of the way, way "
            f"{abs(found.plastic_path[0] / path - 1.0):.1e}, {found.excursions[0]} slips"
        )


if __name__ == "__main__":
    main()
