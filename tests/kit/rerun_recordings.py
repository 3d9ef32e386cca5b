"""Content of a recording of rerun, read chunk by chunk."""

import numpy as np
from rerun.chunk import RrdReader


def chunks(path):
    """Chunks by entity."""
    by_entity = {}
    for chunk in RrdReader(path).stream():
        by_entity.setdefault(chunk.entity_path, []).append(chunk)
    return by_entity


def _columns(path, entity, *, static):
    (chunk,) = [c for c in chunks(path)[entity] if c.is_static == static]
    batch = chunk.to_record_batch()
    return {name: batch.column(name) for name in batch.schema.names}


def temporal_columns(path, entity):
    """The chunk of an entity that changes with time, as columns by name."""
    return _columns(path, entity, static=False)


def static_columns(path, entity):
    """The chunk of an entity that does not change with time, as columns by name."""
    return _columns(path, entity, static=True)


def rows(columns, ending):
    """Rows of the column whose name ends so, as Python values."""
    (name,) = [name for name in columns if name.endswith(ending)]
    return columns[name].to_pylist()


def values(columns, ending):
    return np.array([np.ravel(row) for row in rows(columns, ending)])


def times(columns, timeline):
    return columns[timeline].cast("int64").to_numpy()
