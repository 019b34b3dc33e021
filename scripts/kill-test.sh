#!/bin/sh
# Kills the service again and again in the midst of uploads and jobs, and checks that nothing is lost, doubled or stuck.
#
#   scripts/kill-test.sh [BINARY] [ROUNDS]      default: target/release/surefoot, built when absent; 20 rounds
#
# The moments of the kills come from a seed (environment SEED, default 1). At the end every recording that a client was
# told of has one finished assessment per job, no job waits or runs, no part file is left, and equal recordings have
# equal series. Needs Python 3; everything it writes is gone afterwards.
set -eu
root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
binary=${1:-$root/target/release/surefoot}
if [ ! -x "$binary" ]; then
    (cd "$root" && cargo build --release)
fi
exec python3 "$root/scripts/load/kill.py" "$binary" "${2:-20}"
