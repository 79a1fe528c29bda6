#!/usr/bin/env bash
# Finds a compiler for another kind of processor, for tests/arm.sh, tests/embedded.sh and tests/wasm.sh, which source this file.
# This is the compiler in use or the system's compiler, if it has the library for the target, or the library's sources. In the
# second case the sources are compiled first.
#
#     tests/targets.sh install arm|embedded|wasm
#
# installs the requirements of one of these tests. The library comes from rustup; if rustup fails, Debian's compiler with the
# sources is installed. Linkers and emulators come from apt-get (with sudo, unless you are root). No other script installs
# anything into the system.

# $1: a target; $2: the required crates of the library. Sets `cargo`, the command to use instead of cargo. Sets `linker` if the
# compiler lacks one for targets without a C library. Otherwise prints what is missing, and fails.
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

# Prints the newest installed version of LLVM's linker.
own_linker() {
    case $1 in
        wasm*) compgen -c wasm-ld ;;
        *) compgen -c ld.lld ;;
    esac | sort --version-sort | tail -1
}

# Returns whether the workspace supports the version of a compiler.
is_recent() {
    local oldest version
    oldest=$(sed -nE 's/^rust-version = "(.*)"/\1/p' Cargo.toml)
    version=$("$1" --version | cut -d ' ' -f 2)
    printf '%s\n' "$oldest" "$version" | sort --version-sort --check=quiet
}

# Debian's Rust packages for building browsers, which are newer than its other Rust packages.
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
