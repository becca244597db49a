"""Sweeps: a function at every combination of some values, as a table."""

import inspect
import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import nullcontext
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.stages import stages

Grid = Mapping[str, Sequence[Any] | Mapping[str, Any]]
Outcome = dict[str, float] | str

# Combinations that run in one program at a time: a minute of drive at 100 Hz then needs some 100 MB.
_CHUNK = 64
_INTERRUPTED = "interrupted"
# Whether functions can be traced, by the kinds of their arguments.
_TRACEABLE: WeakKeyDictionary[Callable[..., Any], dict[Any, bool]] = WeakKeyDictionary()


def sweep(
    function: Callable[..., Any],
    grid: Grid | pd.DataFrame,
    *,
    repeats: int = 1,
    key: jax.Array | None = None,
    chunk: int | None = None,
    progress: bool = True,
    executor: Executor | None = None,
) -> pd.DataFrame:
    """A function at every combination of the grid's values, and its spread over repeats with other noise.

    A function of arrays alone, which JAX can trace, runs as a program for many combinations at once; any other one runs
    combination by combination, or on an executor. Which of both it is, a trial with tracers shows. Repeat r has the
    same key at every combination, so that combinations differ by their values and not by luck.

    Parameters
    ----------
    function : callable
        Takes the values by the names of the grid, and `key` if it has an argument of this name. It returns a number, or
        a mapping or Series of numbers.
    grid : mapping of str to sequence or mapping, or DataFrame
        Values by name; where they are records, such as instruments, a mapping of labels to them. Or the result of a
        sweep that was interrupted: what it lacks is run, with the same `repeats` and `key`.
    repeats : int, optional
        How often each combination is run, each time with another key.
    key : key, optional
        Source of the repeats' keys; ``jax.random.key(0)`` by default.
    chunk : int, optional
        Most combinations that run in one program at a time; 64 by default.
    progress : bool, optional
        Whether a bar shows how many are done.
    executor : Executor, optional
        Of `concurrent.futures`, for functions that are not traced.

    Returns
    -------
    result : DataFrame
        A row a combination, indexed by the grid, so that ``to_xarray()`` is a labelled cube. A column a number
        ("value" where the function returns but one); with repeats it is their mean, and beside it are its spread
        (``_std``), the standard error of the mean by Monte Carlo (``_error``), and the number of runs that succeeded
        (``runs``). ``reason`` is empty, or says how a run failed, or that it was interrupted.

    Raises
    ------
    ValueError
        If the grid has no or repeated values, the function does not take them, repeats would all be equal, or repeats
        or key are not those of an interrupted sweep.

    Warns
    -----
    UserWarning
        If the sweep was interrupted (Ctrl-C): what is done is returned.
    """
    key = jax.random.key(0) if key is None else key
    key_data = jax.random.key_data(key).tolist()
    before = grid if isinstance(grid, pd.DataFrame) else None
    if before is not None:
        if before.attrs.get("repeats") != repeats or before.attrs.get("key") != key_data:
            raise ValueError("an interrupted sweep goes on with the repeats and the key that it began with")
        grid = before.attrs["grid"]
    axes = _axes(grid)
    with_key = _takes_key(function, list(axes), repeats)
    cells = [dict(zip(axes, values, strict=True)) for values in itertools.product(*map(dict.values, axes.values()))]
    keys = list(jax.random.key_data(_keys(key, repeats))) if with_key else [None]
    todo = [k for k in range(len(cells)) if before is None or before["reason"].iloc[k] == _INTERRUPTED]
    outcomes: list[list[Outcome]] = [[_INTERRUPTED] * repeats for _ in todo]
    with stages("sweep", len(todo) * repeats) if progress else nullcontext() as stage:
        try:
            for done in _outcomes(function, [cells[k] for k in todo], keys, chunk or _CHUNK, executor):
                for cell, repeat, outcome in done:
                    outcomes[cell][repeat] = outcome
                if stage is not None:
                    stage.advance(len({run[:2] for run in done}))
        except KeyboardInterrupt:
            whole = sum(_INTERRUPTED not in of_cell for of_cell in outcomes)
            warnings.warn(
                f"the sweep was interrupted after {whole} of {len(todo)} combinations: call sweep again with the "
                "result in place of the grid to go on",
                stacklevel=2,
            )
    rows = [_row(of_cell, repeats) for of_cell in outcomes]
    index = _index(axes)
    result = pd.DataFrame(rows, index=index[todo])
    if before is not None:
        result = pd.concat([before.drop(index=result.index), result]).reindex(index)
    last = [name for name in ("runs", "reason") if name in result]
    result = result[[*(name for name in result.columns if name not in last), *last]]
    result.attrs = {
        "grid": {name: dict(axis) for name, axis in axes.items()},
        "repeats": repeats,
        "key": key_data,
    }
    return result


def read_off(result: pd.DataFrame, limit: float, *, value: str | None = None, along: str | None = None) -> Any:
    """Where a number crosses a limit: what a sensor must be for so large an error.

    Parameters
    ----------
    result : DataFrame
        From `sweep`, over numbers.
    limit : float
        Of the number.
    value : str, optional
        Which column; the first one by default.
    along : str, optional
        Which value of the grid is looked for; the first one by default.

    Returns
    -------
    crossing : float or Series
        The first one as the value grows, between the combinations by straight lines, of logarithms where the values
        are spaced so; NaN where the number stays on one side. With several values in the grid, a Series by the others.
    """
    name = result.columns[0] if value is None else value
    along = str(result.index.names[0]) if along is None else along
    if result.index.nlevels == 1:
        return _crossing(result.index.to_numpy(float), result[name].to_numpy(float), limit)
    table = result[name].unstack(along)
    x = table.columns.to_numpy(float)
    return table.apply(lambda row: _crossing(x, row.to_numpy(float), limit), axis=1).rename(along)


def spaced_by_factors(values: np.ndarray) -> bool:
    """Whether values belong on a logarithmic scale: positive, far apart, and more evenly so by factors than by steps.

    Parameters
    ----------
    values : ndarray
        (values,) In ascending order.

    Returns
    -------
    by_factors : bool
        True if so.
    """
    if len(values) < 3 or values[0] <= 0:
        return False
    steps, factors = np.diff(values), np.diff(np.log(values))
    return bool(np.std(factors) / np.mean(factors) < np.std(steps) / np.mean(steps))


def _crossing(x: np.ndarray, y: np.ndarray, limit: float) -> float:
    order = np.argsort(x)
    x, y = x[order], y[order]
    by_factors = spaced_by_factors(x)
    with_positive = by_factors and limit > 0 and bool(np.nanmin(y) > 0)
    above = np.log(y / limit) if with_positive else y - limit
    x = np.log(x) if by_factors else x
    for k in range(len(x) - 1):
        if above[k] * above[k + 1] <= 0 and above[k] != above[k + 1]:
            found = x[k] + (x[k + 1] - x[k]) * above[k] / (above[k] - above[k + 1])
            return float(np.exp(found) if by_factors else found)
    return float("nan")


def _axes(grid: Any) -> dict[str, dict[Any, Any]]:
    """Values by label, by name; numbers are their own labels."""
    if not grid:
        raise ValueError("the grid must have values by name, at least one; got none")
    axes = {}
    for name, values in grid.items():
        pairs = list(values.items()) if isinstance(values, Mapping) else [(value, value) for value in _plain(values)]
        axes[str(name)] = dict(pairs)
        if not pairs or len(axes[str(name)]) < len(pairs):
            raise ValueError(f"the grid's {name} must have different values, at least one; got {len(pairs)} of them")
    return axes


def _plain(values: Any) -> list[Any]:
    return values.tolist() if isinstance(values, np.ndarray | jax.Array | pd.Index | pd.Series) else list(values)


def _index(axes: Mapping[str, Mapping[Any, Any]]) -> pd.Index:
    labels = [list(axis) for axis in axes.values()]
    return (
        pd.MultiIndex.from_product(labels, names=list(axes))
        if len(axes) > 1
        else pd.Index(labels[0], name=next(iter(axes)))
    )


def _takes_key(function: Callable[..., Any], names: list[str], repeats: int) -> bool:
    parameters = inspect.signature(function).parameters
    with_key = "key" in parameters
    if "key" in names:
        raise ValueError("the grid must not have the name key, which is that of the source of noise")
    try:
        inspect.signature(function).bind(**dict.fromkeys([*names, *(["key"] if with_key else [])]))
    except TypeError as error:
        raise ValueError(f"the function must take {', '.join(names)} by name: {error}") from error
    if repeats < 1 or (repeats > 1 and not with_key):
        raise ValueError(
            f"repeats={repeats}: repeats differ by their key, so that the function needs an argument key"
            if repeats > 1
            else f"repeats must be at least 1, got {repeats}"
        )
    return with_key


_keys = jax.jit(lambda key, repeats: jax.vmap(partial(jax.random.fold_in, key))(jnp.arange(repeats)), static_argnums=1)


def _outcomes(
    function: Callable[..., Any],
    cells: list[dict[str, Any]],
    keys: list[Any],
    chunk: int,
    executor: Executor | None,
) -> Iterator[list[tuple[int, int, Outcome]]]:
    """Combinations, repeats and what came of them, in the order in which they are done."""
    runs = list(itertools.product(range(len(cells)), range(len(keys))))
    if executor is None and cells and (stacked := _stacked(cells)) is not None:
        if _is_traceable(function, jax.tree.map(lambda x: x[0], stacked), keys[0]):
            yield from _in_chunks(function, stacked, keys, len(cells), chunk)
            return
    if executor is None:
        for cell, repeat in runs:
            yield [(cell, repeat, _tried(function, cells[cell], keys[repeat]))]
        return
    futures = {executor.submit(_tried, function, cells[cell], keys[repeat]): (cell, repeat) for cell, repeat in runs}
    try:
        for future in as_completed(futures):
            yield [(*futures[future], future.result())]
    finally:
        for future in futures:
            future.cancel()


def _tried(function: Callable[..., Any], values: dict[str, Any], key_data: np.ndarray | None) -> Outcome:
    try:
        return {name: float(x) for name, x in _named(function, values, key_data).items()}
    except Exception as error:  # whatever a function of the user's raises is the reason of its row
        return f"{type(error).__name__}: {error}"


def _named(function: Callable[..., Any], values: Mapping[str, Any], key_data: Any) -> dict[str, Any]:
    """What the function returns, by name."""
    noise = {} if key_data is None else {"key": jax.random.wrap_key_data(jnp.asarray(key_data))}
    result = function(**values, **noise)
    named = dict(result.items()) if isinstance(result, Mapping | pd.Series) else {"value": result}
    for name, x in named.items():
        if np.ndim(x):
            raise ValueError(f"the function must return numbers; {name} has shape {np.shape(x)}")
    return {str(name): x for name, x in named.items()}


def _stacked(cells: list[dict[str, Any]]) -> Any:
    """The combinations' values as arrays, each a batch; None where they are no numbers or differ in kind."""
    leaves, kinds = zip(*(jax.tree.flatten(values) for values in cells), strict=True)
    if len(set(kinds)) > 1:
        return None
    columns = [[np.asarray(x) for x in column] for column in zip(*leaves, strict=True)]
    if any(x.dtype.kind not in "biuf" or x.shape != column[0].shape for column in columns for x in column):
        return None
    return jax.tree.unflatten(kinds[0], [np.stack(column) for column in columns])


def _is_traceable(function: Callable[..., Any], values: Any, key_data: Any) -> bool:
    """Whether JAX can trace the function, and traces the same twice: not where NumPy's random numbers are in it."""
    kind = jax.tree.structure(values), tuple(x.dtype for x in jax.tree.leaves(values))
    known = _TRACEABLE.setdefault(function, {})
    if kind not in known:
        known[kind] = _traces_alike(function, values, key_data)
    return known[kind]


def _traces_alike(function: Callable[..., Any], values: Any, key_data: Any) -> bool:
    traced = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a trial has to say it will say again
        for _ in range(2):
            try:
                found = jax.make_jaxpr(lambda values, key: _numbers(function, values, key))(values, key_data)
            except Exception:  # a function that is not made for tracers may raise anything: it runs without
                return False
            traced.append(found)
    one, two = traced
    return str(one) == str(two) and all(np.array_equal(a, b) for a, b in zip(one.consts, two.consts, strict=True))


def _numbers(function: Callable[..., Any], values: Mapping[str, Any], key_data: Any) -> dict[str, jax.Array]:
    return {name: jnp.asarray(x) for name, x in _named(function, values, key_data).items()}


@partial(jax.jit, static_argnums=0)
def _at_once(function: Callable[..., Any], values: Any, keys: jax.Array | None) -> dict[str, jax.Array]:
    """By combination and repeat; what depends on the key alone is computed once for all combinations."""
    of_cell = partial(_numbers, function)
    if keys is not None:
        of_cell = jax.vmap(of_cell, (None, 0))
    return jax.vmap(of_cell, (0, None))(values, keys)


def _in_chunks(
    function: Callable[..., Any], stacked: Any, keys: list[Any], count: int, chunk: int
) -> Iterator[list[tuple[int, int, Outcome]]]:
    """Chunks of one size of combinations and repeats, the last ones filled up."""
    cells, repeats = _parts(count, max(chunk // len(keys), 1)), _parts(len(keys), chunk)
    for rows, columns in itertools.product(cells, repeats):
        values = jax.tree.map(lambda x, rows=rows: x[rows], stacked)
        with_keys = None if keys[0] is None else np.stack([keys[k] for k in columns])
        found = jax.device_get(_at_once(function, values, with_keys))
        found = {name: x.reshape(len(rows), len(columns)) for name, x in found.items()}
        # Filling repeats the last one: the same outcome again.
        yield [
            (int(cell), int(repeat), {name: float(x[i, j]) for name, x in found.items()})
            for (i, cell), (j, repeat) in itertools.product(enumerate(rows), enumerate(columns))
        ]


def _parts(count: int, most: int) -> list[np.ndarray]:
    """Numbers from zero in parts of one size, the last one filled up with the last number."""
    size = -(-count // -(-count // most))
    return [np.minimum(np.arange(begin, begin + size), count - 1) for begin in range(0, count, size)]


def _row(outcomes: list[Outcome], repeats: int) -> dict[str, Any]:
    if _INTERRUPTED in outcomes:
        return ({"runs": 0} if repeats > 1 else {}) | {"reason": _INTERRUPTED}
    found = pd.DataFrame([outcome for outcome in outcomes if isinstance(outcome, dict)])
    reason = next((outcome for outcome in outcomes if isinstance(outcome, str)), "")
    row: dict[str, Any] = {}
    for name, x in found.items():
        row[str(name)] = x.mean()
        if repeats > 1:
            row |= {f"{name}_std": x.std(), f"{name}_error": x.std() / np.sqrt(x.count())}
    return row | ({"runs": len(found)} if repeats > 1 else {}) | {"reason": reason}
