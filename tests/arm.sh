#!/usr/bin/env bash
# Runs the tests of vectors on a 64-bit Arm that qemu plays, where there is what this takes:
#
# - a compiler for it: `rustup target add aarch64-unknown-linux-gnu`, or one that RUSTC names;
# - aarch64-linux-gnu-gcc to link, and the C library that it links to;
# - qemu-aarch64-static or qemu-aarch64.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=aarch64-unknown-linux-gnu

skip() {
    echo "NOT RUN: $1"
    exit 0
}

case $(uname -m) in
    aarch64 | arm64) skip "this is an Arm, whose vectors all tests run on" ;;
esac
library=$("${RUSTC:-rustc}" --print target-libdir --target $target)
compgen -G "$library/libstd-*.rlib" >/dev/null || skip "the compiler has no library for $target"
command -v aarch64-linux-gnu-gcc >/dev/null || skip "there is no aarch64-linux-gnu-gcc to link with"
qemu=$(command -v qemu-aarch64-static || command -v qemu-aarch64) || skip "there is no qemu-aarch64"
libc=$(aarch64-linux-gnu-gcc -print-file-name=libc.so.6)
[ -f "$libc" ] || skip "there is no C library for $target"

export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="$qemu -L $(realpath "$(dirname "$libc")/..")"
cargo=$(rustup which cargo 2>/dev/null || echo cargo) # rustup's own would not look at RUSTC

# $1: a package; $2, $3, …: what of it, and `--` with the names of tests.
run() {
    local package=$1
    shift
    "$cargo" test --locked --target $target --package "$package" "$@"
}

run condyle-spatial --lib --tests -- --skip refused_levels # which starts itself: qemu would have to be told
run condyle-dynamics --test vectors
run condyle-dynamics --test suite -- limbs::
run condyle-linalg --lib --tests
run condyle-optimal --test contacts -- side_by_side implicit

# a vector instruction that was not inlined shows in any program that has kernels
program=$("$cargo" test --locked --target $target --package condyle-dynamics --test vectors --no-run --message-format=json |
    sed -nE 's/.*"executable":"([^"]+)".*/\1/p')
"${PYTHON:-python3}" tests/symbols.py "$program"
