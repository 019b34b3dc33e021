#!/bin/sh
# Measures the service on this machine and prints a Markdown table: requests per second, memory, job pick-up.
#
#   scripts/measure-service.sh [BINARY]        default: target/release/surefoot, built when absent
#
# Needs wrk (Debian: apt-get install wrk) and Python 3. Environment: SECONDS_PER_ROW (default 8) is the length of each
# load. Services run on free ports and data directories of their own under ${TMPDIR:-/tmp}; both are gone afterwards.
# The durability of an upload costs what that disk's fsync costs, so name the disk with the numbers.
set -eu
root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
binary=${1:-$root/target/release/surefoot}
if ! command -v wrk >/dev/null; then
    echo "wrk is absent; on Debian: apt-get install -y wrk" >&2
    exit 1
fi
if [ ! -x "$binary" ]; then
    (cd "$root" && cargo build --release)
fi
exec python3 "$root/scripts/load/measure.py" "$binary"
