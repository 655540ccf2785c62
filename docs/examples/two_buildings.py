"""Two buildings that pound each other: peak drift per storey, force, impacts, for three gaps.

python docs/examples/two_buildings.py computes jobs/structures/two-buildings.toml where its results
are not there yet, and prints and draws what an engineer asks of it.
"""

import math
import subprocess
from pathlib import Path

import hpcsweep

JOB = Path(__file__).resolve().parents[2] / "jobs" / "structures" / "two-buildings.toml"


def main() -> None:
    """Compute, print and draw."""
    file = Path("two-buildings.h5")
    subprocess.run(["hpcsweep", "describe", JOB], check=True)
    subprocess.run(["hpcsweep", "run", JOB, "-o", file], check=True)
    results = hpcsweep.open_results(file)
    at = results.sel(direction="up").sel(amplitude=3.0, method="nearest")
    hertz = at.omega / (2.0 * math.pi)
    unit = at.amplitude.attrs["units"]
    print(f"sweep up, at a base acceleration of {float(at.amplitude):.3g} {unit}")
    for gap in at.gap.values.tolist():
        own = at.sel(gap=gap)
        ratio = 100.0 * own.storey_drift / results.storey_height
        print(f"gap {gap} {at.gap.attrs['units']}: largest drift ratio at any frequency (%)")
        print(ratio.max("omega").to_series().round(2).to_string())
        force = own.contact_force.max("stop")
        place = int(force.argmax("omega"))
        print(f"largest force {float(force.max()):.3g} N, at {float(hertz[place]):.3g} Hz")
        there = own.isel(omega=place)
        impacts, speed = float(there.impacts.sum("stop")), float(there.impact_velocity.max("stop"))
        print(f"there {impacts:.3g} impacts a forcing period on all floors, up to {speed:.3g} m/s")
    for kind, more in (("measures", ("--at", "gap=0.05")), ("vary", ())):
        name = f"two-buildings-{kind}.png"
        draw = ("hpcsweep", "plot", file, "--kind", kind, "--omega", "12.566", *more, "-o", name)
        subprocess.run(draw, check=True)


if __name__ == "__main__":
    main()
