"""Recordings through the method into their folders: one module a command, and what they have in common."""
