"""Messages of equal length, cut out of a bag many at a time by its index, without a loop over messages.

What is not made for it (several lengths, no index, damage) raises `NotInBulk` or what the libraries raise; then the
ordinary reader does it, message by message, and finds the words for the damage.
"""
