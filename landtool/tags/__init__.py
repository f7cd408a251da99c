"""Tags: reading them, their pose, and the choice between its two solutions."""
