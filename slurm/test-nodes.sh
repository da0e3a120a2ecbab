#!/usr/bin/env bash
# Nodes of a throw-away cluster on one machine; slurm/test-cluster.sh reads this file.
#
# A node is the first process of namespaces of its own: processes, network, host name, shared memory
# and mounts. /tmp, /var/tmp and /dev/shm are its own but for the shared folders; all else is seen by
# all nodes, as with a root file system by NFS. Its link ends in a switch, which is a network namespace
# as well. When these processes die, by whatever hand, the kernel removes their links and mounts.
#
# FOLDER/NODE.init holds the number and the network of a node's first process: the number alone may be
# another process's by now.
NODES=${BASH_SOURCE[0]}
# Set aside for tests of networks (RFC 2544): no machine is there.
NETWORKS=198.18

# What several nodes need and this machine lacks, in one sentence.
require_namespaces() {
    command -v ip >/dev/null || fail "several nodes need the program ip; run $0 install"
    unshare --mount --pid --net --uts --ipc --fork true 2>/dev/null ||
        fail "several nodes need namespaces, which root may not make here (no CAP_SYS_ADMIN)"
    unshare --net bash -c 'ip link add name one type bridge && ip link add name two type veth peer name three' 2>/dev/null ||
        fail "several nodes need links of the kernel (bridge, veth), which it does not make here"
    mountpoint -q /sys/fs/cgroup || fail "several nodes need /sys/fs/cgroup, which is not mounted here"
}

# First process of a node, or of the switch; status 1 if it is off.
init_of() {
    local process network
    [ -f "$FOLDER/$1.init" ] && read -r process network <"$FOLDER/$1.init" &&
        [ "$(readlink "/proc/$process/ns/net")" = "$network" ] && echo "$process"
}

in_switch() { nsenter --target "$(init_of switch)" --net "$@"; }

# The switch, and this machine's link to it by the first number that no other cluster and no route has.
open_network() {
    local number process network
    setsid unshare --net sleep infinity >/dev/null 2>&1 </dev/null &
    process=$!
    disown
    network=$(readlink /proc/self/ns/net)
    while [ "$(readlink "/proc/$process/ns/net")" = "$network" ]; do sleep 0.02; done
    echo "$process $(readlink "/proc/$process/ns/net")" >"$FOLDER/switch.init"
    in_switch ip link add name switch up type bridge
    for number in $(seq 0 255); do
        network=$NETWORKS.$number
        if [ -z "$(ip -4 route show match "$network.1" | grep -v '^default')" ] &&
            ip link add "carillon$number" type veth peer name head netns "$process" 2>/dev/null; then
            ip addr add "$network.1/24" dev "carillon$number"
            ip link set "carillon$number" up
            in_switch ip link set head master switch up
            echo "$network" >"$FOLDER/network"
            return
        fi
    done
    fail "all networks from $NETWORKS.0 to $NETWORKS.255 are taken"
}

address_of() { echo "$(cat "$FOLDER/network").$((10 + ${1#n}))"; }

# Power on. The link comes before the processes, which do not know the switch's number.
boot() {
    ! init_of "$1" >/dev/null || fail "$1 is on already"
    rm -f "$FOLDER/$1.init"
    # shellcheck disable=SC2016 # for the node's shell
    setsid unshare --net bash -euc '
        . "$1"
        FOLDER=$2
        connect "$3"
        exec unshare --mount --pid --uts --ipc --fork --kill-child bash "$@"
    ' bash "$NODES" "$FOLDER" "$1" >"$FOLDER/log/boot-$1.log" 2>&1 </dev/null &
    while ! init_of "$1" >/dev/null; do
        kill -0 "$!" 2>/dev/null || fail "$1 cannot boot: $(tail -n 1 "$FOLDER/log/boot-$1.log")"
        sleep 0.02
    done
    disown
}

connect() {
    ip link set lo up
    ip link add eth0 type veth peer name "$1" netns "$(init_of switch)"
    ip addr add "$(address_of "$1")/24" dev eth0
    ip link set eth0 up
    in_switch ip link set "$1" master switch up
}

# The first process of a node: it makes the node, and then takes leave of orphans until the power is off.
be_node() {
    local process network
    # /proc is still the machine's, where this process has another number than 1.
    read -r process _ </proc/self/stat
    network=$(readlink /proc/self/ns/net)
    mount -t proc proc /proc
    mount --bind "$FOLDER/hosts" /etc/hosts
    own /tmp "$FOLDER/shared"
    own /var/tmp "$FOLDER/shared"
    own /dev/shm /dev/null
    hostname "$1"
    # What PMIx has left of jobs that died with the node: ranks of a job that starts again would find it.
    rm -rf "$FOLDER/spool-$1"/{stepd.slurm.pmix,pmix}.*
    echo "$process $network" >"$FOLDER/$1.init"
    slurmd -N "$1"
    while :; do
        sleep infinity &
        wait "$!" || true
    done
}

# A folder becomes the node's own, but for the shared folders in there that a file lists.
own() {
    local folder shared=()
    mapfile -t shared <"$2"
    mount -t tmpfs -o mode=1777 own /dev/shm
    for folder in "${shared[@]}"; do
        if [[ $folder == "$1"/* ]]; then
            mkdir -p "/dev/shm/${folder#"$1"/}"
            mount --rbind "$folder" "/dev/shm/${folder#"$1"/}"
        fi
    done
    [ "$1" = /dev/shm ] || mount --move /dev/shm "$1"
}

# Power off: all processes of a node, or of the switch, at once.
power_off() {
    local process
    process=$(init_of "$1") || fail "$1 is off"
    kill -KILL "$process"
    while [ -e "/proc/$process" ]; do sleep 0.02; done
    rm -f "$FOLDER/$1.init"
}

# The other end goes with it, or has gone already.
remove_link() { in_switch ip link del "$1" 2>/dev/null || true; }

set_link() { in_switch ip link set "$1" "$2"; }

# A command on a node in the same folder, as by ssh.
on_node() {
    local process
    process=$(init_of "$1") || fail "$1 is off"
    # shellcheck disable=SC2016 # for the node's shell
    exec nsenter --target "$process" --all --root bash -c 'cd "$0" && exec "$@"' "$PWD" "${@:2}"
}

if [ "$NODES" = "$0" ]; then
    set -euo pipefail
    FOLDER=$1
    be_node "$2"
fi
