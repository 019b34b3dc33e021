#!/bin/sh
# Trains the noise models that are shipped in src/assessment/noise_model, from part of the public data sets: UI-PRMD
# (Kinect v2) subjects s01 and s02, UTD-MHAD (Kinect v1) subjects s1 and s3. The other subjects are left for evaluation.
# Nobody stands still for a second in these data, so white noise comes from third differences.
#
# Usage: scripts/train-shipped-noise-models.sh [folder of the data sets]
set -eu
cd "$(dirname "$0")/.."
data=${1:-${SUREFOOT_DATA:-../shared/data}}
surefoot=${SUREFOOT:-target/release/surefoot}
models=src/assessment/noise_model
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

"$surefoot" import uiprmd "$data/skeleton" "$folder/uiprmd"
"$surefoot" import utdmhad "$data/skeleton" "$folder/utdmhad"
"$surefoot" train --name kinect-v2 --white-from-movement --movement "$folder"/uiprmd/*_s01_*.mcap "$folder"/uiprmd/*_s02_*.mcap \
  --description "Kinect v2: all movements of subjects s01 and s02 of UI-PRMD (20 trials); subjects s03, s05, s06 and KERAAL are left for evaluation" \
  --out "$models/kinect-v2.json"
"$surefoot" train --name kinect-v1 --white-from-movement --movement "$folder"/utdmhad/*_s1_*.mcap "$folder"/utdmhad/*_s3_*.mcap \
  --description "Kinect v1: actions a22 to a27 of subjects s1 and s3 of UTD-MHAD (24 trials); subjects s5 and s7 are left for evaluation" \
  --out "$models/kinect-v1.json"
