"""Faults of recorded messages: counted, reported, and dropped, repaired or refused.

Each check takes `Messages` and a `Ledger` and returns the messages that are left. With the mode "repair" what can be
mended is mended and the rest dropped, with "drop" everything wrong is dropped, with "refuse" it is an error.
"""
