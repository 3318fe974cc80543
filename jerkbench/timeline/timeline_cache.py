"""The timelines of the latest recordings, for the next adaptation."""

from functools import lru_cache

from jerkbench.timeline.timeline import build_timeline

kept_timeline = lru_cache(maxsize=32)(build_timeline)
"""`build_timeline`, done once for a recording with its attitude; as many as a process keeps recordings."""
