"""Arrays that read a simulation's memory in place."""
import collections

import numpy as np

Surface = collections.namedtuple("Surface", "corners rest fragment point cut")
Images = collections.namedtuple("Images", "rgb depth labels flow")


class Array(np.lib.mixins.NDArrayOperatorsMixin):
    """An array that NumPy reads in place, valid until the simulation's next frame: read later, it
    raises RuntimeError. Parts of it are Arrays, too; what is computed of it is plain. copy() keeps
    values; numpy.asarray() gives a plain array that nothing checks any more: its memory stays, and
    what it holds is what the tissue was."""

    __slots__ = ("_array", "_simulation", "_generation")

    def __init__(self, array, simulation, generation=None):
        self._array, self._simulation = array, simulation
        self._generation = simulation.generation if generation is None else generation

    def _read(self):
        if self._simulation.generation != self._generation:
            self._array = None  # its memory is used again
            raise RuntimeError("this array was valid until the simulation's next frame, which came: "
                               "read it anew, or copy() what is to stay")
        return self._array

    def _part(self, value):
        if isinstance(value, np.ndarray) and value.base is not None:
            return Array(value, self._simulation, self._generation)
        return value

    def __array__(self, dtype=None, copy=None):
        array = self._read()
        return np.array(array, dtype) if copy else np.asarray(array, dtype)

    def __array_ufunc__(self, ufunc, method, *inputs, **kwargs):
        inputs = [x._read() if isinstance(x, Array) else x for x in inputs]
        return getattr(ufunc, method)(*inputs, **kwargs)

    def __getitem__(self, key):
        key = key._read() if isinstance(key, Array) else key
        return self._part(self._read()[key])

    def __getattr__(self, name):  # what an ndarray has: shape, mean(), T, ...
        if name in Array.__slots__:
            raise AttributeError(name)
        return self._part(getattr(self._read(), name))

    def __len__(self):
        return len(self._read())

    def __iter__(self):
        return (self[i] for i in range(len(self)))

    def __repr__(self):
        return "Array(%r)" % self._read()
