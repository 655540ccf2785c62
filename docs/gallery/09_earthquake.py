"""
Two buildings in an earthquake, and a fragility function
========================================================

Two buildings stand 2 cm apart. Every record of a suite is scaled until they pound each other hard:
an incremental dynamic analysis. Between the samples of a record and the contacts the motion is
exact. The suite is synthetic, so that the example runs anywhere; ``hpcsweep.read_record`` reads
recorded ground motions.
"""

import matplotlib.pyplot as plt
import numpy as np

import hpcsweep

a = hpcsweep.Building(mass=[2.5e5] * 3, storey_stiffness=3e8, storey_height=3.2, name="A")
b = hpcsweep.Building(mass=[2.5e5] * 5, storey_stiffness=2e8, storey_height=3.2, name="B")
pair = hpcsweep.adjacent([a, b], gap=0.02, stiffness=2e9)
suite = hpcsweep.synthetic_records(12, seed=1, dt=0.01, duration=20.0, rms=1.0)
period = 2 * np.pi / pair.frequencies[0]
print(f"{pair.n_floors} floors, first period {period:.2f} s, PGA {suite[0].peak:.2f} m/s^2")

# %%
# The intensity is the spectral acceleration at the first period. Below the scale of first contact
# the response is linear, and known from one history.
stripes = np.linspace(0.5, 12.0, 24)
sa = np.array([hpcsweep.spectrum(record, [period]).acceleration[0] for record in suite])
first = np.array([hpcsweep.first_contact_scale(pair, record) for record in suite]) * sa
print(f"first contact at Sa = {np.sort(first).round(2)}")

responses = [
    [hpcsweep.response(pair, record, scale=stripe / own, tail=2.0) for stripe in stripes]
    for record, own in zip(suite, sa, strict=True)
]
drift = np.array([[one.drift.max() for one in row] for row in responses])
impacts = np.array([[one.impacts.sum() for one in row] for row in responses])
print(f"{drift.size} histories, up to {impacts.max()} impacts each")

# %%
# The analysis: records in grey, counted fractiles in black.
low, middle, high = hpcsweep.fractiles(drift)
figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
axis.plot(1000 * drift.T, stripes, color="0.7", lw=0.8)
axis.plot(1000 * middle, stripes, "k", lw=2, label="50 %")
axis.plot(1000 * low, stripes, "k--", lw=1, label="16 and 84 %")
axis.plot(1000 * high, stripes, "k--", lw=1)
axis.set(xlabel="largest storey drift  [mm]", ylabel="Sa at the first period  [m/s²]")
axis.legend()
plt.show()

# %%
# Fragility: how likely is a drift of 20 mm, at which intensity?
exceeded = np.count_nonzero(drift >= 0.02, axis=0)
fit = hpcsweep.capacity_fragility(hpcsweep.capacity(stripes, drift, 0.02))
print(f"median {fit.median:.2f} m/s^2, dispersion {fit.dispersion:.2f}")
fine = np.linspace(0.1, 12.0, 200)
lower, upper = fit.band(fine)
figure, axis = plt.subplots(figsize=(6, 3.5), layout="constrained")
axis.fill_between(fine, lower, upper, color="0.85", label="95 % confidence band")
axis.plot(fine, fit.probability(fine), "k", label="fragility")
axis.plot(stripes, exceeded / len(suite), "C0o", ms=4, label="stripes")
axis.set(xlabel="Sa at the first period  [m/s²]", ylabel="probability of a drift of 20 mm")
axis.legend()
plt.show()
