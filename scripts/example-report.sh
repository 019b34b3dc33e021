#!/bin/sh
# An example report from simulated recordings: as the clinician's page (HTML and PDF), as JSON and as a FHIR bundle.
#
#   scripts/example-report.sh FOLDER [BINARY]        default binary: target/release/surefoot, built when absent
#
# Simulates a few weeks of exercises of one patient, uploads them to a service of its own, waits, and writes report.html (with
# its style sheet beside it), report.json, report.fhir.json, and with a Chromium report.pdf. The service and its data are gone
# afterwards.
set -eu

out=${1:?"name a folder for the report"}
root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
binary=${2:-$root/target/release/surefoot}
if [ ! -x "$binary" ]; then
    (cd "$root" && cargo build --release)
fi
mkdir -p "$out"
out=$(CDPATH='' cd -- "$out" && pwd)

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
member() {
    python3 -c 'import functools, json, sys
print(functools.reduce(lambda value, name: value[name], sys.argv[1:], json.load(sys.stdin)))' "$@"
}
address=$(member address <"$work/started")
key=$(member admin_key <"$work/started")
get() {
    curl --silent --show-error --fail-with-body --header "Authorization: Bearer $key" "$address$1"
}
post() {
    curl --silent --show-error --fail-with-body --request POST --header "Authorization: Bearer $key" \
        --header 'Content-Type: application/json' --data-binary "$2" "$address$1"
}

patient=$(post /v1/patients '{"pseudonym": "example", "birth_year": 1947, "sex": "female", "height_m": 1.64,
    "uses_walking_aid": false}' | member id)
post "/v1/patients/$patient/consents" '{"scope": "assessment", "text_version": "example"}' >"$work/answer"
post "/v1/patients/$patient/questionnaires" '{"falls_12_months": 1, "medicines": 5, "takes_psychotropic": false,
    "lives_in_community": true, "worries_about_falling": true, "feels_unsteady": true}' >"$work/answer"
post "/v1/patients/$patient/training-plans" '{"sessions_per_week": 3, "exercises": [{"protocol": "back_knee",
    "repetitions": 4}, {"protocol": "side_hip"}, {"protocol": "near_tandem"}]}' >"$work/answer"
for test in '2026-09-01 1.02 15.1' '2026-10-01 0.97 14.4' '2026-11-01 0.79 12.1'; do
    # shellcheck disable=SC2086  # the three words are what is wanted
    set -- $test
    post "/v1/patients/$patient/measurements" "{\"measured_at\": \"$1T10:00:00Z\", \"measures\": {
        \"usual_speed_mps\": {\"value\": $2, \"standard_error\": 0.03, \"n_observations\": 20},
        \"five_times_sit_to_stand_s\": {\"value\": $3, \"standard_error\": 0.3}}}" >"$work/answer"
done
seed=1
for exercise in back_knee side_hip step near_tandem sit_front_knee back_knee; do
    "$binary" simulate "$exercise" --seed "$seed" --out "$work/$seed.mcap" >"$work/answer"
    day=$(python3 -c 'import datetime, sys
print((datetime.datetime.now(datetime.timezone.utc) - datetime.timedelta(days=20 - 3 * int(sys.argv[1]))).isoformat())' "$seed")
    session=$(post /v1/sessions "{\"patient_id\": \"$patient\", \"protocol\": \"$exercise\", \"started_at\": \"$day\"}" | member id)
    curl --silent --show-error --fail-with-body --header "Authorization: Bearer $key" \
        --header 'Content-Type: application/mcap' --data-binary "@$work/$seed.mcap" \
        "$address/v1/sessions/$session/recordings" >"$work/answer"
    job=$(member job id <"$work/answer")
    # The events end with the job.
    curl --silent --fail --max-time 300 --header "Authorization: Bearer $key" "$address/v1/jobs/$job/events" >"$work/events"
    seed=$((seed + 1))
done

get "/v1/patients/$patient/report" >"$out/report.json"
get "/v1/patients/$patient/fhir-bundle" >"$out/report.fhir.json"
curl --silent --show-error --fail-with-body --cookie-jar "$work/cookies" --header "Origin: $address" \
    --data-urlencode "key=$key" --output /dev/null "$address/app/sign-in"
page() {
    curl --silent --show-error --fail-with-body --cookie "$work/cookies" "$address$1"
}
page "/app/patients/$patient" >"$work/page.html"
style=$(sed -n 's/.*href="\(\/app\/assets\/[^"]*\.css\)".*/\1/p' "$work/page.html" | head -n 1)
page "$style" >"$out/report.css"
# The page as a file of its own: its style sheet beside it, no script, no links into a service that is gone.
sed -e "s|$style|report.css|" -e '/<script/d' -e 's|href="/app/[^"]*"|href="#"|g' "$work/page.html" >"$out/report.html"
chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)
if [ -n "$chromium" ]; then
    "$chromium" --headless --no-sandbox --disable-gpu --no-pdf-header-footer --user-data-dir="$work/chromium" \
        --print-to-pdf="$out/report.pdf" "file://$out/report.html" >"$work/print" 2>&1
else
    echo "no report.pdf: there is no Chromium; print report.html instead" >&2
fi
ls -l "$out"
