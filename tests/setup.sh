#!/bin/sh
# Installs what a fresh Debian or Ubuntu machine lacks: a linker, a software Vulkan driver if there is
# no driver at all, the libraries that a window needs, and what the window test drives it with.
# Does nothing where apt-get is missing or everything is there.
set -eu

command -v apt-get >/dev/null 2>&1 || exit 0

missing=""
need() { # need PACKAGE: unless it is installed
	dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q "install ok installed" || missing="$missing $1"
}

command -v cc >/dev/null 2>&1 || need gcc
command -v cc >/dev/null 2>&1 || need libc6-dev
need libvulkan1
# Any driver will do, a graphics card's or this one.
ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json >/dev/null 2>&1 || need mesa-vulkan-drivers
for package in libx11-6 libx11-xcb1 libxcb1 libxcursor1 libxi6 libxrandr2 libxkbcommon0 libxkbcommon-x11-0 \
	xvfb xdotool; do
	need "$package"
done
[ -z "$missing" ] && exit 0

echo "installing:$missing" >&2
sudo=""
[ "$(id -u)" -eq 0 ] || sudo=sudo
if [ -n "$sudo" ] && ! command -v sudo >/dev/null 2>&1; then
	echo "not root and no sudo: install these packages yourself:$missing" >&2
	exit 1
fi
$sudo apt-get update -qq
# shellcheck disable=SC2086
DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends $missing >&2
