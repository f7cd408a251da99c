"""Looking at a generated data set: its pictures with their labels, and what was drawn how often."""
