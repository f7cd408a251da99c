"""The command line of landtool: parse, call one library function, render."""
