#!/usr/bin/env bash
# The environment of `make docs`: Sphinx beside the packages of .venv, which it leaves as they are.
#
#   docs.sh FOLDER    makes it in FOLDER, unless it is there and up to date
#
# Read besides: VENV, the environment that it stands on (default .venv).
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
REQUIREMENTS=$ROOT/workflow/envs/requirements-docs.txt
FOLDER=$1
VENV=$(realpath "${VENV:-$ROOT/.venv}")
STAMP=$FOLDER/installed # written last: what it was made from

packages_of() { "$1/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))'; }

wanted=$(printf '%s\n' "$VENV" && "$VENV/bin/python" --version && cat "$REQUIREMENTS")
if [ -f "$STAMP" ] && [ "$(cat "$STAMP")" = "$wanted" ]; then
    exit 0
fi
echo "installing Sphinx into $FOLDER"
rm -rf "$FOLDER"
mkdir -p "$(dirname "$FOLDER")"
"$VENV/bin/python" -m venv --system-site-packages "$FOLDER"
echo "import site; site.addsitedir('$(packages_of "$VENV")')" >"$(packages_of "$FOLDER")/carillon-environment.pth"
"$FOLDER/bin/python" -m pip install --quiet --disable-pip-version-check -r "$REQUIREMENTS" ||
    { echo "make docs: Sphinx could not be installed, see above" >&2 && exit 1; }
printf '%s\n' "$wanted" >"$STAMP"
