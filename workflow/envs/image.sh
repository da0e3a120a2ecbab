#!/usr/bin/env bash
# What makes an image of a minimal Debian or Ubuntu that holds this checkout: the environment, and the
# kernels for processors of the kind that this one is. slurm/carillon.def and .ci/bare-root call it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
bash workflow/envs/setup.sh
.venv/bin/carillon compile
