"""Train a network in torch: the only part of landtool that needs it (`pip install 'landtool[train]'`)."""
