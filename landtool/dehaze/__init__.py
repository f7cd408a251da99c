"""Dehazing: the dark channel prior as the paper has it, and a smooth veil that holds from above."""
