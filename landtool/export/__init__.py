"""Turns darknet networks into ONNX, in float32 and in int8, with proof that they still give the same."""
