# What the steps of CI share. A step sources it first, which brings it to the root of the repository.
# shellcheck shell=bash
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export CARGO_INCREMENTAL=0
# Debug information is two thirds of each test's file. Panics say their line without it.
export CARGO_PROFILE_DEV_DEBUG=0 CARGO_PROFILE_DEV_STRIP=debuginfo
mkdir -p target
# Where Cargo leaves what tests and other steps run.
built=$PWD/target/debug

# Builds what a step runs, unless `.ci/run` has built everything before. Arguments are those of `cargo build`.
build() { [ -n "${ISV_CI:-}" ] || cargo build --locked "$@"; }

# Installs Debian packages; fails where that is not possible. Steps that run beside each other take turns.
apt_install() {
    command -v apt-get >/dev/null || return
    (
        flock 9
        become=(env DEBIAN_FRONTEND=noninteractive)
        [ "$(id -u)" = 0 ] || become=(sudo --non-interactive "${become[@]}")
        # The lists of packages are an hour old at most.
        [ -n "$(find target/apt-lists -mmin -60 2>/dev/null)" ] ||
            { "${become[@]}" apt-get update && touch target/apt-lists; } || exit
        "${become[@]}" apt-get install -y "$@"
    ) 9>target/apt.lock
}

# Sees to it that commands, named in one word, are there; what follows are the Debian packages that have them.
need() {
    local command
    for command in $1; do
        command -v "$command" >/dev/null || { apt_install "${@:2}"; return; }
    done
}

# A note that something was not tested: what is missing, and where.
skipped() {
    echo "$2: skipped without $1"
    [ -z "${ISV_SKIPS:-}" ] || printf '%s\t%s\n' "$1" "$2" >>"$ISV_SKIPS"
}

# Makes the virtual environment of Python that steps share, target/venv.
python_environment() {
    python3 -c 'import ensurepip' 2>/dev/null || apt_install python3 python3-venv
    (
        flock 9
        [ -x target/venv/bin/python ] || python3 -m venv target/venv
        target/venv/bin/pip install --quiet --requirement docs/spec/reference_decoder/requirements.txt
        # USD reads what is written for it.
        target/venv/bin/pip install --quiet usd-core || echo "usd-core could not be installed"
    ) 9>target/venv.lock
}

has_vulkan() { compgen -G "/usr/share/vulkan/icd.d/*.json" >/dev/null || compgen -G "/etc/vulkan/icd.d/*.json" >/dev/null; }

# Installs what tests use, as far as it can be had.
install_for_tests() {
    # A GPU in software, so that the tests of kernels run.
    has_vulkan || apt_install mesa-vulkan-drivers libvulkan1 || echo "Mesa's Vulkan drivers could not be installed"
    # An opponent in comparisons.
    need draco_encoder draco || echo "draco could not be installed"
    # Two parsers of MP4 that are not ours.
    need "ffprobe mediainfo" --no-install-recommends ffmpeg mediainfo || echo "ffmpeg and mediainfo could not be installed"
    # What fuzzing campaigns kept is packed.
    need xz xz-utils || echo "xz could not be installed"
    python_environment
}

# What this machine has is required: a test that is skipped for want of it fails.
require_what_is_here() {
    ISV_REQUIRE=python,memory-use
    [ ! -d "${ISV_DATA:-../shared/data}" ] || ISV_REQUIRE+=,captures
    ! has_vulkan || ISV_REQUIRE+=,gpu
    ! command -v draco_encoder >/dev/null || ISV_REQUIRE+=,draco
    ! command -v xz >/dev/null || ISV_REQUIRE+=,xz
    ! { command -v tmc3 && command -v gltfpack; } >/dev/null || ISV_REQUIRE+=,other-codecs
    ! target/venv/bin/python -c 'import pxr' 2>/dev/null || ISV_REQUIRE+=,usd
    ! { command -v ffprobe && command -v mediainfo; } >/dev/null || ISV_REQUIRE+=,media
    export ISV_REQUIRE ISV_PYTHON=$PWD/target/venv/bin/python
}
