"""The suite: a frozen comparison that anybody's method can enter, with entries that can be checked, and their board."""
