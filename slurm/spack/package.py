# Recipe for Spack: a package of a repository of one's own, py_hpcsweep/package.py in its packages/.
# There is no release yet: with the clone in FOLDER,
#     spack dev-build py-hpcsweep@main          in the clone
#
# Checked by tests/packaging/test_recipes.py: that it lists what pyproject.toml needs with the same
# bounds. Checked once: that each name is a package of spack-packages of 2026-07-01. NOT checked: it
# was never concretised or built, Spack was not at hand.
from spack.package import *
from spack_repo.builtin.build_systems.python import PythonPackage


class PyHpcsweep(PythonPackage):
    """Parameter studies of base-excited structures impacting a rigid stop, over MPI."""

    homepage = "https://example.org/hpcsweep"  # there is no page yet

    license("BSD-3-Clause")

    version("main", branch="main", git="file:///path/of/a/clone")

    depends_on("py-setuptools@77:", type="build")

    with default_args(type=("build", "run")):
        depends_on("python@3.11:")
        depends_on("py-numpy@2.0.2:")
        depends_on("py-scipy@1.13.1:")
        depends_on("py-numba@0.62:0.68")
        depends_on("py-h5py@3.12.1:")
        depends_on("py-h5netcdf@1.3:")
        depends_on("py-xarray@2024.6:")
        depends_on("py-matplotlib@3.8.4:")
        depends_on("py-tqdm@4.66.1:")
        depends_on("py-mpi4py@4.1:")
