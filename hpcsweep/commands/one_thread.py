"""One thread of linear algebra a process: import this before numpy.

Every rank has a core. BLAS would start a thread on each core for each of them, and products of
small matrices then wait for threads that wait for a core: with 50 floors and two busy cores the
tables of `flow` took 5 to 20 times as long. Who sets the variables is not overruled.
"""

import os

VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")

for _name in VARIABLES:
    os.environ.setdefault(_name, "1")
