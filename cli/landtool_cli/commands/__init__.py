"""One file a command; each defines `command`, loaded only when it is called."""
