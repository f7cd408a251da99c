"""Darknet's own files: networks (.cfg), weights (.weights), data sets (.data) and class names (.names)."""
