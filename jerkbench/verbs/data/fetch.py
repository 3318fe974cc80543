"""`jerkbench data fetch`: public recordings from where they are published."""

import argparse

from jerkbench.verbs.arguments import Verbs, add_verb


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    fetch = add_verb(verbs, "fetch", "download a public recording, check it, and keep it", answer)
    fetch.add_argument("name", nargs="?", help="the recording; without it: what there is, and where it is kept")


def answer(chosen: argparse.Namespace) -> None:
    """Fetch the recording, or list what there is.

    Raises:
        RecordingError: there is no such recording, or it cannot be had.
    """
    from jerkbench.fetching import fetch, public_recording, public_recordings
    from jerkbench.io.files import fetched_folder

    if chosen.name is None:
        for public in public_recordings().values():
            kept = fetched_folder(public.name)
            state = kept if kept.is_dir() else "not fetched"
            print(f"{public.name}: {public.title} ({public.licence}); {state}")
        return
    recording, folder = public_recording(chosen.name), fetched_folder(chosen.name)
    fetch(recording, folder, print)
    print(f"{recording.name} ({recording.licence}) is in {folder}")
