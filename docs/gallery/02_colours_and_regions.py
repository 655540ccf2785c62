"""
What the colours and regions mean
=================================

The same sweeps drawn three times: by direction, by orbit period and by contact set. The Roman
numbers along the top divide the amplitudes into regions in which the same contacts close; they
stand in every orbit diagram.
"""

from pathlib import Path

from shell import shell

Path("colours.toml").write_text("""\
[structure]
n_floors = 3
stiffness_ratio = 1000.0
damping_ratio = [0.1262, 0.0161, 0.0077]   # one per mode, lowest frequency first

[sweep]
omega = 0.445
amplitude = {from = 0.035, to = 0.25, count = 216}

[output]
lyapunov = true                            # tells chaos from long orbits
""")
shell("mpirun -n 2 hpcsweep run colours.toml -o colours.h5")

# %%
# **By direction** (default). Where the two colours lie apart two motions coexist, and the history
# decides which of them is met: hysteresis.
shell("hpcsweep plot colours.h5 --floor 3 -o colours-direction.png")

# %%
# **By orbit period**: how many forcing periods pass before the motion repeats itself. P2, P4 and
# so on have a colour each; chaos, which never repeats, is black and fine.
shell("hpcsweep plot colours.h5 --floor 3 --color period -o colours-period.png")

# %%
# **By contact set**: C23 means that floors 2 and 3 hit the stop at some time of the steady motion.
# The more contacts, the darker.
shell("hpcsweep plot colours.h5 --floor 3 --color contact -o colours-contact.png")
