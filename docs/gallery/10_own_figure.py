"""
A figure of your own, with xarray and pandas
============================================

A results file is an ``xarray.Dataset``: dimensions with names, coordinates with values, units as
attributes.
"""

from pathlib import Path

import matplotlib.pyplot as plt
from shell import shell

import hpcsweep

Path("own.toml").write_text("""\
[structure]
n_floors = 3
stiffness_ratio = 1000.0

[sweep]
omega = {from = 0.35, to = 0.6, count = 26}
amplitude = {from = 0.01, to = 0.25, count = 25}
directions = ["up"]
""")
shell("mpirun -n 2 hpcsweep run own.toml -o own.h5")

# %%
# One row a run, numbers put into words, in pandas:
results = hpcsweep.open_results("own.h5").sel(direction="up")
table = (
    results[["drift", "orbit_period"]]
    .assign(contact=hpcsweep.meanings(results.contact))
    .to_dataframe()
)
print(table.groupby("contact").drift.describe().round(3).to_string())

# %%
# And as a picture: how impacts change the drift of the same building without a stop.
structure = hpcsweep.load_job("own.toml").structure
figure, axis = plt.subplots(figsize=(7, 3.4), layout="constrained")
for amplitude in (0.05, 0.1, 0.2):
    line = results.drift.sel(amplitude=amplitude, method="nearest")
    axis.plot(line.omega, line, ".-", label=f"A = {float(line.amplitude):.2f}")
axis.axvline(structure.frequencies[0], color="0.6", ls=":", label="first natural frequency")
axis.set_xlabel("Ω  [ω₀]")
axis.set_ylabel("drift δ  [A/Ω²]")
axis.legend()
plt.show()
