"""The printed target around its tags: its large edges as measurements of the pose."""
