"""
Two buildings in metres, kilograms and hertz
============================================

Two buildings of three and five storeys stand 5 cm apart and pound each other at the levels where
their floors face. Nothing is converted behind your back: the job names its units, and files,
messages and figures carry them.
"""

from pathlib import Path

from shell import shell

import hpcsweep

Path("pounding.toml").write_text("""\
[units]
length = "m"
mass = "kg"
time = "s"

[[building]]
name = "A"
mass = [2.5e5, 2.5e5, 2.0e5]
storey_stiffness = [3e8, 3e8, 2e8]
storey_height = 3.2

[[building]]
name = "B"
mass = [2.5e5, 2.5e5, 2.5e5, 2.5e5, 2.0e5]
storey_stiffness = 4e8
storey_height = 3.2

[pounding]
gap = 0.05
stiffness = 2e9

[sweep]
frequency = 2.0
amplitude = {from = 0.05, to = 5.0, count = 100}
directions = ["up"]

[output]
storey_drift = true
displacement = true
contact_force = true
impacts = true
""")
shell("hpcsweep describe pounding.toml")

# %%
shell("mpirun -n 2 hpcsweep run pounding.toml -o pounding.h5")
shell("hpcsweep plot pounding.h5 --kind measures -o pounding.png")

# %%
# The numbers, with their units:
results = hpcsweep.open_results("pounding.h5").squeeze()
strongest = results.sel(amplitude=3.0, method="nearest")
print(strongest.contact_force.to_pandas(), results.contact_force.attrs["units"])
print(strongest.storey_drift.to_pandas(), results.storey_drift.attrs["units"])
