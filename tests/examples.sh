#!/usr/bin/env bash
# Runs the Rust examples, which check their results with assertions. Without `full`, only examples that take seconds
# run. The examples write their files into a temporary folder.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

short=(own_cost reach wholebody_clarabel wholebody_stand)
long=(energy_drift mpc trot walk wholebody_humanoid wholebody_trot)
diff <(printf '%s\n' "${short[@]}" "${long[@]}" | sort) <(basename --suffix .rs --multiple examples/*.rs | sort) ||
    { echo "the list of examples in tests/examples.sh is not that of the folder"; exit 1; }

run=("${short[@]}")
[ "${1:-}" = full ] && run+=("${long[@]}")
# The features are the same as in `cargo test --workspace`, so that its build is reused.
cargo build --locked --quiet --workspace "${run[@]/#/--example=}"
built=$(realpath "${CARGO_TARGET_DIR:-target}")/debug/examples
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for example in "${run[@]}"; do
    file=()
    case $example in trot | walk) file=("$folder/$example.html") ;; esac
    begin=$SECONDS
    (cd "$folder" && "$built/$example" "${file[@]}" >"$example.txt" 2>&1) || { cat "$folder/$example.txt"; exit 1; }
    [ -s "$folder/$example.txt" ] || { echo "$example prints nothing"; exit 1; }
    [ ${#file[@]} = 0 ] || [ -s "${file[0]}" ] || { echo "$example writes no page"; exit 1; }
    echo "$example: $((SECONDS - begin)) s"
done
