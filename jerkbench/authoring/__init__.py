"""What a plugin's author needs: a package to begin from, and the conformance kit over a whole package."""
