"""Every figure of a study: drawn, written, put into the report."""
