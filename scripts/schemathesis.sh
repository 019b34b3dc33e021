#!/bin/sh
# Holds the running service against its own OpenAPI document, with requests made up by schemathesis.
#
#   scripts/schemathesis.sh [BINARY]        default: target/debug/surefoot, built when absent
#
# Ends with status 0 only without a single failure. The same requests every time: the seed is fixed and the examples are
# bounded. schemathesis comes from PyPI into target/schemathesis; the service runs on a free port and a data directory
# of its own, and both are gone afterwards.
set -eu

SCHEMATHESIS=4.32.5
SEED=20261122
EXAMPLES=60

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
binary=${1:-$root/target/debug/surefoot}
venv=$root/target/schemathesis

if [ ! -x "$binary" ]; then
    (cd "$root" && cargo build)
fi
if [ "$("$venv/bin/schemathesis" --version 2>/dev/null || true)" != "schemathesis, version $SCHEMATHESIS" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check "schemathesis==$SCHEMATHESIS"
fi

work=$(mktemp -d)
server=
finish() {
    if [ -n "$server" ]; then
        kill "$server" 2>/dev/null || true
        wait "$server" 2>/dev/null || true
    fi
    rm -rf "$work"
}
trap finish EXIT
trap 'exit 130' INT TERM

# Made-up requests come faster than any client's.
export SUREFOOT_REQUESTS_PER_MINUTE=0 SUREFOOT_ANONYMOUS_REQUESTS_PER_MINUTE=0
"$binary" serve --json --data-dir "$work/data" --listen 127.0.0.1:0 >"$work/started" 2>"$work/log" &
server=$!
attempts=0
while [ ! -s "$work/started" ]; do
    attempts=$((attempts + 1))
    if [ $attempts -gt 100 ] || ! kill -0 "$server" 2>/dev/null; then
        echo "the service did not start:" >&2
        cat "$work/log" >&2
        exit 1
    fi
    sleep 0.1
done
field() {
    python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))[sys.argv[2]])' "$work/started" "$1"
}
address=$(field address)
SUREFOOT_KEY=$(field admin_key)
export SUREFOOT_KEY

# One of each thing, so that the second run meets rows and not only 404.
post() {
    curl --silent --show-error --fail-with-body --request POST --header "Authorization: Bearer $SUREFOOT_KEY" \
        --header 'Content-Type: application/json' --data-binary "$2" "$address$1"
}
member() {
    python3 -c 'import functools, json, sys
print(functools.reduce(lambda value, name: value[name], sys.argv[1:], json.load(sys.stdin)))' "$@"
}
curl --silent --fail "$address/openapi.json" | member paths '/v1/sessions/{id}/recordings' post requestBody content \
    application/json example | python3 -c 'import ast, json, sys
print(json.dumps(ast.literal_eval(sys.stdin.read())))' >"$work/recording.json"
PATIENT_ID=$(post /v1/patients '{"pseudonym": "schemathesis"}' | member id)
post "/v1/patients/$PATIENT_ID/consents" '{"scope": "assessment", "text_version": "1"}' >"$work/consent"
SESSION_ID=$(post /v1/sessions "{\"patient_id\": \"$PATIENT_ID\"}" | member id)
post "/v1/sessions/$SESSION_ID/recordings" "@$work/recording.json" >"$work/uploaded"
RECORDING_ID=$(member recording id <"$work/uploaded")
JOB_ID=$(member job id <"$work/uploaded")
# The events end with the job.
curl --silent --fail --max-time 60 --header "Authorization: Bearer $SUREFOOT_KEY" "$address/v1/jobs/$JOB_ID/events" \
    >"$work/events"
# A job that refused the recording has no assessment: its operations then meet 404 again.
ASSESSMENT_ID=$(sed -n 's/^data: //p' "$work/events" | tail -n 1 | member assessment_id)
[ "$ASSESSMENT_ID" != None ] || ASSESSMENT_ID=$JOB_ID
export PATIENT_ID SESSION_ID RECORDING_ID JOB_ID ASSESSMENT_ID

# A run leaves files in its folder; they belong to the temporary one.
cd "$work"
check() {
    config=$1
    shift
    "$venv/bin/schemathesis" --config-file "$root/scripts/$config" run "$address/openapi.json" --seed "$SEED" \
        --max-examples "$EXAMPLES" --generation-database none --workers 1 --continue-on-failure "$@" && return
    echo "the service's log ends with:" >&2
    tail -n 40 "$work/log" >&2
    exit 1
}
# It cannot make bodies of `application/offset+octet-stream`; tests/api/resumable.rs does.
check schemathesis.toml --exclude-operation-id continue_upload
# The rows stay, and what begins an upload has parameters of its own.
check schemathesis-rows.toml --exclude-operation-id erase_patient --exclude-operation-id create_upload --phases examples,coverage,fuzzing --include-path-regex '\{id\}'
