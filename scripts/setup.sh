#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Makes this clone runnable: system packages (only those that are missing), .venv, an editable install with the
# test extra, and an up-to-date build of the C++ core in build/editable. Run it as often as you like: what is
# there already is not done again.
#
#   PYTHON=/path/to/python3     use this interpreter for .venv (3.11 or newer, with venv and headers)
#   LODLAB_OPENIMAGEIO=OFF      build without OpenImageIO
#   LODLAB_NATIVE=ON            compile for this very processor
#   LODLAB_WERROR=ON            compiler warnings are errors
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf 'setup: %s\n' "$*"; }
die() { printf 'setup: %s\n' "$*" >&2; exit 1; }

# A usable interpreter can make virtual environments and compile extension modules.
usable_python() {
  "$1" - <<'PY' 2>/dev/null
import ensurepip, os, sys, sysconfig, venv
sys.exit(not (sys.version_info >= (3, 11) and os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h"))))
PY
}

find_python() {
  local candidate
  for candidate in ${PYTHON:-python3 /usr/bin/python3 python3.13 python3.12 python3.11}; do
    if command -v "$candidate" >/dev/null && usable_python "$candidate"; then
      command -v "$candidate"
      return 0
    fi
  done
  return 1
}

install_packages() {
  local root=()
  command -v apt-get >/dev/null ||
    die "missing: $*. This script installs packages on Debian and Ubuntu only; install their like by hand."
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null ||
      die "missing packages, and neither root nor sudo is here. As root: apt-get install --no-install-recommends $*"
    root=(sudo)
  fi
  say "installing with apt: $*"
  "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -q ||
    die "apt-get update failed; is the network there?"
  "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$@" ||
    die "apt-get could not install: $*"
}

wanted=(g++ cmake ninja-build pkg-config ccache git doctest-dev libglm-dev libtbb-dev nlohmann-json3-dev libmeshoptimizer-dev
        libembree-dev libsqlite3-dev libxxhash-dev libepoxy-dev libegl1 libgl1-mesa-dri)
openimageio="${LODLAB_OPENIMAGEIO:-ON}"
[ "$openimageio" = OFF ] || wanted+=(libopenimageio-dev)

missing=()
if command -v dpkg-query >/dev/null; then
  installed="$(dpkg-query -W -f='${db:Status-Abbrev} ${Package}\n' "${wanted[@]}" 2>/dev/null | awk '$1 == "ii" {print $2}' || true)"
  for package in "${wanted[@]}"; do
    grep -qxF "$package" <<<"$installed" || missing+=("$package")
  done
fi
python="$(find_python || true)"
if [ -z "$python" ]; then
  [ -z "${PYTHON:-}" ] || die "PYTHON=$PYTHON is not a Python of version 3.11 or newer with venv and headers."
  missing+=(python3 python3-venv python3-dev)
fi
[ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}"
[ -n "$python" ] || python="$(find_python)" ||
  die "no Python of version 3.11 or newer with venv and headers, not even after installing python3-dev and python3-venv."

# The stamp holds everything that the environment and the configured build depend on; sources are CMake's matter.
version="$("$python" -c 'import sys; print(sys.base_prefix, sys.version)')"
stamp="$({ printf '%s\n' "$PWD" "$version" "$openimageio" "${LODLAB_NATIVE:-OFF}" "${LODLAB_WERROR:-OFF}"
           cat pyproject.toml scripts/setup.sh
           find python/lodlab -name '*.py' | LC_ALL=C sort; } | sha256sum | cut -c1-64)"
environment="$(printf '%s\n' "$PWD" "$version" | sha256sum | cut -c1-64)"

if [ ! -x .venv/bin/python ] || [ "$(cat .venv/lodlab-environment 2>/dev/null)" != "$environment" ]; then
  say "making .venv with $python"
  rm -rf .venv build/editable
  "$python" -m venv .venv
  printf '%s\n' "$environment" >.venv/lodlab-environment
fi
if [ "$(cat .venv/lodlab-stamp 2>/dev/null)" != "$stamp" ]; then
  rm -f .venv/lodlab-stamp
  say "installing lodlab and its Python packages into .venv (compiles the core: minutes the first time)"
  requires="$(.venv/bin/python -c 'import tomllib; print("\n".join(tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"]))')"
  mapfile -t requires <<<"$requires"
  .venv/bin/python -m pip install -q --disable-pip-version-check "${requires[@]}"
  .venv/bin/python -m pip install -q --disable-pip-version-check --no-build-isolation \
    --config-settings=cmake.define.LODLAB_OPENIMAGEIO="$openimageio" \
    --config-settings=cmake.define.LODLAB_NATIVE="${LODLAB_NATIVE:-OFF}" \
    --config-settings=cmake.define.LODLAB_WERROR="${LODLAB_WERROR:-OFF}" -e '.[test]'
  printf '%s\n' "$stamp" >.venv/lodlab-stamp
else
  site="$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_paths()["platlib"])')"
  log="$(mktemp)"
  trap 'rm -f "$log"' EXIT
  cmake --build build/editable >"$log" 2>&1 || { cat "$log" >&2; die "the C++ core does not build"; }
  cmake --install build/editable --prefix "$site" >"$log" 2>&1 || { cat "$log" >&2; die "the C++ core does not install"; }
fi
say "ready: .venv/bin/lodlab"
