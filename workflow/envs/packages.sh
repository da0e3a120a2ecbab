#!/usr/bin/env bash
# Packages of Debian and Ubuntu by what they are for, from packages.txt beside this file:
#
#   packages.sh list GROUP...      their names
#   packages.sh missing GROUP...   those that are not installed
#   packages.sh install GROUP...   installs these, as root or by passwordless sudo; else status 1
#                                  and a sentence that says how
set -euo pipefail
TABLE=$(dirname "${BASH_SOURCE[0]}")/packages.txt
# dpkg insists on programs that are where a root by cron, or by su without -, does not look.
PATH=$PATH:/usr/local/sbin:/usr/sbin:/sbin

fail() {
    printf '%s\n' "$*" >&2
    exit 1
}

list() {
    local group
    for group in "$@"; do
        awk -v group="$group" '$1 == group { print $2; found = 1 } END { exit !found }' "$TABLE" ||
            fail "packages.txt has no group '$group'"
    done
}

missing() {
    local package installed packages
    mapfile -t packages < <(list "$@")
    installed=$(dpkg-query -W -f '${Package} ${Status}\n' "${packages[@]}" 2>/dev/null || true)
    for package in "${packages[@]}"; do
        grep -qx "$package install ok installed" <<<"$installed" || printf '%s\n' "$package"
    done
}

install() {
    local packages
    if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
        fail "this machine has no apt-get (not Debian or Ubuntu); it needs, by whatever names:" \
            "$(list "$@" | xargs)"
    fi
    mapfile -t packages < <(missing "$@")
    if [ ${#packages[@]} -eq 0 ]; then
        return
    fi
    if [ "$(id -u)" -eq 0 ]; then
        run=(env)
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        run=(sudo -n env)
    else
        fail "system packages are missing and you are not root; run" \
            "sudo apt-get install --no-install-recommends ${packages[*]}"
    fi
    echo "Installing system packages: ${packages[*]}"
    # Services are not started: there is no configuration for them.
    run+=(DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get -q -y -o DPkg::Lock::Timeout=300)
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    # A fresh machine has no package lists, an old one has lists that name files long gone.
    if ! attempt install --no-install-recommends "${packages[@]}"; then
        attempt update || failed "apt-get update failed"
        attempt install --no-install-recommends "${packages[@]}" ||
            failed "apt-get could not install ${packages[*]}; install them by hand"
    fi
}

attempt() { "${run[@]}" "$@" </dev/null >"$log" 2>&1; }

failed() {
    tail -n 20 "$log" >&2
    fail "$@"
}

[ $# -ge 2 ] || fail "usage: $0 list | missing | install GROUP..."
case $1 in
list | missing | install) "$@" ;;
*) fail "unknown action '$1': list, missing or install" ;;
esac
