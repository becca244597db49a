"""Every public function of the core does what its docstring says: names, shapes, batches, precision, derivatives.

The docstrings are the specification: a slot such as ``f_b : (..., time, 3) m/s^2`` is read, arrays are made from it,
and the function is run. Domains (times increase, matrices rotate) go by the argument's name, as names are the same
everywhere.
"""

import importlib
import inspect
from dataclasses import fields, is_dataclass
from types import FunctionType

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax import motions, roads
from tests.docstrings import Entry, public_functions, public_records, section
from tests.quick import quick_jit

CORE = [
    "rotations",
    "signals",
    "least_squares",
    "calibration.serial_correlation",
    "calibration.standstill",
    "wahba",
    "smoothing",
    "delays",
    "rotation_splines",
    "earth",
    "roads",
    "motions",
    "sensors",
    "wheels",
    "doppler",
    "strapdown",
    "attitude",
    "altitude",
    "speed",
    "speed_estimate.filter",
    "metrics",
]
SIZES = {
    "time": 7,
    "knots": 6,
    "samples": 9,
    "edges": 8,
    "wheels": 2,
    "pulses": 9,
    "bends": 2,
    "hills": 2,
    "pairs": 5,
    "epochs": 9,
    "components": 2,
}
# Sizes of records that each constructor chooses for itself.
FREE = {"terms", "legs", "waves", "states"}
BATCHES = [(), (5,), (2, 5)]

FUNCTIONS = [pytest.param(f, id=f"{name}.{f.__name__}") for name in CORE for f in public_functions(name)]
RECORDS = [pytest.param(r, id=f"{name}.{r.__name__}") for name in CORE for r in public_records(name)]


POSITIVE = {
    "speed": 10.0,
    "cutoff": 2.0,
    "dt": 0.1,
    "max_gap": 0.25,
    "way": 10.1,
    "horizontal": 10.0,
    "distance": 1.0,
    "quiet": 0.15,
    "radius": 50.0,
    "bend_length": 90.0,
    "hill_length": 80.0,
    "duration": 20.0,
    "ramp": 3.0,
    "reach_length": 60.0,
    "fall_start": 8.0,
    "gate": 5.0,
}
# Records that have no nominal form are made by a constructor of theirs.
ROAD = ([0.3, 0.2], [90.0, 60.0], [0.0, 1.0], [0.1, 0.05], [80.0, 50.0], [0.0, 1.0], 3.0)
CONSTRUCTED = {
    "Road": lambda: roads.winding_road(*map(jnp.asarray, ROAD)),
    "SpeedProfile": lambda: roads.rest_to_rest(50.0, 20.0, 3.0),
    "Windsurfer": lambda: motions.gybing_windsurfer(9.0, 1.0, 60.0, 40.0, 20.0),
}


def size(word: str) -> int:
    """Size of an axis: a number, a name, or an expression of names such as ``edges - 1``."""
    return int(eval(word, {"__builtins__": {}}, SIZES))


def trailing(entry: Entry) -> tuple[int, ...]:
    assert entry.shape is not None
    return tuple(size(word) for word in entry.shape if word != "...")


def example(entry: Entry, batch: tuple[int, ...], dtype: type, seed: int) -> object:
    """A value inside the domain of an argument, by its name and slot."""
    rng = np.random.default_rng(seed)
    if entry.slot == "key":
        return jax.random.key(seed)
    if entry.shape is None:
        raise LookupError(entry.slot)
    shape = (batch if entry.batched else ()) + trailing(entry)
    name = entry.name
    if name.startswith("C"):
        rotations = Rotation.random(int(np.prod(shape[:-2], initial=1)), rng=rng).as_matrix()
        values = rotations.reshape(shape)
    elif name in ("t", "t_knots", "t_samples", "t_pulses", "t_gnss"):
        values = np.broadcast_to(np.arange(shape[-1]) * 0.1, shape) if shape else np.array(0.7)
    elif name == "edges":
        values = np.linspace(0.03, 0.61, shape[-1])
    elif name == "gravity":
        values = 9.8 + 0.05 * rng.random(shape)
    elif name.startswith("f_"):
        values = 0.5 * rng.standard_normal(shape) + (np.array([0.0, 0.0, 9.8]) if shape[-1:] == (3,) else 0.0)
    elif name in ("geodetic", "origin"):
        values = np.array([0.7, 0.2, 100.0]) + np.array([1e-3, 1e-3, 10.0]) * rng.standard_normal(shape)
    elif name == "ecef":
        values = np.array([4.2e6, 1.7e6, 4.5e6]) + 1e3 * rng.standard_normal(shape)
    elif name in POSITIVE:
        values = POSITIVE[name] + 0.01 * rng.random(shape)
    else:
        values = 0.4 * rng.standard_normal(shape)
    return jnp.asarray(values, dtype)


def record_or_option(entry: Entry, function: FunctionType, dtype: type) -> object:
    """A nominal record of the type named, the first of several options, or the default."""
    named = getattr(importlib.import_module(function.__module__), entry.slot.split(" ")[0], None)
    if is_dataclass(named):
        record = CONSTRUCTED.get(entry.slot, named)()
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), record)
    if entry.slot.startswith("{"):
        return entry.slot[1:].split(",")[0].strip("\"'} ")
    raise LookupError(entry.slot)


def arguments(function: FunctionType, batch: tuple[int, ...], dtype: type = np.float64) -> dict[str, object]:
    """Arguments made from the docstring; those with a default that are no arrays keep it."""
    made: dict[str, object] = {}
    for seed, entry in enumerate(section(function, "Parameters")):
        try:
            made[entry.name] = example(entry, batch, dtype, seed)
        except LookupError:
            if entry.optional:
                continue
            try:
                made[entry.name] = record_or_option(entry, function, dtype)
            except LookupError:
                pytest.skip(f"{entry.name} is a {entry.slot}: nothing to make it from; the module's own tests cover it")
    return made


def differentiable(function: FunctionType, made: dict[str, object]) -> tuple[list[str], object]:
    """Names of the floating-point arguments, and the function of them alone."""
    names = [
        name
        for name, value in made.items()
        if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.inexact)
    ]

    def of_arrays(*values: jax.Array) -> list[jax.Array]:
        result = function(**(made | dict(zip(names, values, strict=True))))
        return [leaf for leaf in jax.tree.leaves(result) if jnp.issubdtype(leaf.dtype, jnp.inexact)]

    return names, of_arrays


def close(got: object, expected: object, atol: float) -> None:
    got, expected = jax.tree.leaves(got), jax.tree.leaves(expected)
    assert len(got) == len(expected)
    for a, b in zip(got, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=atol)


def batch_axes(function: FunctionType) -> object:
    """For each result the axis that vmap adds: None where the docstring says that the result has no batch."""
    axes = [0 if entry.batched or entry.shape is None else None for entry in section(function, "Returns")]
    return axes[0] if len(axes) == 1 else tuple(axes)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_docstring_names_the_parameters(function: FunctionType) -> None:
    parameters = inspect.signature(function).parameters
    assert [entry.name for entry in section(function, "Parameters")] == list(parameters)
    for entry in section(function, "Parameters"):
        has_default = parameters[entry.name].default is not inspect.Parameter.empty
        assert entry.optional == has_default, f"{entry.name}: 'optional' and the default disagree"
    assert section(function, "Returns"), "no Returns section"


@pytest.mark.parametrize("record", RECORDS)
def test_docstring_names_the_fields(record: type) -> None:
    assert [entry.name for entry in section(record, "Attributes")] == [field.name for field in fields(record)]


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("function", FUNCTIONS)
def test_shapes(function: FunctionType, batch: tuple[int, ...]) -> None:
    made = arguments(function, batch)
    result = jax.eval_shape(lambda: function(**made))
    returned = section(function, "Returns")
    results = result if len(returned) > 1 else (result,)
    assert len(results) == len(returned)
    for entry, value in zip(returned, results, strict=True):
        if entry.shape is not None:
            assert value.shape == (batch if entry.batched else ()) + trailing(entry), entry.name
        else:
            # "Record of (..., time)" is a record whose batched fields have more leading axes
            named, _, more = entry.slot.partition(" of ")
            batched = any(parameter.batched for parameter in section(function, "Parameters"))
            leading = (batch if batched else ()) + (trailing(Entry(entry.name, more, False)) if more else ())
            record = getattr(importlib.import_module(function.__module__), named)
            for attribute in section(record, "Attributes"):
                if attribute.shape is not None and not FREE & set(attribute.shape):
                    expected = (leading if attribute.batched else ()) + trailing(attribute)
                    assert getattr(value, attribute.name).shape == expected, attribute.name


@pytest.mark.parametrize("function", FUNCTIONS)
def test_jit_and_vmap_change_nothing(function: FunctionType) -> None:
    made = arguments(function, (5,))
    # coordinates are differences of Earth radii
    atol = 1e-8 if function.__module__ == "altijax.earth" else 1e-11
    static = {name: value for name, value in made.items() if isinstance(value, str)}
    arrays = {name: value for name, value in made.items() if name not in static}
    jitted = quick_jit(lambda arrays: function(**arrays, **static))(arrays)
    # what is jitted where it is defined is so either way
    expected = jitted if isinstance(function, jax.stages.Wrapped) else function(**made)
    close(jitted, expected, atol)
    batched = {entry.name for entry in section(function, "Parameters") if entry.batched and entry.name in made}
    if batched:
        axes = {name: 0 if name in batched else None for name in arrays}
        vmapped = jax.vmap(lambda arrays: function(**arrays, **static), in_axes=(axes,), out_axes=batch_axes(function))
        close(quick_jit(vmapped)(arrays), expected, atol)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_single_precision_stays(function: FunctionType) -> None:
    made = arguments(function, (5,), np.float32)
    for leaf in jax.tree.leaves(jax.eval_shape(lambda: function(**made))):
        assert not jnp.issubdtype(leaf.dtype, jnp.inexact) or leaf.dtype == np.float32


@pytest.mark.parametrize("function", FUNCTIONS)
def test_derivatives_are_finite_and_agree(function: FunctionType) -> None:
    """Forward and reverse mode exist, are finite and are each other's transpose."""
    made = arguments(function, (5,))
    names, of_arrays = differentiable(function, made)
    if not names:
        pytest.skip("no floating-point arguments")
    primals = [made[name] for name in names]
    rng = np.random.default_rng(0)
    tangents = [jnp.asarray(rng.standard_normal(p.shape), p.dtype) for p in primals]
    shapes = jax.eval_shape(of_arrays, *primals)
    cotangents = [jnp.asarray(rng.standard_normal(v.shape), v.dtype) for v in shapes]

    @quick_jit
    def both_modes(primals: list, tangents: list, cotangents: list) -> tuple:
        values, forward = jax.jvp(of_arrays, primals, tangents)
        return values, forward, jax.vjp(of_arrays, *primals)[1](cotangents)

    values, forward, backward = both_modes(primals, tangents, cotangents)
    for leaf in [*values, *forward, *backward]:
        assert np.isfinite(leaf).all()
    one = sum(float(jnp.vdot(c, f)) for c, f in zip(cotangents, forward, strict=True))
    other = sum(float(jnp.vdot(b, t)) for b, t in zip(backward, tangents, strict=True))
    assert one == pytest.approx(other, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_wrong_sizes_are_named(function: FunctionType) -> None:
    """One size too many on each fixed or shared axis is a ValueError that names the argument."""
    made = arguments(function, ())
    entries = [entry for entry in section(function, "Parameters") if entry.shape is not None and entry.name in made]
    shared = [word for entry in entries for word in entry.shape or () if not word.isdigit() and word != "..."]
    tried = 0
    for entry in entries:
        words = [word for word in entry.shape or () if word != "..."]
        for axis, word in enumerate(words):
            if not word.isdigit() and shared.count(word) < 2:
                continue
            value = made[entry.name]
            assert isinstance(value, jax.Array)
            # Times would still increase.
            longer = np.concatenate([value, np.take(value, [-1], axis - len(words)) + 1], axis - len(words))
            with pytest.raises(ValueError, match="must have shape") as caught:
                jax.eval_shape(lambda one=made | {entry.name: longer}: function(**one))
            if word.isdigit():
                assert entry.name in str(caught.value)
            tried += 1
    if not tried:
        pytest.skip("no axis of fixed or shared size")
