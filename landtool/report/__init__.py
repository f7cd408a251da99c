"""What a run of `landtool track` says of itself: the verdict on the landing, and the page of plots."""
