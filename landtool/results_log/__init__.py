"""What was found in a recording as an MCAP log that Foxglove and Rerun show without set-up."""
