"""One cell, the store, the sweep."""
