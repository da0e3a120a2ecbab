#!/usr/bin/env bash
# A throw-away SLURM cluster of one node, this machine, for tests and first tries:
#
#   slurm/test-cluster.sh install        Debian's or Ubuntu's packages (needs root or sudo)
#   slurm/test-cluster.sh start FOLDER   munged, slurmctld and slurmd (needs root); from then on
#                                        sbatch, srun, squeue and snakemake --profile slurm work
#   slurm/test-cluster.sh fail FOLDER    the node dies: slurmd and all processes of its jobs
#   slurm/test-cluster.sh repair FOLDER  it comes back
#   slurm/test-cluster.sh stop FOLDER
#
# Everything it writes is in FOLDER, but for a link /etc/slurm/slurm.conf while it runs; a machine
# that has a SLURM of its own is left alone. CPUS and MEMORY_MB in the environment say what the node
# has, the machine's cores and three quarters of its memory otherwise. There is no accounting (sacct).
set -euo pipefail

# Where all of SLURM's programs look, also in jobs, whose environment may be another one.
LINK=/etc/slurm/slurm.conf
PACKAGES=$(dirname "${BASH_SOURCE[0]}")/../workflow/envs/packages.sh
# The daemons are where a root by cron, or by su without -, does not look.
PATH=$PATH:/usr/local/sbin:/usr/sbin:/sbin

fail() {
    echo "test-cluster: $*" >&2
    exit 2
}

# SLURM's plug-in for MPI ranks loads the library by this name, which no dependency brings.
has_pmix() { python3 -c 'import ctypes; ctypes.CDLL("libpmix.so")' 2>/dev/null; }

complete() {
    local program
    for program in slurmctld slurmd sbatch munged ps pgrep; do
        command -v "$program" >/dev/null || return
    done
    has_pmix
}

install() {
    complete || bash "$PACKAGES" install slurm >/dev/null ||
        fail "install slurmctld, slurmd, the client, munge, PMIx and procps by hand"
    complete || fail "SLURM is installed, but its programs or libpmix.so cannot be loaded"
}

free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])'; }

configure() {
    local node cpus memory
    node=$(hostname -s)
    # Without what limits the threads of a program, which nproc minds too.
    cpus=${CPUS:-$(env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc)}
    memory=${MEMORY_MB:-$(awk '/MemTotal/ { print int($2 / 1024 * 3 / 4) }' /proc/meminfo)}
    mkdir -p "$FOLDER/state" "$FOLDER/spool" "$FOLDER/log"
    cat >"$FOLDER/slurm.conf" <<END
ClusterName=throwaway
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
AuthType=auth/munge
AuthInfo=socket=$FOLDER/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$FOLDER/state
SlurmdSpoolDir=$FOLDER/spool
SlurmctldPidFile=$FOLDER/slurmctld.pid
SlurmdPidFile=$FOLDER/slurmd.pid
SlurmctldLogFile=$FOLDER/log/slurmctld.log
SlurmdLogFile=$FOLDER/log/slurmd.log
# What containers and plain machines allow: no cgroups.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
# A job that takes more memory than it asked for is killed, as by cgroups on a real cluster.
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$FOLDER/log/jobs.txt
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=0,sched_interval=5
# A dead node is noticed and taken back within seconds.
SlurmdTimeout=10
ReturnToService=2
JobRequeue=1
KillWait=5
MessageTimeout=20
MinJobAge=600
NodeName=$node NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=$memory State=UNKNOWN
PartitionName=compute Nodes=$node Default=YES MaxTime=INFINITE State=UP
END
}

start_munge() {
    # munged insists that nobody else can write to the folders of its key and its socket.
    head -c 128 /dev/urandom >"$FOLDER/munge.key"
    chmod 600 "$FOLDER/munge.key"
    munged --force --socket "$FOLDER/munge.socket" --key-file "$FOLDER/munge.key" \
        --pid-file "$FOLDER/munge.pid" --seed-file "$FOLDER/munge.seed" \
        --log-file "$FOLDER/log/munged.log"
}

start() {
    local _
    [ "$(id -u)" -eq 0 ] || fail "the daemons have to be started by root"
    complete || fail "no SLURM here, or not all that it needs; run $0 install"
    [ ! -e "$FOLDER/slurm.conf" ] || fail "$FOLDER holds a cluster already; stop it, or name another folder"
    forget_dead_cluster
    [ ! -e "$LINK" ] || fail "this machine has a SLURM already: $(readlink -f "$LINK")"
    configure
    mkdir -p "$(dirname "$LINK")"
    ln -sf "$FOLDER/slurm.conf" "$LINK"
    if start_munge && slurmctld && slurmd; then
        for _ in $(seq 300); do
            if sinfo --noheader --format %T 2>/dev/null | grep -q idle; then
                return
            fi
            sleep 0.2
        done
    fi
    tail -n 5 "$FOLDER"/log/*.log >&2 || true
    stop
    fail "the node did not become idle within a minute; the last lines of the logs are above"
}

# What is left where a cluster of this script was killed instead of stopped.
forget_dead_cluster() {
    local other
    other=$(readlink -f "$LINK" 2>/dev/null) || return 0
    if grep -qs '^ClusterName=throwaway$' "$other" && ! alive "$(dirname "$other")/slurmctld.pid"; then
        rm -f "$LINK"
    fi
}

alive() { [ -f "$1" ] && kill -0 "$(cat "$1")" 2>/dev/null; }

# The process with the number in a file, and all that it has started.
kill_tree() {
    local child
    for child in $(ps -o pid= --ppid "$1" 2>/dev/null); do
        kill_tree "$child"
    done
    kill -KILL "$1" 2>/dev/null || true
}

fail_node() {
    local step
    kill -KILL "$(cat "$FOLDER/slurmd.pid")" 2>/dev/null || true
    # Every job has a slurmstepd, which outlives slurmd, but not a node.  It is stopped first: while it
    # saw its processes die it could still tell the controller of them.
    # Another root on the machine, with processes of its own, may hold a cluster too.
    local here=(--ns "$BASHPID" --nslist pid)
    pkill "${here[@]}" -STOP -x slurmstepd || true
    for step in $(pgrep "${here[@]}" -x slurmstepd || true); do
        kill_tree "$step"
    done
    # Without cgroups SLURM loses sight of processes whose parents have died.
    for step in $(pgrep "${here[@]}" '.' || true); do
        if tr '\0' '\n' 2>/dev/null <"/proc/$step/environ" | grep -qx 'SLURM_CLUSTER_NAME=throwaway'; then
            kill -KILL "$step" 2>/dev/null || true
        fi
    done
}

stop() {
    local name
    [ "$(readlink -f "$LINK")" = "$FOLDER/slurm.conf" ] || fail "no cluster runs in $FOLDER"
    scancel --user root 2>/dev/null || true
    fail_node
    for name in slurmctld munge; do
        [ ! -f "$FOLDER/$name.pid" ] || kill "$(cat "$FOLDER/$name.pid")" 2>/dev/null || true
    done
    rm -f "$LINK" "$FOLDER/slurm.conf"
}

ACTION=${1:-}
if [ "$ACTION" != install ]; then
    [ $# -eq 2 ] || fail "usage: $0 install | start FOLDER | fail FOLDER | repair FOLDER | stop FOLDER"
    mkdir -p "$2"
    FOLDER=$(cd "$2" && pwd -P)
fi
case $ACTION in
install) install ;;
start) start ;;
fail) fail_node ;;
repair) slurmd ;;
stop) stop ;;
*) fail "unknown action '$ACTION': install, start, fail, repair or stop" ;;
esac
