#!/usr/bin/env bash
# Finds a compiler for another kind of processor, for tests/arm.sh, tests/embedded.sh and tests/wasm.sh, which read this file:
# the one in use, or the system's, if it has the target's library or the sources of the library, which then are compiled first.
#
#     tests/targets.sh install arm|embedded|wasm
#
# installs what one of these tests takes: the library by rustup, or where that has none, Debian's compiler with the sources; what
# links and runs the tests by apt-get (with sudo, unless you are root). Nothing else installs anything into the system.

# $1: a target; $2: the crates of the library that it takes. Sets `cargo`, the command to call in place of cargo, and `linker`,
# where the compiler brings none for what has no C library; or says what is missing, and fails.
compiler_for() {
    local target=$1 crates=$2 way compiler root
    for way in library sources; do
        for compiler in "${RUSTC:-rustc}" /usr/bin/rustc; do
            root=$("$compiler" --print sysroot 2>/dev/null) || continue
            [ -x "$root/bin/cargo" ] && is_recent "$root/bin/rustc" || continue
            cargo=(env RUSTC="$root/bin/rustc" "$root/bin/cargo")
            linker=
            compgen -G "$root/lib/rustlib/*/bin/rust-lld" >/dev/null || linker=$(own_linker "$target")
            if [ $way = library ]; then
                compgen -G "$root/lib/rustlib/$target/lib/libcore-*.rlib" >/dev/null && return
            elif [ -f "$root/lib/rustlib/src/rust/library/Cargo.lock" ]; then
                cargo=(env RUSTC_BOOTSTRAP=1 "${cargo[@]:1}" -Z build-std="$crates" -Z build-std-features=panic-unwind)
                return
            fi
        done
    done
    echo "NOT RUN: no compiler has a library for $target (rustup target add $target, or Debian's ${debian_rust[*]})"
    return 1
}

# LLVM's linker, of the newest version that there is.
own_linker() {
    case $1 in
        wasm*) compgen -c wasm-ld ;;
        *) compgen -c ld.lld ;;
    esac | sort --version-sort | tail -1
}

# Whether a compiler is one that the workspace allows.
is_recent() {
    local oldest version
    oldest=$(sed -nE 's/^rust-version = "(.*)"/\1/p' Cargo.toml)
    version=$("$1" --version | cut -d ' ' -f 2)
    printf '%s\n' "$oldest" "$version" | sort --version-sort --check=quiet
}

# Debian's Rust that it builds browsers with, which is not as old as its other one.
debian_rust=(rustc-web cargo-web rust-web-src)

install() {
    local targets packages package missing=()
    case $1 in
        arm)
            targets=(aarch64-unknown-linux-gnu)
            packages=(gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static)
            ;;
        embedded)
            targets=(thumbv7em-none-eabihf riscv32imac-unknown-none-elf)
            packages=(qemu-system-arm)
            ;;
        wasm)
            targets=(wasm32-unknown-unknown)
            packages=()
            ;;
        *)
            echo "expected arm, embedded or wasm, found \`$1\`"
            return 2
            ;;
    esac
    if ! { command -v rustup >/dev/null && rustup target add "${targets[@]}"; }; then
        packages+=("${debian_rust[@]}" lld-19)
    fi
    for package in "${packages[@]}"; do
        dpkg-query --show --showformat='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
    done
    [ ${#missing[@]} -gt 0 ] || return 0
    command -v apt-get >/dev/null || { echo "there is no apt-get to install ${missing[*]}"; return 1; }
    local apt=(env DEBIAN_FRONTEND=noninteractive apt-get --quiet=2 -o Acquire::http::Timeout=20 -o Acquire::Retries=1)
    if [ "$(id -u)" != 0 ]; then
        if [ -t 0 ]; then apt=(sudo "${apt[@]}"); else apt=(sudo --non-interactive "${apt[@]}"); fi
    fi
    "${apt[@]}" update && "${apt[@]}" install --yes --no-install-recommends "${missing[@]}"
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then
    set -euo pipefail
    cd "$(dirname "${BASH_SOURCE[0]}")/.."
    [ $# = 2 ] && [ "$1" = install ] || { sed -n '2,/^$/s/^# \?//p' tests/targets.sh; exit 2; }
    install "$2"
fi
