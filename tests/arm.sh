#!/usr/bin/env bash
# Runs the tests of SIMD code on a 64-bit Arm processor that qemu emulates. The script needs a compiler for Arm,
# aarch64-linux-gnu-gcc to link with the C library, and qemu-aarch64-static or qemu-aarch64
# (`tests/targets.sh install arm`). Without these tools it prints NOT RUN.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tests/targets.sh

target=aarch64-unknown-linux-gnu

skip() {
    echo "NOT RUN: $1"
    exit 0
}

case $(uname -m) in
    aarch64 | arm64) skip "this is an Arm, whose vectors all tests run on" ;;
esac
compiler_for $target std || exit 0
command -v aarch64-linux-gnu-gcc >/dev/null || skip "there is no aarch64-linux-gnu-gcc to link with"
qemu=$(command -v qemu-aarch64-static || command -v qemu-aarch64) || skip "there is no qemu-aarch64"
libc=$(aarch64-linux-gnu-gcc -print-file-name=libc.so.6)
[ -f "$libc" ] || skip "there is no C library for $target"

export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="$qemu -L $(realpath "$(dirname "$libc")/..")"
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/arm # separate from other builds
export CARGO_PROFILE_DEV_DEBUG=false
export CONDYLE_EMULATED=1 # fewer cases in tests that take minutes

packages=(spatial linalg dynamics ${CONDYLE_FULL:+optimal})

# Builds all test programs with one command, so shared code is compiled once. $1, …: the programs to run, then `--` and
# test names.
run() {
    "${cargo[@]}" test --locked --target $target "${packages[@]/#/--package=condyle-}" "$@"
}

# Tests SIMD registers, dense kernels, batches, branches in lanes, and products of all results. `./test full` also tests
# the solver's sweeps. The test of memory use is left out.
run --test vectors --test products --test sin_cos --test kernels --test tree ${CONDYLE_FULL:+--test lqr} -- --skip memory_by_state
checked=vectors
if [ -n "${CONDYLE_FULL:-}" ]; then
    # Tests solver knots in lanes, except derivatives by differences, which take thousands of calls.
    run --test contacts -- --skip derivatives_
    checked=contacts
fi

# Checks only one program: vector instructions that were not inlined would be in every program with kernels.
programs=$(run --test $checked --no-run --message-format=json | sed -nE 's/.*"executable":"([^"]+)".*/\1/p')
for program in ${programs:?}; do
    "${PYTHON:-python3}" tests/symbols.py "$program"
done
