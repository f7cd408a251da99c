"""Benchmarks: what landtool claims, measured and printed."""
