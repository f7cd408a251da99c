"""Rendered pictures with exact truth."""
