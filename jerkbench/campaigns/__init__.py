"""What the audit and the suite share: protocol, methods, the pieces that are run and kept, losses and ratios."""
