"""HDF5 files in which a dataset is not what its name promises."""

import h5py


def put(file: h5py.File, value: object, name: str) -> None:
    """Put a value or a link into the place of a dataset."""
    if name in file:
        del file[name]
    file[name] = value


def made(file: h5py.File, name: str, shape: tuple[int, ...] | None = None, **options: object):
    """Put a dataset that is stored in another way into the place of another."""
    shape = shape or file[name].shape
    del file[name]
    file.create_dataset(name, shape, "f8", **options)


def virtual(file: h5py.File, name: str, source: str, of_source: str) -> None:
    """Put what another file holds into the place of a dataset."""
    shape = file[name].shape
    del file[name]
    layout = h5py.VirtualLayout(shape, "f8")
    layout[...] = h5py.VirtualSource(source, of_source, shape)
    file.create_virtual_dataset(name, layout)
