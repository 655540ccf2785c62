#!/bin/bash
# Run a job for as many time limits as it takes, where sites forbid requeueing: a chain of jobs
# submitted at once, each waiting for the one before. Start it with bash, not with sbatch:
#     bash slurm/chain.sh LINKS JOB.toml [options of sbatch]
# A link goes on where the one before stopped, was killed or lost a node. When the job is complete
# the links left over are cancelled; also after a mistake or a failure, or when a whole time limit
# gave no progress. All links write one log.

# Edit, 1 of 2: the account that pays; then tasks and time as the job needs: what
#     hpcsweep run JOB.toml --dry-run
# prints last.
#SBATCH --account=my-account
#SBATCH --ntasks=64
#SBATCH --time=04:00:00
# USR1 to this shell 300 s before the time limit (Slurm may be 60 s early).
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append

if [ "$1" != --link ]; then
    usage="usage: bash chain.sh LINKS JOB.toml [options of sbatch]"
    links=${1:?$usage}
    job=${2:?$usage}
    [ "$links" -ge 1 ] || { echo "$usage" >&2; exit 2; }
    shift 2
    name=$(basename "$job" .toml)-$(date +%Y%m%d-%H%M%S)
    after=()
    for ((link = 1; link <= links; link++)); do
        id=$(sbatch --parsable --job-name="$name" --output=%x.log "${after[@]}" "$@" \
            "$0" --link "$job") || exit
        id=${id%%;*}  # id;cluster where there are several
        after=(--dependency=afternotok:"$id" --kill-on-invalid-dep=yes)
        echo "$id"
    done
    echo "to cancel all: scancel --name=$name" >&2
    exit
fi

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

job=$2
results=${job%.toml}.h5
before=$(runs_done "$results")
run "$job" "$results"
code=$?
case $code in
    0) end="complete" ;;
    75)
        end=
        if [ "$(runs_done "$results")" = "${before:-0}" ]; then
            end="no progress; give more --time or a smaller output.block"
        fi ;;
    *) end="exit code $code" ;;
esac
if [ -n "$end" ]; then  # all at once: a cancelled link counts as failed and would start the next
    echo "the chain ends: $end" >&2
    scancel --state=PENDING --name="$SLURM_JOB_NAME" --user="$(id -un)"
fi
exit "$code"
