#!/usr/bin/env bash
# Runs the Rust tests under AddressSanitizer, which reports accesses outside allocated memory, and the tests of threads
# under ThreadSanitizer, which reports data races. ThreadSanitizer needs a standard library compiled with it, and
# therefore the library's sources (rustup component add rust-src).
#
# `tests/sanitizers.sh products` only runs one small program: products of all matrices that calls and batches return, under
# AddressSanitizer, at every SIMD level of this machine.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$(rustc --print sysroot)
host=$(rustc -vV | sed -n 's/^host: //p')

# sanitized NAME RUNTIME ARGUMENT...: runs tests under a sanitizer, if the compiler includes its runtime.
sanitized() {
    local name=$1 runtime=$2
    shift 2
    if ! compgen -G "$root/lib/rustlib/$host/lib/librustc*_rt.$runtime.a" >/dev/null; then
        echo "NOT RUN: the compiler has no sanitizer '$name' for $host"
        return
    fi
    # RUSTC_BOOTSTRAP is needed, because sanitizers are not stable features.
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Z sanitizer=$name" CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target}/$name \
        cargo test --locked --target "$host" "$@"
}

if [ "${1:-}" = products ]; then
    case $host in
        x86_64-*) levels=(baseline avx2 avx512) ;;
        aarch64-*) levels=(baseline neon) ;;
        *) levels=(baseline) ;;
    esac
    # Few features and no debug information make the build short. Each SIMD level is tested in its own process.
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
