"""Recordings on disk: `recording.yaml` and a compressed bag."""

from __future__ import annotations

import heapq
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.estimate_topics import estimate_topics
from wind_sensors.recordings.other_topics import CopiedMessage, OtherTopics
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.raw_topics import raw_topics
from wind_sensors.recordings.reading import BAG_FOLDER, STATION_FILE
from wind_sensors.recordings.serialising import TopicMessages
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.station.signals import Recording
from wind_sensors.station.writing import station_to_yaml

if TYPE_CHECKING:
    from wind_sensors.estimation.outputs import ProcessedRecording


def write_recording(
    folder: str | Path,
    recording: Recording,
    *,
    outputs: ProcessedRecording | Sequence[TopicMessages] = (),
    others: OtherTopics | None = None,
    force: bool = False,
) -> Path:
    """Write a recording as a folder with `recording.yaml` and `bag/` (mcap, zstd).

    Args:
        folder: Where to.
        recording: Station and signals; the signals go to the topics that the station names, the
            truth to `/truth/wind`.
        outputs: What an estimator found, or further messages.
        others: Topics of the bag it was read from that are to be copied as they are.
        force: Replace a recording that is there.

    Returns:
        The folder.

    Raises:
        UserError: Something is there already, cannot be written, or a signal cannot be expressed
            by the type that the station names.
    """
    types = typestore()
    topics = raw_topics(recording, types)
    topics += outputs if isinstance(outputs, Sequence) else estimate_topics(outputs, types)
    text = station_to_yaml(recording.station, shipped_profiles())
    return write_topics(folder, text, topics, others=others, force=force)


def write_topics(
    folder: str | Path,
    station_text: str,
    topics: Sequence[TopicMessages],
    *,
    others: OtherTopics | None = None,
    force: bool = False,
) -> Path:
    """Write serialised messages and the text of their station file as a recording.

    Raises:
        UserError: Something is there already, or the folder cannot be written.
    """
    names = Counter(topic.topic for topic in topics)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise UserError(
            f"two kinds of messages go to {', '.join(twice)}.",
            str(folder),
            "Choose input topics in the station file that are not among the outputs (wind/...).",
        )
    target = Path(folder)
    clear_target(target, force=force)
    partial = target.with_name(f".{target.name}.partial")
    with refused_in_words(folder, "recording"):
        try:
            if partial.exists():
                shutil.rmtree(partial)
            partial.mkdir(parents=True)
            (partial / STATION_FILE).write_text(station_text, encoding="utf-8")
            _write_bag(partial / BAG_FOLDER, topics, others)
            partial.rename(target)
        except OSError:
            shutil.rmtree(partial, ignore_errors=True)
            raise
    return target


def keep_inputs(
    target: str | Path, inputs: Sequence[str | Path | None], *, may_lie_inside: bool = False
) -> None:
    """Refuse to write where that would remove or change what is read.

    Args:
        target: Folder that a command is going to write, and with --force to replace.
        inputs: Recordings, bags and files that it reads; names of what ships and None are passed
            over.
        may_lie_inside: The target may lie in an input's folder, because it is no part of it.

    Raises:
        UserError: The target is one of the inputs, contains one or lies inside one, whatever the
            way by symbolic links.
    """
    place = Path(target).resolve()
    for given in inputs:
        if given is None or not Path(given).exists():
            continue
        # The parts of a recording may be links to somewhere else.
        parts = (Path(given), Path(given) / STATION_FILE, Path(given) / BAG_FOLDER)
        for read in (part.resolve() for part in parts if part.exists()):
            if place == read:
                what = f"the result cannot replace {given}, which it comes from."
            elif place in read.parents:
                what = f"the result cannot replace the folder that holds {given}, which it reads."
            elif read in place.parents and not may_lie_inside:
                what = f"the result cannot go into {given}, which it comes from."
            else:
                continue
            raise UserError(what, str(target), "Name another folder with -o.")


def clear_target(target: Path, *, force: bool) -> None:
    """Make way for a recording.

    Raises:
        UserError: Something is there and `force` is not given, or it is not a recording or cannot
            be removed.
    """
    if not target.exists():
        return
    if not force:
        raise UserError(
            "this exists already.", str(target), "Choose another place with -o, or add --force."
        )
    # A recorder without a station leaves a bag alone, and a killed one no metadata.yaml in it.
    recorded = any(
        part.exists()
        for part in (
            target / STATION_FILE,
            target / "metadata.yaml",
            target / BAG_FOLDER / "metadata.yaml",
            target / BAG_FOLDER / f"{BAG_FOLDER}.mcap",
        )
    )
    if not target.is_dir() or (any(target.iterdir()) and not recorded):
        raise UserError(
            "this is not a recording, so --force does not remove it.",
            str(target),
            "Choose another place with -o.",
        )
    try:
        shutil.rmtree(target)
    except OSError as problem:
        raise UserError(
            f"this cannot be removed ({problem.strerror or problem}).",
            str(target),
            "Choose another place with -o.",
        ) from None


def _write_bag(
    path: Path, topics: Sequence[TopicMessages], others: OtherTopics | None
) -> None:
    types = typestore()
    filled = [topic for topic in topics if len(topic.raw)]
    time = np.concatenate([np.empty(0, dtype=np.int64), *(topic.time for topic in filled)])
    owner = np.repeat(np.arange(len(filled)), [len(topic.raw) for topic in filled])
    index = np.concatenate([np.empty(0, dtype=np.int64), *(np.arange(len(t.raw)) for t in filled)])
    order = np.argsort(time, kind="stable")
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = [
            writer.add_connection(topic.topic, topic.message_type, typestore=types)
            for topic in filled
        ]
        columns = (part[order].tolist() for part in (owner, index, time))
        own = (
            CopiedMessage(when, connections[who], filled[who].raw[which])
            for who, which, when in zip(*columns, strict=True)
        )
        names = {topic.topic for topic in topics}
        further = iter(()) if others is None else others.into(writer, names)
        for message in heapq.merge(own, further, key=lambda message: message.time):
            writer.write(message.connection, message.time, message.raw)
