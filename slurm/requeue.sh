#!/bin/bash
# Run a job for as many time limits as it takes: before each it stops in good order (exit code 75)
# and puts itself back into the queue, under the same job id and into the same log.
#     sbatch slurm/requeue.sh JOB.toml [RESULTS.h5]     (default: JOB.h5 beside the job file)
# It is not requeued when complete (0), after a mistake (2) or a failure, when cancelled, when a
# whole time limit gave no progress, or after HPCSWEEP_MAX_RESTARTS (50) restarts.
# Slurm holds a requeued job for two minutes; scontrol update jobid=N StartTime=now does not wait.

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

runs_done() {
    hpcsweep status "$1" --json 2>/dev/null | sed -n 's/.*"runs_done": \([0-9]*\).*/\1/p'
}

# Run a job and, if it stopped in good order, put this Slurm job back into the queue.
run_and_requeue() {
    local restarts=${SLURM_RESTART_COUNT:-0} most=${HPCSWEEP_MAX_RESTARTS:-50} before code
    local id=${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_}${SLURM_ARRAY_TASK_ID:-$SLURM_JOB_ID}
    if [ "$restarts" -gt "$most" ]; then  # Slurm too requeues, when a node fails
        echo "not run: restarted $restarts times, HPCSWEEP_MAX_RESTARTS is $most" >&2
        return 75
    fi
    before=$(runs_done "$2")
    run "$1" "$2"
    code=$?
    [ "$code" -eq 75 ] || return "$code"
    if [ "$(runs_done "$2")" = "${before:-0}" ]; then
        echo "not requeued: no progress; give more --time or a smaller output.block" >&2
    elif [ "$restarts" -ge "$most" ]; then
        echo "not requeued: restarted $restarts times, HPCSWEEP_MAX_RESTARTS is $most" >&2
    else
        echo "requeued, to resume (restart $((restarts + 1)) of at most $most)" >&2
        scontrol requeue "$id" || echo "scontrol requeue failed: use slurm/chain.sh here" >&2
    fi
    return "$code"
}

job=${1:?usage: sbatch requeue.sh JOB.toml [RESULTS.h5]}
run_and_requeue "$job" "${2:-${job%.toml}.h5}"
