#!/usr/bin/env bash
# Runs the tests of threads under ThreadSanitizer, which sees two threads at the same memory. Rust's library is compiled for it
# too: that takes its sources (rustup component add rust-src).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$(rustc --print sysroot)
host=$(rustc -vV | sed -n 's/^host: //p')
if ! compgen -G "$root/lib/rustlib/$host/lib/librustc*_rt.tsan.a" >/dev/null; then
    echo "NOT RUN: the compiler has no ThreadSanitizer for $host"
elif [ ! -f "$root/lib/rustlib/src/rust/library/Cargo.lock" ]; then
    echo "NOT RUN: the sources of Rust's library are not there (rustup component add rust-src)"
else
    export RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Z sanitizer=thread" # which are not stable
    CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target}/races cargo test --locked --target "$host" -Z build-std \
        --package condyle-linalg --package condyle-optimal --test threads
fi
