#!/usr/bin/env bash
# Checks that the crates without the standard library compile for two processors, and runs their example on a Cortex-M4
# that qemu emulates. The script needs compilers for both processors, and qemu-system-arm
# (`tests/targets.sh install embedded`). Without these it prints NOT RUN.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tests/targets.sh

for target in riscv32imac-unknown-none-elf thumbv7em-none-eabihf; do
    if compiler_for $target core,alloc; then
        "${cargo[@]}" check --locked --target $target --package condyle-dynamics --no-default-features --features libm,serde
    fi
done

compiler_for thumbv7em-none-eabihf core,alloc >/dev/null || exit 0
[ -z "$linker" ] || export CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER=$linker
here=$(mktemp)
board=$(mktemp)
trap 'rm -f "$here" "$board"' EXIT
cargo run --quiet --locked --package condyle-dynamics --example arm >"$here"
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/embedded
cd examples/embedded # .cargo/config.toml in this folder defines how the program is linked and run
"${cargo[@]}" build --release
if ! command -v qemu-system-arm >/dev/null; then
    echo "NOT RUN: there is no qemu-system-arm"
    exit
fi
timeout 120 "${cargo[@]}" run --quiet --release >"$board" || { cat "$board"; exit 1; }
grep memory "$board"
"${PYTHON:-python3}" ../../tests/same_numbers.py "$board" "$here" --only tau
