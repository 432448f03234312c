# SPDX-License-Identifier: MIT
# What the scripts share: Debian packages, building. Sourced, not run.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
jobs=$(nproc)
export CCACHE_DIR=${CCACHE_DIR:-$HOME/.ccache} CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1
export CCACHE_SLOPPINESS=pch_defines,time_macros  # for precompiled headers
export CMAKE_CXX_COMPILER_LAUNCHER=ccache CMAKE_C_COMPILER_LAUNCHER=ccache

packages_build=(build-essential cmake ninja-build ccache pkg-config git
  libboost-dev libboost-program-options-dev libeigen3-dev libspdlog-dev nlohmann-json3-dev
  libbullet-dev libsdformat-dev libassimp-dev libusb-1.0-0-dev libsystemd-dev python3)
packages_test=(catch2 file umockdev libumockdev-dev systemd-container)
packages_full=(clang libclang-rt-14-dev clang-format clang-tidy lintian)

say() { printf '%s\n' "$*" >&2; }
die() { say "$0: $*"; exit 1; }

# ensure_packages NAME...: installs what is missing, as root or through sudo.
ensure_packages() {
  local missing=() package
  for package in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
      missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return
  local sudo=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || die "as root, install: ${missing[*]}"
    sudo=(sudo)
  fi
  say "installing ${missing[*]}"
  local log
  log=$(mktemp)
  { "${sudo[@]}" apt-get update -qq &&
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq \
      --no-install-recommends "${missing[@]}"; } >"$log" 2>&1 ||
    { tail -20 "$log" >&2; rm -f "$log"; die "installing ${missing[*]} failed"; }
  rm -f "$log"
}

# ensure_npm: Node and npm, which bundle the viewer's page, from wherever they are. False where they cannot be had:
# the build then leaves the viewer out.
ensure_npm() {
  command -v node >/dev/null && command -v npm >/dev/null && return
  (ensure_packages nodejs npm) || { say "the viewer is left out: no npm"; return 1; }
}

# build PRESET [TARGET...]: configures and builds into build/PRESET; quiet unless it fails.
build() {
  local preset=$1 log
  shift
  log=$(mktemp)
  say "building ($preset${*:+: $*})"
  (cd "$root" && cmake --preset "$preset" && cmake --build --preset "$preset" -j "$jobs" \
    ${*:+--target "$@"}) >"$log" 2>&1 ||
    { grep -E 'error|Error|FAILED' "$log" | head -20 >&2; tail -30 "$log" >&2; rm -f "$log"
      die "building $preset failed"; }
  rm -f "$log"
}
