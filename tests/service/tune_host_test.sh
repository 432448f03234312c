#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scripts/tune_host on a made-up machine: show changes nothing, apply changes what is not as it should be, undo puts back exactly
# that. Usage: tune_host_test.sh SOURCE_FOLDER
set -euo pipefail

tune() { "$source/scripts/tune_host" "$@"; }
fail() { printf '%s\n' "FAILED: $*"; exit 1; }
is() { [ "$(cat "$TUNE_HOST_ROOT/$1")" = "$2" ] || fail "$1 is $(cat "$TUNE_HOST_ROOT/$1"), not $2"; }

source=$1
TUNE_HOST_ROOT=$(mktemp -d)
export TUNE_HOST_ROOT
trap 'rm -rf "$TUNE_HOST_ROOT"' EXIT
cd "$TUNE_HOST_ROOT"
mkdir -p run sys/devices/system/cpu/cpu{0,1}/cpufreq sys/bus/usb/devices/{1-1,1-2}/power
echo powersave >sys/devices/system/cpu/cpu0/cpufreq/scaling_governor
echo performance >sys/devices/system/cpu/cpu1/cpufreq/scaling_governor
echo 0cec >sys/bus/usb/devices/1-1/idVendor
echo 1234 >sys/bus/usb/devices/1-2/idVendor
for device in 1-1 1-2; do echo auto >sys/bus/usb/devices/$device/power/control; done

before=$(find . -type f -exec sha256sum {} + | sort)
tune | grep >/dev/null 'better .*cpu0/cpufreq/scaling_governor = performance, is powersave' || fail "show does not name the governor"
tune show | grep >/dev/null 'good .*cpu1/cpufreq' || fail "show does not see what is good"
tune undo | grep >/dev/null 'nothing was changed' || fail "undo before apply"
[ "$before" = "$(find . -type f -exec sha256sum {} + | sort)" ] || fail "show or undo changed something"

tune apply >/dev/null
tune apply >/dev/null # what was there before the first one is what undo must know
is sys/devices/system/cpu/cpu0/cpufreq/scaling_governor performance
is sys/bus/usb/devices/1-1/power/control on
is sys/bus/usb/devices/1-2/power/control auto # not ours
tune undo >/dev/null
[ "$before" = "$(find . -type f -exec sha256sum {} + | sort)" ] || fail "undo has not put back everything"

status=0
tune sideways 2>/dev/null || status=$?
[ "$status" = 64 ] || fail "an unknown word ends with $status"
echo "everything holds"
