#!/usr/bin/env bash
# Runs the tests in Rust under AddressSanitizer, which reports accesses outside of allocated memory, and the tests of threads
# under ThreadSanitizer, which reports two threads at the same memory. ThreadSanitizer needs Rust's library compiled too, and so
# its sources (rustup component add rust-src).
#
# `tests/sanitizers.sh products` runs one small program alone: products of all matrices that calls and batches return, under
# AddressSanitizer, at every SIMD level that this machine has.
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

if [ "${1:-}" = products ]; then
    case $host in
        x86_64-*) levels=(baseline avx2 avx512) ;;
        aarch64-*) levels=(baseline neon) ;;
        *) levels=(baseline) ;;
    esac
    # few features and no debug information, so that little is compiled; a process for each level
    export CARGO_PROFILE_DEV_DEBUG=false
    for level in "${levels[@]}"; do
        CONDYLE_LEVEL=$level sanitized address asan --package condyle-dynamics --no-default-features --features std \
            --test products -- --nocapture
    done
    exit
fi

sanitized address asan --tests --package condyle-spatial --package condyle-linalg --package condyle-model \
    --package condyle-dynamics --package condyle-optimal --package condyle-wholebody
if [ -f "$root/lib/rustlib/src/rust/library/Cargo.lock" ]; then
    sanitized thread tsan -Z build-std --package condyle-linalg --package condyle-optimal --test threads
else
    echo "NOT RUN: the sources of Rust's library are not there (rustup component add rust-src)"
fi
