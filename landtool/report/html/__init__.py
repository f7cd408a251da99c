"""The report: one HTML page of a run or an evaluation that needs nothing but a browser."""
