"""Limit linear algebra to one thread a process: import this before numpy.

Every rank has one core. BLAS would start a thread on each core for every rank, and products of
small matrices would wait for threads that wait for a core: with 50 floors and two busy cores the
tables of `flow` took 5 to 20 times as long. Variables that the user has set are kept.
"""

import os

VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")

for _name in VARIABLES:
    os.environ.setdefault(_name, "1")
