"""Mutations of an HDF5 file's objects: other types, shapes, values and attributes, which flipped bytes seldom reach."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import Any

import h5py
import numpy as np

_REALS = (np.nan, np.inf, -1e30, 1e30, 0.0, -1.0)
_ATTRIBUTES: tuple[Any, ...] = (np.nan, -1, 1e308, "x" * 10_000, b"\xff", np.arange(9), "", 2**62, "\x1b[31m")


def mutated_objects(data: bytes, random: np.random.Generator) -> bytes:
    """A copy with one to three mutations."""
    file = BytesIO(data)
    with h5py.File(file, "r+") as root:
        for _ in range(random.integers(1, 4)):
            names: list[str] = []
            root.visit(names.append)
            if names:
                _MUTATIONS[random.integers(len(_MUTATIONS))](root, names[random.integers(len(names))], random)
    return file.getvalue()


def _remove(root: h5py.File, name: str, random: np.random.Generator) -> None:
    del root[name]
    if random.integers(2):
        root.create_group(name)


def _rename(root: h5py.File, name: str, random: np.random.Generator) -> None:
    root.move(name, f"moved{random.integers(1 << 30)}")


def _other_array(root: h5py.File, name: str, random: np.random.Generator) -> None:
    """The same object with another type or shape; its attributes stay."""
    if not isinstance(root[name], h5py.Dataset):
        return
    values, attributes = root[name][...], dict(root[name].attrs)
    forms: tuple[Any, ...] = (
        values.astype(float) if values.dtype.kind in "iuf" else b"x",
        values.reshape(-1),
        values[:1] if values.ndim else values,
        7,
        np.zeros((3, 3, 3, 3, 3)),
        np.array([b"x" * 500]),
        "x" * 3000,
    )
    del root[name]
    root[name] = forms[random.integers(len(forms))]
    root[name].attrs.update(attributes)


def _value(root: h5py.File, name: str, random: np.random.Generator) -> None:
    """One value of an array or of a table's column."""
    found = root[name]
    if not isinstance(found, h5py.Dataset) or not found.size or found.dtype.kind in "OS":
        return
    values = np.atleast_1d(found[...])
    columns = values.dtype.names
    column = values if columns is None else values[columns[random.integers(len(columns))]]
    if column.dtype.kind == "f":
        column.flat[random.integers(column.size)] = _REALS[random.integers(len(_REALS))]
    elif column.dtype.kind in "iu":
        ends = np.iinfo(column.dtype)
        column.flat[random.integers(column.size)] = (ends.min, ends.max, 0, 1)[random.integers(4)]
    elif column.dtype.kind == "S":
        column.flat[random.integers(column.size)] = b"\xff<\x01"
    found[...] = values.reshape(found.shape)


def _attribute(root: h5py.File, name: str, random: np.random.Generator) -> None:
    owner = root[name] if random.integers(2) else root
    keys = sorted(owner.attrs)
    if keys:
        owner.attrs[keys[random.integers(len(keys))]] = _ATTRIBUTES[random.integers(len(_ATTRIBUTES))]


_MUTATIONS: tuple[Callable[[h5py.File, str, np.random.Generator], None], ...] = (
    _remove,
    _rename,
    _other_array,
    _value,
    _value,
    _attribute,
)
