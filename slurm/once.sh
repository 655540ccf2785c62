#!/bin/bash
# Run a job once, at most for its time limit:
#     sbatch slurm/once.sh JOB.toml [RESULTS.h5]        (default: JOB.h5 beside the job file)
# The exit code is hpcsweep's: 0 complete; 75 stopped in good order before the time limit, submit
# again to go on; 2 a mistake, told in one line of the log.

# Edit, 1 of 2: the account that pays; then tasks and time as the job needs: what
#     hpcsweep run JOB.toml --dry-run
# prints last.
#SBATCH --account=my-account
#SBATCH --ntasks=64
#SBATCH --time=04:00:00
# USR1 to this shell 300 s before the time limit (Slurm may be 60 s early).
#SBATCH --signal=B:USR1@300
#SBATCH --job-name=hpcsweep
#SBATCH --output=%x-%j.log
# If a node fails Slurm may start the job again: it goes on where the results file ends.
#SBATCH --requeue
#SBATCH --open-mode=append

# Edit, 2 of 2: what makes hpcsweep and its MPI available here, and how an MPI program starts.
module load python openmpi
. ~/hpcsweep-env/bin/activate
launch="srun --mpi=pmix"
# Open MPI: "srun --mpi=pmix". MPICH: "srun --mpi=pmi2". Either: "mpirun", the one of the MPI that
# mpi4py uses; it reads nodes and tasks from Slurm. srun --mpi=list tells what the site has.
# A launcher of another MPI is refused: hpcsweep says so in one line.

# Run a job on all ranks. Slurm's signal reaches this shell alone (B:), srun and mpirun alike hand
# it on to the ranks, and these stop in good order.
run() {
    $launch hpcsweep run "$1" -o "$2" &
    ranks=$!
    trap 'kill -USR1 "$ranks"' USR1
    while kill -0 "$ranks" 2>/dev/null; do wait "$ranks"; done  # a signal ends wait, not the ranks
    wait "$ranks"
}

job=${1:?usage: sbatch once.sh JOB.toml [RESULTS.h5]}
run "$job" "${2:-${job%.toml}.h5}"
