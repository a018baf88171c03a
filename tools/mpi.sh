# shellcheck shell=bash
# Sourced by the local scripts (never by the batch scripts): finds the mpirun that belongs to this
# installation's MPI and lets it start more ranks than cores, also as root, where it has to.
#
# choose_mpirun            sets MPIRUN (empty if there is none); a value given from outside stays
# allow_ranks RANKS CORES  exports what MPIRUN needs to start RANKS ranks here

choose_mpirun() {
    local root=$1 name
    if [ -n "${MPIRUN:-}" ]; then return 0; fi
    # Set-up wrote down which one started ranks that saw each other.
    if [ -s "$root/.venv/mpirun" ]; then
        MPIRUN=$(cat "$root/.venv/mpirun")
        if command -v "$MPIRUN" >/dev/null; then return 0; fi
    fi
    MPIRUN=
    for name in mpirun mpiexec; do
        if command -v "$name" >/dev/null; then
            MPIRUN=$(command -v "$name")
            return 0
        fi
    done
}

allow_ranks() {
    local ranks=$1 cores=$2
    # Only Open MPI has these rules; its version 5 has them in another library.
    case $("$MPIRUN" --version 2>/dev/null | head -n 1) in
        *"Open MPI"* | *OpenRTE* | *PRRTE* | *prte*) ;;
        *) return 0 ;;
    esac
    if [ "$(id -u)" = 0 ]; then
        export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
        export PRTE_ALLOW_RUN_AS_ROOT=1 PRTE_ALLOW_RUN_AS_ROOT_CONFIRM=1
    fi
    if [ "$ranks" -gt "$cores" ]; then
        export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none
        export PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe
        export PRTE_MCA_hwloc_default_binding_policy=none
    fi
}
