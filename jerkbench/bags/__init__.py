"""The way from the topics of a bag to a recording: roles, the sanitiser, frames, mounting, time."""
