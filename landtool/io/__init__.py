"""Readers and writers of the formats landtool knows; docs/formats.md describes them."""
