"""A Slurm of one node, started without any service manager, for as long as a test takes."""

import contextlib
import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

_CONFIGURATION = Path("/etc/slurm/slurm.conf")
"""Where Slurm looks: Snakemake takes all of its variables out of the environment of jobs."""
_NEEDED = ("slurmctld", "slurmd", "munged", "sbatch", "squeue", "sinfo")
_PATIENCE = 30.0
"""Between two looks at what has become of jobs and nodes, s."""
_CONF = """
ClusterName=test
SlurmctldHost={host}
AuthType=auth/munge
CryptoType=crypto/munge
AuthInfo=socket={folder}/munge/socket
SlurmUser=root
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=2,bf_interval=2
MpiDefault=none
ReturnToService=2
MinJobAge=3600
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
NodeName={host} CPUs={cpus} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """What must be installed first; nothing if a Slurm can be started."""
    if os.geteuid() != 0:
        return "root"
    if _CONFIGURATION.exists():
        return f"a machine without {_CONFIGURATION}"
    return ", ".join(name for name in _NEEDED if _found(name) is None)


def _found(name):
    return shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")


class Slurm:
    """The daemons, and the environment in which its commands find them.

    Args:
        folder: For all its files.
    """

    def __init__(self, folder):
        self.folder = Path(folder)
        self._host = host = socket.gethostname().split(".")[0]
        for name in ("munge", "state", "spool"):
            (self.folder / name).mkdir(parents=True)
        # munged wants its folders to itself.
        for path in (self.folder, self.folder / "munge"):
            path.chmod(0o755)
        key = self.folder / "munge" / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        conf = _CONFIGURATION
        cpus = os.cpu_count() or 1
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
        conf.parent.mkdir(parents=True, exist_ok=True)
        conf.write_text(
            _CONF.format(host=host, folder=self.folder, cpus=cpus, memory=int(0.9 * memory))
        )
        self.environment = {**os.environ, "PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin"}
        self._munge = self._started(
            "munged", "--foreground", "--force", "--key-file", key, "--socket",
            self.folder / "munge" / "socket", "--pid-file", self.folder / "munge" / "pid",
            "--log-file", self.folder / "munge" / "log", "--seed-file", self.folder / "munge" / "seed",
        )  # fmt: skip
        time.sleep(1)
        self.start_controller()
        self._node = self._started("slurmd", "-D", "-N", host)
        self._wait()

    def start_controller(self):
        """Start the controller, or start it again."""
        self.controller = self._started("slurmctld", "-D")

    def kill_controller(self, after):
        """Kill the controller some seconds from now, and start it again."""
        time.sleep(after)
        self.controller.kill()
        self.controller.wait()
        self.start_controller()
        self._wait()
        with contextlib.suppress(subprocess.CalledProcessError):
            self._attend()

    def _attend(self):
        """What an operator does after a controller was killed.

        Nodes register, so that it learns what ended while it was away; of itself it would ask in half an hour. A
        controller killed between the start of a job and the note of it starts that job twice, drains the node that
        refuses the second copy, and holds the job: the one is resumed, the other released.
        """
        self.run("scontrol", "reconfigure")
        if "Duplicate jobid" in self.run("sinfo", "-h", "-R"):
            self.run("scontrol", "update", f"NodeName={self._host}", "State=RESUME")
        for line in self.run("squeue", "-h", "-r", "-o", "%i|%r").splitlines():
            job, why = line.split("|")
            if why == "launch failed requeued held":
                self.run("scontrol", "release", job)

    def run(self, *words):
        """Call one of its commands; returns what it prints."""
        return subprocess.run(
            list(map(str, words)), env=self.environment, check=True, capture_output=True, text=True
        ).stdout

    def wait_until_idle(self, limit=600):
        """Wait until no job is left."""
        attended = time.monotonic()
        until = attended + limit
        while time.monotonic() < until:
            time.sleep(2)
            with contextlib.suppress(subprocess.CalledProcessError):  # the controller is not there
                if time.monotonic() > attended + _PATIENCE:
                    attended = time.monotonic()
                    self._attend()
                if not self.run("squeue", "-h").strip():
                    return
        jobs, nodes = self.run("squeue"), self.run("sinfo", "-R")
        log = (self.folder / "slurmctld.log").read_text()[-3000:]
        raise RuntimeError(f"jobs do not end:\n{jobs}\n{nodes}\n{log}")

    def _started(self, name, *words):
        with (self.folder / f"{name}.out").open("ab") as out:
            return subprocess.Popen(
                [_found(name), *map(str, words)], env=self.environment, stdout=out, stderr=out
            )

    def _wait(self, limit=60):
        until = time.monotonic() + limit
        while time.monotonic() < until:
            state = subprocess.run(
                ["sinfo", "-h", "-o", "%t"], env=self.environment, capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            if state.stdout.strip() in ("idle", "mix", "alloc"):
                return
            with contextlib.suppress(subprocess.CalledProcessError):  # it may not answer yet
                self._attend()
            time.sleep(0.5)
        raise RuntimeError(f"Slurm does not come up; see {self.folder}")

    def stop(self):
        """End all daemons."""
        for process in (self._node, self.controller, self._munge):
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            process.wait()
        _CONFIGURATION.unlink()
