"""The topics and frames of a log of results."""

from __future__ import annotations

from landtool.types import Reference

MAP, BODY, CAMERA, PAD, PLATFORM = "map", "base_link", "camera_optical", "pad", "platform"
"""Frame ids: the world, the drone, its camera, the pad as it is measured, and the platform as it is tracked."""
REFERENCES: dict[Reference, str] = {"world": MAP, "body": BODY}
"""The frame a track is in."""

IMAGE = "/camera/image"
CALIBRATION = "/camera/calibration"
ANNOTATIONS = "/camera/annotations"
ANNOTATED = "/landing/annotated"
POSE = "/landing/pose"
TRACK = "/landing/track"
SCENE = "/landing/scene"
STATUS = "/landing/status"
TF = "/tf"
