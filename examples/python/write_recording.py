#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Writes a Surefoot recording: a stick figure that stands still, arms to the sides, and then does three squats.

    pip install mcap
    python3 write_recording.py squats.mcap

Replace `stick_figure` by what your sensor sees; docs/recording-format.md explains every field.
"""

import json
import math
import sys

from mcap.writer import CompressionType, Writer

# Names of the joints, in the order of the positions of every frame.
JOINTS = [
    "head", "neck", "torso", "pelvis",
    "left_shoulder", "left_elbow", "left_hand", "left_hip", "left_knee", "left_foot",
    "right_shoulder", "right_elbow", "right_hand", "right_hip", "right_knee", "right_foot",
]

METADATA = {
    "version": "1",
    "handedness": "right",
    "up": "+y",
    "length_unit": "m",
    "protocol": "squat",
    "device_model": "stick-figure",
    "subject_height_m": "1.75",
    "start_time": "2026-03-01T09:30:00Z",
}

SKELETON_SCHEMA = {
    "title": "surefoot.skeleton",
    "type": "object",
    "required": ["positions"],
    "properties": {
        "positions": {"type": "array", "items": {"type": ["array", "null"], "items": {"type": "number"}}},
        "confidence": {"type": "array", "items": {"type": "number"}},
    },
}

REFERENCE_SCHEMA = {
    "title": "surefoot.reference",
    "type": "object",
    "required": ["time_ns", "values"],
    "properties": {
        "time_ns": {"type": "array", "items": {"type": "integer"}},
        "values": {"type": "array", "items": {"type": ["number", "null"]}},
    },
}

STILL_SECONDS = 2.0
SQUAT_SECONDS = 4.0
SECONDS = STILL_SECONDS + 3 * SQUAT_SECONDS
DEEPEST = math.radians(90)
THIGH, SHANK, TRUNK, ARM = 0.43, 0.41, 0.52, 0.30


def knee_flexion(t):
    """Radians, 0 in stance; each squat goes down and up again."""
    phase = 2 * math.pi * max(t - STILL_SECONDS, 0) / SQUAT_SECONDS
    return DEEPEST * (1 - math.cos(phase)) / 2


def stick_figure(t):
    """Joint positions in metres: 2.5 m in front of the sensor, facing it (+z), so its right is at -x."""
    shank = 0.4 * knee_flexion(t)  # the shank leans forward, the thigh backward
    thigh = shank - knee_flexion(t)
    p = {}
    for side, x in (("left", 1), ("right", -1)):
        foot = (0.12 * x, 0.08, -2.5)
        knee = (foot[0], foot[1] + SHANK * math.cos(shank), foot[2] + SHANK * math.sin(shank))
        hip = (knee[0], knee[1] + THIGH * math.cos(thigh), knee[2] + THIGH * math.sin(thigh))
        p[f"{side}_foot"], p[f"{side}_knee"], p[f"{side}_hip"] = foot, knee, hip
    pelvis = (0.0, hip[1] + 0.05, hip[2])
    lean = 0.35 * knee_flexion(t)
    along = lambda part: (0.0, pelvis[1] + part * math.cos(lean), pelvis[2] + part * math.sin(lean))
    p.update(pelvis=pelvis, torso=along(0.25), neck=along(TRUNK), head=along(TRUNK + 0.2))
    for side, x in (("left", 1), ("right", -1)):
        _, y, z = along(TRUNK - 0.05)
        p[f"{side}_shoulder"] = (0.19 * x, y, z)
        p[f"{side}_elbow"] = (0.19 * x + ARM * x, y, z)  # arms to the sides
        p[f"{side}_hand"] = (0.19 * x + 2 * ARM * x, y, z)
    return p


def main(path):
    with open(path, "wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile="surefoot", library="write_recording.py")
        # The metadata record comes before the first message.
        writer.add_metadata("surefoot", METADATA)

        schema = writer.register_schema("surefoot.skeleton", "jsonschema", json.dumps(SKELETON_SCHEMA).encode())
        skeleton = writer.register_channel("/skeleton", "json", schema, {"joints": ",".join(JOINTS)})
        time_ns, frame = 0, 0
        while time_ns <= SECONDS * 1e9:
            points = stick_figure(time_ns * 1e-9)
            positions = [[round(c, 5) for c in points[joint]] for joint in JOINTS]
            if frame % 50 == 25:
                positions[JOINTS.index("left_hand")] = None  # lost in this frame
            # allow_nan=False: NaN is not JSON, a lost joint is null.
            data = json.dumps({"positions": positions}, allow_nan=False).encode()
            writer.add_message(skeleton, log_time=time_ns, data=data, publish_time=time_ns, sequence=frame)
            # A real sensor is never quite regular; send the time at which each frame was taken.
            time_ns += 33_333_333 + 1_000_000 * (frame % 3 - 1)
            frame += 1

        schema = writer.register_schema("surefoot.reference", "jsonschema", json.dumps(REFERENCE_SCHEMA).encode())
        times = list(range(0, int(SECONDS * 1e9) + 1, 10_000_000))
        for side in ("left", "right"):
            values = [round(math.degrees(knee_flexion(t * 1e-9)), 4) for t in times]
            channel = writer.register_channel(
                f"/reference/{side}_knee_flexion_deg", "json", schema,
                {"source": "formula", "clock_offset_ns": "0"},
            )
            for i in range(0, len(times), 500):
                batch = {"time_ns": times[i:i + 500], "values": values[i:i + 500]}
                writer.add_message(channel, log_time=times[i], data=json.dumps(batch).encode(), publish_time=times[i])
        writer.finish()
    print(f"{frame} frames written to {path}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
