"""Tools for a plugin's author: a package to begin from, and the conformance kit over a whole package."""
