"""A Slurm cluster of one node inside a folder, for tests: the daemons, and jobs on them.

Needs munge, slurmctld, slurmd and slurm-client (Debian's packages of these names), no systemd and
no configuration of the machine: key, sockets, ports, state and logs are the folder's. The daemons
and jobs end with this process, even when it is killed. Daemons and jobs run as the user who starts
it; installing the packages needs root, nothing else does. `bash benchmarks/run.sh slurm_cluster`
shows a job that is signalled, requeued and completed.
"""

import contextlib
import getpass
import os
import re
import secrets
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import slurm_watch
from tools import ROOT, environment, mpirun

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "squeue", "scancel")
SEARCH = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
ENDED = ("COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL", "OUT_OF_MEMORY")

CONF = """\
ClusterName=test
FirstJobId={first_job}
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SwitchType=switch/none
MailProg=/bin/true
ReturnToService=2
KillWait=5
JobRequeue=1
SchedulerParameters=sched_interval=2,batch_sched_delay=0,kill_invalid_depend
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=2000
PartitionName=main Nodes=ALL Default=YES MaxTime=1-0 State=UP
"""


class SlurmError(RuntimeError):
    """Raised where Slurm is missing, or fails a request."""


class Cluster:
    """A running cluster of one node with four CPUs; a context manager.

    Parameters
    ----------
    folder : Path
        Empty or absent; the path short enough for a socket in it (below 90 characters).

    Raises
    ------
    SlurmError
        If a program of `PROGRAMS` is missing or the node is not ready within 30 s; the message
        holds the end of the daemons' logs.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.conf = folder / "slurm.conf"
        self._mark = f"SLURM_CONF={self.conf}"
        self._daemons: list[subprocess.Popen] = []
        self._watch: subprocess.Popen | None = None

    def __enter__(self) -> "Cluster":
        missing = [name for name in PROGRAMS if shutil.which(name, path=SEARCH) is None]
        if missing:
            raise SlurmError(
                f"no {', '.join(missing)}: apt-get install munge slurmctld slurmd slurm-client"
            )
        try:
            self._start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_exception) -> None:
        self.stop()

    def _start(self) -> None:
        for name in ("state", "spool", "bin"):
            (self.folder / name).mkdir(parents=True)
        # munged insists on folders that only root or its user can write
        self.folder.chmod(0o755)
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        host = socket.gethostname().split(".")[0]
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            second.bind(("127.0.0.1", 0))
            ports = first.getsockname()[1], second.getsockname()[1]
        self.conf.write_text(
            CONF.format(
                host=host,
                folder=self.folder,
                user=getpass.getuser(),
                # MPICH names its shared memory after job and step: a segment that a killed job 1
                # of another cluster left on this machine makes MPI_Init of ours hang
                first_job=secrets.randbelow(60_000_000) + 1000,
                controller_port=ports[0],
                node_port=ports[1],
            )
        )
        (self.folder / "cgroup.conf").touch()
        self._make_hpcsweep()
        self._watch = slurm_watch.watch(self._mark)
        self._daemon(
            "munged",
            "--foreground",
            "--force",
            f"--key-file={key}",
            f"--socket={self.folder}/munge.socket",
            f"--pid-file={self.folder}/munged.pid",
            f"--log-file={self.folder}/munged.log",
            f"--seed-file={self.folder}/munged.seed",
        )
        self._until(lambda: (self.folder / "munge.socket").exists(), 10, "munged listens")
        self._daemon("slurmctld", "-D", "-f", str(self.conf))
        self._daemon("slurmd", "-D", "-f", str(self.conf))
        self._until(
            lambda: self.slurm("sinfo", "-h", "-o", "%t", check=False).strip() == "idle",
            30,
            "the node is idle",
        )

    def _make_hpcsweep(self) -> None:
        """Put the `hpcsweep` of this source tree, and its mpirun, on the jobs' PATH."""
        for name, line in (("hpcsweep", f'"{sys.executable}" -m hpcsweep'), ("mpirun", mpirun())):
            script = self.folder / "bin" / name
            script.write_text(f'#!/bin/sh\nexec {line} "$@"\n')
            script.chmod(0o755)

    def _daemon(self, name: str, *arguments: str) -> None:
        program = shutil.which(name, path=SEARCH)
        with (self.folder / f"{name}.out").open("w") as out:
            self._daemons.append(
                subprocess.Popen(
                    [program, *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=out,
                    env={**os.environ, "SLURM_CONF": str(self.conf), "PATH": SEARCH},
                    start_new_session=True,
                )
            )

    def _until(self, condition, seconds: float, what: str) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            dead = [p.args[0] for p in self._daemons if p.poll() is not None]
            if dead or time.monotonic() > deadline:
                logs = "\n".join(
                    f"-- {log.name}\n" + "\n".join(log.read_text().splitlines()[-15:])
                    for log in sorted(self.folder.glob("*.log")) + sorted(self.folder.glob("*.out"))
                )
                raise SlurmError(f"not so within {seconds} s: {what}; ended: {dead}\n{logs}")
            time.sleep(0.05)

    def stop(self) -> None:
        """End jobs and daemons, whatever state they are in; nothing is left running."""
        if len(self._daemons) == 3:
            with contextlib.suppress(subprocess.SubprocessError):
                self.slurm("scancel", "--user", getpass.getuser(), check=False)
        for daemon in reversed(self._daemons):
            daemon.terminate()
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        self._daemons.clear()
        slurm_watch.kill(self._mark)  # of jobs that have not yet ended
        if self._watch is not None:
            self._watch.stdin.close()
            self._watch.wait()

    def processes(self) -> set[int]:
        """Living processes that were started with this cluster's configuration."""
        return slurm_watch.marked(self._mark)

    def environment(self, **extra: str) -> dict[str, str]:
        """Environment of a user of the cluster."""
        own = {
            "SLURM_CONF": str(self.conf),
            "PATH": f"{self.folder}/bin{os.pathsep}{SEARCH}",
            "PYTHONPATH": str(ROOT),
        }
        inherited = {
            k: v for k, v in environment().items() if not k.startswith(("SLURM", "SBATCH"))
        }
        return {**inherited, **own, **extra}

    def slurm(
        self, *line: object, check: bool = True, cwd: Path | None = None, **extra: str
    ) -> str:
        """Run a command as a user of the cluster and return what it writes to standard output.

        Raises
        ------
        SlurmError
            If it fails and `check` is set.
        """
        done = subprocess.run(
            list(map(str, line)),
            cwd=cwd or self.folder,
            env=self.environment(**extra),
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        if check and done.returncode != 0:
            raise SlurmError(f"{line}: exit code {done.returncode}: {done.stderr}")
        return done.stdout

    def submit(self, *line: object, cwd: Path, **extra: str) -> str:
        """Submit a batch script with sbatch; return the job's id."""
        return self.slurm("sbatch", "--parsable", *line, cwd=cwd, **extra).strip()

    def job(self, job_id: str) -> dict[str, str]:
        """Output of ``scontrol show job``; empty once Slurm has forgotten the job."""
        text = self.slurm("scontrol", "show", "job", job_id, check=False)
        return dict(re.findall(r"(\S+?)=(\S*)", text.partition("\n\n")[0]))

    def wait(self, job_id: str, *states: str, seconds: float = 300) -> dict[str, str]:
        """Wait until a job is in one of the states (default: has ended); return the job.

        Raises
        ------
        SlurmError
            If it does not come to it in time, or ends in another state.
        """
        wanted = states or ENDED
        deadline = time.monotonic() + seconds
        while (job := self.job(job_id)).get("JobState") not in wanted:
            if job.get("JobState") in ENDED or time.monotonic() > deadline:
                raise SlurmError(f"job {job_id} is not {' or '.join(wanted)} but {job}")
            time.sleep(0.1)
        return job

    def start_now(self, job_id: str) -> None:
        """Start a requeued job without its two minutes of waiting."""
        self.wait(job_id, "PENDING")
        # slurmd takes a credential of the same second as the requeue for the one just revoked
        time.sleep(2)
        self.slurm("scontrol", "update", f"jobid={job_id}", "StartTime=now")

    def signal(self, job_id: str) -> None:
        """Send USR1 to the batch shell alone, as --signal=B:USR1@300 does before the time limit."""
        # scancel knows a task of an array by its own job id only
        self.slurm("scancel", "--batch", "--signal=USR1", self.job(job_id)["JobId"])


def launchers() -> dict[str, str]:
    """Return the commands that start hpcsweep with this environment's MPI under Slurm."""
    version = subprocess.run(
        [sys.executable, "-c", "from mpi4py import MPI; print(MPI.Get_library_version())"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return {"srun": f"srun --mpi={'pmix' if 'Open MPI' in version else 'pmi2'}", "mpirun": "mpirun"}


def edited(name: str, folder: Path, launch: str) -> Path:
    """Write a script of slurm/ with its two places edited, as a user of this cluster edits it."""
    text = (ROOT / "slurm" / name).read_text()
    for line, replacement in (
        (r"#SBATCH --account=my-account", "#SBATCH --account=test"),
        (r"module load python openmpi", ""),
        (r"\. ~/hpcsweep-env/bin/activate", "hash -r"),
        (r'launch="srun --mpi=pmix"', f'launch="{launch}"'),
    ):
        text, count = re.subn(f"^{line}$", replacement, text, flags=re.MULTILINE)
        assert count == 1, f"slurm/{name}: {count} lines are {line}"
    path = folder / name
    path.write_text(text)
    return path


def demonstrate() -> None:
    """Show a job that is submitted, signalled, requeued and completed."""
    import tempfile

    from test_slurm import LONG, wait_for_blocks

    with tempfile.TemporaryDirectory(prefix="slurm-") as name:
        folder = Path(name)
        with Cluster(folder / "cluster") as cluster:
            script = edited("requeue.sh", folder, launchers()["srun"])
            (folder / "long.toml").write_text(LONG)
            columns = "%.9i %.10j %.10T %.6M %.4C %r"

            def show(*line: str) -> None:
                print(f"$ {' '.join(line)}")
                print(cluster.slurm(*line, cwd=folder).rstrip(), flush=True)

            def show_job() -> None:
                show("squeue", "-o", columns)
                wanted = ("JobState", "Restarts", "ExitCode", "Requeue")
                job = cluster.job(job_id)
                print(f"$ scontrol show job {job_id}  # {', '.join(wanted)}")
                print("   " + " ".join(f"{key}={job[key]}" for key in wanted), flush=True)

            print("$ sbatch --ntasks=2 slurm/requeue.sh long.toml")
            job_id = cluster.submit("--ntasks=2", script, "long.toml", cwd=folder)
            print(job_id)
            wait_for_blocks(cluster, folder / "long.h5")
            show_job()
            print(f"$ scancel --batch --signal=USR1 {job_id}")
            cluster.signal(job_id)
            cluster.wait(job_id, "PENDING")
            show_job()
            show("hpcsweep", "status", "long.h5")
            print(f"$ scontrol update jobid={job_id} StartTime=now")
            cluster.start_now(job_id)
            cluster.wait(job_id)
            show_job()
            show("hpcsweep", "status", "long.h5")
            show("tail", "-n", "20", f"hpcsweep-{job_id}.log")


if __name__ == "__main__":
    demonstrate()
