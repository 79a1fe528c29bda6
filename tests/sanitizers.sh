#!/usr/bin/env bash
# Runs the tests in Rust under AddressSanitizer, which sees what lies outside of what was allocated, and those of threads under
# ThreadSanitizer, which sees two threads at the same memory. For the latter Rust's library is compiled too: that takes its
# sources (rustup component add rust-src).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$(rustc --print sysroot)
host=$(rustc -vV | sed -n 's/^host: //p')

# sanitized NAME RUNTIME ARGUMENT...: runs tests under a sanitizer, of which the compiler has the runtime.
sanitized() {
    local name=$1 runtime=$2
    shift 2
    if ! compgen -G "$root/lib/rustlib/$host/lib/librustc*_rt.$runtime.a" >/dev/null; then
        echo "NOT RUN: the compiler has no sanitizer '$name' for $host"
        return
    fi
    # which are not stable
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Z sanitizer=$name" CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target}/$name \
        cargo test --locked --target "$host" "$@"
}

sanitized address asan --tests --package condyle-spatial --package condyle-linalg --package condyle-model \
    --package condyle-dynamics --package condyle-optimal --package condyle-wholebody
if [ -f "$root/lib/rustlib/src/rust/library/Cargo.lock" ]; then
    sanitized thread tsan -Z build-std --package condyle-linalg --package condyle-optimal --test threads
else
    echo "NOT RUN: the sources of Rust's library are not there (rustup component add rust-src)"
fi
