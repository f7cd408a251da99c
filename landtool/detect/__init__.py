"""Runs object detection networks stored as ONNX: this project's own and other YOLO models."""
