"""Public recordings from where they are published: listed, downloaded, checked, kept."""
