#!/usr/bin/env bash
# Runs dynamics and optimal control as WebAssembly in headless Chromium (in Node.js if Chromium is missing), without
# SIMD and with SIMD128, and compares all numbers with the results of a native program. With WASM_PROFILE=release it
# also prints the duration of an iteration of FDDP for both. It needs a compiler (`tests/targets.sh install wasm`) and
# Node.js; tests/page/run.sh installs Chromium.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tests/targets.sh

skip() {
    echo "NOT RUN: $1"
    exit 0
}

target=wasm32-unknown-unknown
compiler_for $target std,panic_abort || exit 0
command -v node >/dev/null || skip "there is no Node.js"
browser=chromium
if [ ! -d .venv/page/node_modules ]; then
    echo "NOT RUN: headless Chromium, which tests/page/run.sh installs; Node.js takes its place"
    browser=
fi

profile=${WASM_PROFILE:-dev}
folder=$([ "$profile" = dev ] && echo debug || echo "$profile")
built=${CARGO_TARGET_DIR:-target}
log=$(mktemp -d)
trap 'rm -rf "$log"' EXIT

cargo build --locked --profile "$profile" --package condyle-optimal --example numbers
[ -z "$linker" ] || export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker
RUSTFLAGS="-C target-feature=+simd128" "${cargo[@]}" build --locked --profile "$profile" --target $target \
    --package condyle-optimal --example numbers --no-default-features --features loaders
times() {
    [ "$profile" = dev ] || sed -n "s/^time/$1:/p" "$log/$2"
    sed -i /^time/d "$log/$2"
}
for level in baseline simd128; do
    node tests/wasm.mjs "$built/$target/$folder/examples/numbers.wasm" $level $browser >"$log/$level" ||
        { tail -c 2000 "$log/$level"; exit 1; }
    times "WebAssembly, $level" $level
done
CONDYLE_LEVEL=baseline "$built/$folder/examples/numbers" >"$log/native_baseline"
"$built/$folder/examples/numbers" >"$log/native"
times "this machine, baseline" native_baseline
times "this machine" native

python=${PYTHON:-python3}
"$python" tests/same_numbers.py "$log/baseline" "$log/native_baseline" --rounding 0
"$python" tests/same_numbers.py "$log/simd128" "$log/native" --rounding 1e-9
