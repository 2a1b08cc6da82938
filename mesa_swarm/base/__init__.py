"""What every room may need: errors, words, random streams, files that are written whole, progress."""
