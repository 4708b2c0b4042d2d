#!/bin/sh
# Make .venv from the lock dev, with that of an extra, baselines or gpu, and install missing system packages.
# `witness` adds the programs of others that tests compare with, Newton in an environment of its own.
# An environment keeps the extras that it has. It prints nothing if there is nothing to do.
set -eu
stamp=.venv/.installed
extras=""
for extra in baselines gpu; do
    if [ "${1:-dev}" = $extra ] || [ -e .venv/.$extra ]; then extras="$extras $extra"; fi
done
locks="" # that of an extra has all that dev has, in versions that go with the extra
for extra in $extras; do locks="$locks requirements/$extra.txt"; done
locks=${locks:-requirements/dev.txt}

install() {
    if ! command -v apt-get >/dev/null 2>&1; then
        echo "setup: this system has no apt-get; install these packages: $*" >&2
        exit 2
    fi
    root=""
    if [ "$(id -u)" -ne 0 ]; then
        root="sudo"
        command -v sudo >/dev/null 2>&1 || {
            echo "setup: no root rights and no sudo; install these packages as root: $*" >&2
            exit 2
        }
    fi
    echo "setup: installing system packages: $*" >&2
    $root apt-get update -qq
    $root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# --- system packages: soname package -------------------------------------------------------------------------------
missing=""
cache=$(PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null || true)
while read -r soname package; do
    case "$cache" in *"$soname"*) ;; *) missing="$missing $package" ;; esac
done <<EOF
libOSMesa.so libosmesa6
libusb-1.0.so.0 libusb-1.0-0
libgomp.so.1 libgomp1
libGL.so.1 libgl1
libEGL.so.1 libegl1
libX11.so.6 libx11-6
EOF
command -v git >/dev/null 2>&1 || missing="$missing git ca-certificates"
command -v cavern >/dev/null 2>&1 || missing="$missing survex" # solves surveys; it needs no display
command -v bwrap >/dev/null 2>&1 || missing="$missing bubblewrap" # runs policies of others
if [ "${1:-dev}" = witness ]; then
    while read -r program package; do
        command -v "$program" >/dev/null 2>&1 || missing="$missing $package"
    done <<EOF
therion therion
pkg-config pkg-config
g++ g++
Xvfb xvfb
chromium-headless-shell chromium-headless-shell
node nodejs
npm npm
EOF
    pkg-config --list-package-names 2>/dev/null | grep -q '^sdformat[0-9]' || missing="$missing libsdformat-dev"
fi
pythons="${PYTHON:-} python3 python3.13 python3.12 python3.11"
any_python() { for python in $pythons; do command -v "$python" >/dev/null 2>&1 && return 0; done; return 1; }
any_python || missing="$missing python3 python3-venv"
# shellcheck disable=SC2086
[ -z "$missing" ] || install $missing

# --- Python packages -----------------------------------------------------------------------------------------------
# Python finds the project's packages from any folder. A .venv that is a link belongs to another checkout.
put_on_path() {
    [ ! -L .venv ] || return 0
    for site in .venv/lib/python3*/site-packages; do
        [ ! -d "$site" ] || echo "$PWD" | cmp -s - "$site/minexplore.pth" || echo "$PWD" >"$site/minexplore.pth"
    done
}

packages_of_npm() {
    cmp -s requirements/witness/package-lock.json .venv/package-lock.json && return 0
    cp requirements/witness/package.json requirements/witness/package-lock.json .venv/
    npm ci --silent --no-audit --no-fund --prefix .venv || rm -f .venv/package-lock.json
}

# Newton brings MuJoCo Warp, which the project uses wherever it is installed; so they have an environment of their own.
packages_of_newton() {
    cmp -s requirements/witness.txt .venv/witness/.installed && return 0
    if .venv/bin/uv venv --quiet --clear --python .venv/bin/python .venv/witness &&
        .venv/bin/uv pip sync --quiet --compile-bytecode --require-hashes --python .venv/witness/bin/python \
            requirements/witness.txt; then
        cp requirements/witness.txt .venv/witness/.installed
    fi
}

packages_of_witness() {
    [ "${1:-dev}" = witness ] || return 0
    packages_of_npm
    packages_of_newton
}

# shellcheck disable=SC2086
cat $locks | cmp -s - "$stamp" && put_on_path && packages_of_witness "$@" && exit 0

works() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1; }
python=""
for candidate in $pythons; do
    if works "$candidate"; then python=$candidate && break; fi
done
if [ -z "$python" ]; then
    echo "setup: no Python 3.11, 3.12 or 3.13 found; install one, or give its path: make setup PYTHON=/path/to/python" >&2
    exit 2
fi
echo "setup: installing Python packages into .venv ($("$python" --version))" >&2
if ! works .venv/bin/python; then # --clear empties .venv but keeps the folder, which may be a mount of a container
    "$python" -m venv --clear .venv >/dev/null 2>&1 || {
        install python3-venv
        "$python" -m venv --clear .venv
    }
fi
.venv/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/bootstrap.txt
# shellcheck disable=SC2086
.venv/bin/uv pip sync --quiet --compile-bytecode --require-hashes --python .venv/bin/python $locks requirements/bootstrap.txt
if [ -n "$extras" ]; then # torch's wheels differ by platform, so it is pinned without hashes
    .venv/bin/python -m pip install --quiet --disable-pip-version-check \
        "$(sed -n 's/^ *"\(torch==[^"]*\)".*/\1/p' pyproject.toml | head -n 1)"
    for extra in $extras; do touch ".venv/.$extra"; done
fi
put_on_path
packages_of_witness "$@"
# shellcheck disable=SC2086
cat $locks >"$stamp"
