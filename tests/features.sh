#!/usr/bin/env bash
# Checks that each crate compiles without features, with each single feature, and with all features except one. Then it
# runs the unit tests of crates that support it without the standard library (tests/embedded.sh does this for dynamics).
# Finally it runs CUDA kernels with a simulated driver without a GPU.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# $1: a crate; $2: a required feature, or empty; $3, …: optional features.
check() {
    local crate=$1 needed=$2 feature others combinations
    shift 2
    combinations=("$needed")
    for feature in "$@"; do
        others=$(printf '%s\n' "$@" | awk -v out="$feature" '$0 != out' | paste -sd ,)
        combinations+=("$needed,$feature" "$needed,$others")
    done
    while read -r combination; do
        echo "$crate: ${combination:-none}"
        cargo check --quiet --locked --package "$crate" --no-default-features --features "$combination"
    done < <(printf '%s\n' "${combinations[@]}" | sed 's/^,//; s/,$//' | sort -u)
}

check condyle-spatial libm serde std
check condyle-linalg libm std threads
check condyle-model libm loaders meshes serde std threads urdf-rs
check condyle-dynamics libm loaders meshes serde std threads urdf-rs
check condyle-optimal "" loaders serde threads
check condyle-wholebody "" clarabel loaders threads
check condyle-ik "" loaders threads
check condyle-mpc "" loaders threads
check condyle-codegen "" cuda
check condyle-meshes "" page
check condyle "" clarabel ik loaders meshes mpc optimal serde threads urdf-rs wholebody

cargo test --locked --package condyle-model --no-default-features --features libm --lib
cargo test --locked --package condyle-model --features urdf-rs --test urdf_rs
cargo test --locked --package condyle-model --features urdf-rs --doc from_urdf_robot
cargo test --locked --package condyle-spatial --no-default-features --features libm --test storage
cargo test --locked --package condyle-model --no-default-features --features libm --test validate
cargo test --locked --package condyle-linalg --no-default-features --features libm --tests
cargo test --locked --package condyle-linalg --no-default-features --features std
cargo clippy --locked --package condyle-codegen --features cuda --all-targets -- -D warnings
cargo test --locked --package condyle-codegen --features cuda --test cuda
cargo test --locked --package condyle-codegen --features cuda --doc cuda
