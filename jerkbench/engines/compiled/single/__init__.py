"""One run: vectors hold pieces of its matrices."""
