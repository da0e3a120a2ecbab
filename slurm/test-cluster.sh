#!/usr/bin/env bash
# A throw-away SLURM cluster on this machine, for tests and first tries:
#
#   slurm/test-cluster.sh install        Debian's or Ubuntu's packages (needs root or sudo)
#   slurm/test-cluster.sh start FOLDER   munged, slurmctld and slurmd (needs root); from then on
#                                        sbatch, srun, squeue and snakemake --profile slurm work
#   slurm/test-cluster.sh fail FOLDER    the node dies: slurmd and all processes of its jobs
#   slurm/test-cluster.sh repair FOLDER  it comes back
#   slurm/test-cluster.sh stop FOLDER
#
# The node is this machine. With several nodes (slurm/test-nodes.sh), called n1, n2 and so on, each has
# processes, a network, a host name, shared memory and /tmp of its own:
#
#   slurm/test-cluster.sh start FOLDER --nodes 3
#   slurm/test-cluster.sh fail | repair FOLDER NODE      the power of a node goes off, and on again
#   slurm/test-cluster.sh unplug | plug FOLDER NODE      its link to the others
#   slurm/test-cluster.sh on FOLDER NODE COMMAND...      a command on it, in the same folder
#
# slurm/delayed_links.py adds links between them on which messages take their time.
#
# `start FOLDER --while PROCESS` stops the cluster when that process has ended, by whatever hand.
# Everything is written in FOLDER, but for a link /etc/slurm/slurm.conf while it runs; a machine
# that has a SLURM of its own is left alone. CPUS and MEMORY_MB in the environment say what each node
# has, the machine's cores and three quarters of its memory otherwise, which all nodes share. SHARED,
# separated by colons, names folders in /tmp that all nodes see besides FOLDER, the checkout and the
# one where the cluster is started. There is no accounting (sacct).
set -euo pipefail

# Where all of SLURM's programs look, also in jobs, whose environment may be another one.
LINK=/etc/slurm/slurm.conf
PACKAGES=$(dirname "${BASH_SOURCE[0]}")/../workflow/envs/packages.sh
# The daemons are where a root by cron, or by su without -, does not look.
PATH=$PATH:/usr/local/sbin:/usr/sbin:/sbin
# shellcheck source=slurm/test-nodes.sh
. "$(dirname "${BASH_SOURCE[0]}")/test-nodes.sh"

fail() {
    echo "test-cluster: $*" >&2
    exit 2
}

# SLURM's plug-in for MPI ranks loads the library by this name, which no dependency brings.
has_pmix() { python3 -c 'import ctypes; ctypes.CDLL("libpmix.so")' 2>/dev/null; }

complete() {
    local program
    for program in slurmctld slurmd sbatch munged ps pgrep ip; do
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

# Nodes are this machine (COUNT is empty), or n1 to nCOUNT.
configure() {
    local cpus memory head=127.0.0.1 nodes addresses=127.0.0.1
    nodes=$(hostname -s)
    # Without what limits the threads of a program, which nproc minds too.
    cpus=${CPUS:-$(env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc)}
    memory=$(awk '/MemTotal/ { print int($2 / 1024 * 3 / 4) }' /proc/meminfo)
    mkdir -p "$FOLDER/state" "$FOLDER/log"
    if [ -n "$COUNT" ]; then
        head=$(cat "$FOLDER/network").1
        nodes="n[1-$COUNT]"
        addresses="$(cat "$FOLDER/network").[11-$((10 + COUNT))]"
        list_hosts "$head" >"$FOLDER/hosts"
        shared_folders >"$FOLDER/shared"
    fi
    cat >"$FOLDER/slurm.conf" <<END
ClusterName=throwaway
SlurmctldHost=$(hostname -s)($head)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
AuthType=auth/munge
AuthInfo=socket=$FOLDER/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$FOLDER/state
SlurmdSpoolDir=$FOLDER/spool-%n
SlurmctldPidFile=$FOLDER/slurmctld.pid
SlurmdPidFile=$FOLDER/slurmd-%n.pid
SlurmctldLogFile=$FOLDER/log/slurmctld.log
SlurmdLogFile=$FOLDER/log/slurmd-%n.log
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
# A job of the second partition takes the place of one of the first.
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
NodeName=$nodes NodeAddr=$addresses CPUs=$cpus RealMemory=${MEMORY_MB:-$memory} State=UNKNOWN
PartitionName=compute Nodes=ALL Default=YES MaxTime=INFINITE State=UP PriorityTier=1
PartitionName=urgent Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=2 PreemptMode=OFF
END
}

list_hosts() {
    local node
    echo "127.0.0.1 localhost"
    echo "$1 $(hostname -s)"
    for node in $(nodes); do
        echo "$(address_of "$node") $node"
    done
}

# Paths that are the same file system on all nodes.
shared_folders() {
    tr ':' '\n' <<<"$FOLDER:$PWD:$(dirname "$NODES")/..${SHARED:+:$SHARED}" | xargs -d '\n' realpath | sort -u
}

# Names of several nodes; those of a cluster that was started stand in its folder.
nodes() { seq --format 'n%g' "${COUNT:-0}"; }

start_munge() {
    # munged insists that nobody else can write to the folders of its key and its socket.
    head -c 128 /dev/urandom >"$FOLDER/munge.key"
    chmod 600 "$FOLDER/munge.key"
    munged --force --socket "$FOLDER/munge.socket" --key-file "$FOLDER/munge.key" \
        --pid-file "$FOLDER/munge.pid" --seed-file "$FOLDER/munge.seed" \
        --log-file "$FOLDER/log/munged.log"
}

start() {
    [ "$(id -u)" -eq 0 ] || fail "the daemons have to be started by root"
    complete || fail "no SLURM here, or not all that it needs; run $0 install"
    [ -z "$COUNT" ] || require_namespaces
    [ ! -e "$FOLDER/slurm.conf" ] || fail "$FOLDER holds a cluster already; stop it, or name another folder"
    forget_dead_cluster
    [ ! -e "$LINK" ] || fail "this machine has a SLURM already: $(readlink -f "$LINK")"
    trap clear EXIT
    [ -z "$COUNT" ] || open_network
    configure
    mkdir -p "$(dirname "$LINK")"
    ln -sf "$FOLDER/slurm.conf" "$LINK"
    if start_munge && slurmctld && start_nodes && await all_idle; then
        [ -z "$KEEPER" ] || stop_after "$KEEPER"
        trap - EXIT
        return
    fi
    tail -n 5 "$FOLDER"/log/*.log >&2 || true
    fail "not all nodes became idle within a minute; the last lines of the logs are above"
}

start_nodes() {
    local node
    if [ -z "$COUNT" ]; then
        slurmd
    fi
    for node in $(nodes); do
        boot "$node"
    done
}

# Ask for a minute until a function says yes.
await() {
    local _
    for _ in $(seq 300); do
        ! "$@" || return 0
        sleep 0.2
    done
    return 1
}

# Whether as many nodes as there are can take jobs.
all_idle() { [ "$(sinfo --noheader --Node --partition compute --format %t 2>/dev/null | grep -cx idle)" -eq "${COUNT:-1}" ]; }

# Whether the controller has heard from a node since a time [s]; until then it knows of no death.
registered() {
    local node started
    node=$(scontrol --oneliner show node "$1" 2>/dev/null) || return 1
    started=$(sed -n 's/.* SlurmdStartTime=\([^ ]*\) .*/\1/p' <<<"$node")
    [ "$(date --date "$started" +%s 2>/dev/null || echo 0)" -ge "$2" ] && grep -qE ' State=(IDLE|MIXED|ALLOCATED) ' <<<"$node"
}

repair_node() {
    local since
    # The controller knows starts by the second.
    sleep 1
    since=$(date +%s)
    boot "$1"
    await registered "$1" "$since" || fail "$1 did not come back within a minute; see $FOLDER/log"
}

# In a session of its own, so that what ends the process does not end this too.
stop_after() {
    # shellcheck disable=SC2016 # for its own shell
    setsid bash -c 'tail --pid "$1" -f /dev/null; rm -f "$3/watch.pid"; exec bash "$2" stop "$3"' \
        bash "$1" "${BASH_SOURCE[0]}" "$FOLDER" >/dev/null 2>&1 </dev/null &
    echo "$!" >"$FOLDER/watch.pid"
}

# What is left where a cluster of this script was killed instead of stopped.
forget_dead_cluster() {
    local other
    other=$(readlink -f "$LINK" 2>/dev/null) || return 0
    if grep -qs '^ClusterName=throwaway$' "$other" && ! alive "$(dirname "$other")/slurmctld.pid"; then
        (FOLDER=$(dirname "$other") && clear)
    fi
}

# Its state is saved by then. What nobody takes leave of stays a zombie, and has ended all the same.
end() {
    kill "$1" 2>/dev/null || true
    while runs "$1"; do sleep 0.05; done
}

runs() { grep -qs '^State:[[:space:]]*[^Z[:space:]]' "/proc/$1/status"; }

alive() { [ -f "$1" ] && runs "$(cat "$1")"; }

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
    kill -KILL "$(cat "$FOLDER/slurmd-$(hostname -s).pid")" 2>/dev/null || true
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

power_all_off() {
    local file
    for file in "$FOLDER"/*.init; do
        file=$(basename "$file" .init)
        ! init_of "$file" >/dev/null || power_off "$file"
    done
}

stop() {
    [ "$(readlink -f "$LINK")" = "$FOLDER/slurm.conf" ] || fail "no cluster runs in $FOLDER"
    clear
}

# End whatever of the cluster is there.
clear() {
    local name
    [ ! -f "$FOLDER/watch.pid" ] || kill -- "-$(cat "$FOLDER/watch.pid")" 2>/dev/null || true
    scancel --user root 2>/dev/null || true
    if [ -f "$FOLDER/network" ]; then
        power_all_off
    else
        fail_node
    fi
    for name in slurmctld munge; do
        ! alive "$FOLDER/$name.pid" || end "$(cat "$FOLDER/$name.pid")"
    done
    rm -f "$LINK" "$FOLDER"/{slurm.conf,network,watch.pid}
}

usage() {
    fail "usage: $0 install | start FOLDER [--nodes N] [--while PROCESS] | fail | repair FOLDER [NODE]" \
        "| unplug | plug FOLDER NODE | on FOLDER NODE COMMAND... | stop FOLDER"
}

ACTION=${1:-}
case $ACTION in
install) ;;
start | fail | repair | unplug | plug | on | stop) [ $# -ge 2 ] || usage ;;
*) usage ;;
esac
COUNT=
KEEPER=
NODE=
if [ "$ACTION" != install ]; then
    mkdir -p "$2"
    FOLDER=$(cd "$2" && pwd -P)
    shift 2
fi
if [ "$ACTION" = start ]; then
    while [ $# -gt 0 ]; do
        case "$1 ${2:-}" in
        "--nodes "[1-9] | "--nodes "[1-9][0-9]) COUNT=$2 ;;
        "--while "[1-9]*) KEEPER=$2 ;;
        *) usage ;;
        esac
        shift 2
    done
elif [ "$ACTION" != install ] && [ $# -gt 0 ]; then
    NODE=$1
    grep -qsw "$NODE" "$FOLDER/hosts" || fail "$FOLDER has no node '$NODE'"
fi
case $ACTION${NODE:+ of a node} in
install) install ;;
start) start ;;
fail) fail_node ;;
"fail of a node") power_off "$NODE" && remove_link "$NODE" ;;
repair) slurmd ;;
"repair of a node") repair_node "$NODE" ;;
"unplug of a node") set_link "$NODE" down ;;
"plug of a node") set_link "$NODE" up ;;
"on of a node") on_node "$@" ;;
stop) stop ;;
*) usage ;;
esac
