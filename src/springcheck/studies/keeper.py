"""Storage for studies: their only way to a store, to the pieces of an interrupted call, and to JSON."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar, Unpack, get_type_hints

import msgspec
import numpy as np

from springcheck import engines, store
from springcheck.engines.contract import Label
from springcheck.errors import StoreError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.store import Draft, Solution, Table
from springcheck.studies import references
from springcheck.studies import team as teams
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import LeftOut
from springcheck.studies.study import Studied
from springcheck.studies.team import ALONE, Team

if TYPE_CHECKING:
    from springcheck.studies.tables import Form

__all__ = [
    "Draft", "Keeper", "Piece", "Solution", "Table", "command", "each", "kept", "origin", "plain", "read",
    "restored", "study",
]  # fmt: skip

R = TypeVar("R", bound=Studied)

open_new, need_space, size = store.open_new, store.need_space, store.size
need_names = store.need_names
windows, strided, end, summary = store.windows, store.strided, store.end, store.summary
digest, attributes, decoded = store.digest, store.attributes, store.decoded
tables, verdicts, comparison = store.tables_of, store.verdicts, store.comparison
"""Functions of `store` on trajectories, which are written and read in pieces, and on results."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A part of a study that is measured separately, and saved as one table."""

    key: str
    """Its name among the pieces of its form."""
    what: str
    """Its name in progress reports."""
    measure: Callable[[], Any]
    form: Form[Any]

    @property
    def name(self) -> str:
        """Name of its table."""
        return self.form.beginning + self.key


def each(
    labels: Iterable[Label], what: str, measure: Callable[[Label], Callable[[], Any]], form: Form[Any]
) -> list[Piece]:
    """One piece for each method, measured by `measure(label)`."""
    named = [(label, f"{what} {label}".strip()) for label in labels]
    return [Piece(key=str(label), what=name, measure=measure(label), form=form) for label, name in named]


@dataclass(eq=False)
class Keeper:
    """Access to the pieces that an earlier call has finished, and the place where this call saves its own.

    Without a journal nothing is resumed and nothing is saved.
    """

    _journal: store.Journal | None = None
    progress: Progress | None = None
    team: Team = ALONE
    path: Path | None = None
    """Path of the store as the caller gave it."""
    resumed: int = 0
    """Number of pieces that were not measured again."""

    def __post_init__(self) -> None:
        self._finished = self._journal.tables() if self._journal else {}

    def finished(self, form: Form[Any], key: str) -> Any:
        """The result that an earlier call has saved under this key, or None."""
        table = self._finished.get(form.beginning + key)
        return None if table is None else form.found(table)

    def keep(self, form: Form[Any], key: str, found: Any) -> None:
        """Save a result under its key, replacing an earlier one; from here on it survives a crash."""
        if self._journal is not None:
            self._journal.add(form.table(key, found))

    def say(self, text: str) -> None:
        """Print a result as soon as it is known, above the progress bar."""
        if text and (line := getattr(self.progress, "line", None)):
            line(text)

    def results(self, pieces: Sequence[Piece]) -> list[Any]:
        """Results of these pieces, in their order: an earlier call's, or measured and saved."""
        found = {piece.name: self.finished(piece.form, piece.key) for piece in pieces}
        left = [piece for piece in pieces if found[piece.name] is None]
        self.resumed += len(pieces) - len(left)
        done, whole = len(pieces) - len(left), len(pieces)
        self._tell(done, whole, left[:1])
        with closing(self.team.carried_out([piece.measure for piece in left])) as measured:
            for number, (j, result) in enumerate(measured, 1):
                found[left[j].name] = result
                self.keep(left[j].form, left[j].key, result)
                self.say(left[j].form.line(result))
                self._tell(done + number, whole, left[number : number + 1])
        return [found[piece.name] for piece in pieces]

    def _tell(self, done: float, whole: float, following: Sequence[Piece]) -> None:
        if self.progress:
            self.progress(done, whole, *(piece.what for piece in following))

    def commit(self, name: str, document: Mapping[str, Any], scene: Scene | None = None) -> None:
        """Write everything that was saved, and the study's document, into the store."""
        if self._journal is not None:
            text = json.dumps(document, allow_nan=False)
            self._journal.commit(scene, documents={name: text})


class How(TypedDict, total=False):
    """How a study is run: whether an existing store is overwritten, the progress callback, the executor."""

    force: bool
    progress: Progress | None
    team: Team


def how(options: Namespace, progress: Progress | None) -> How:
    """The command line's `How`."""
    return {"force": options.force, "progress": progress, "team": teams.of(options)}


@contextmanager
def kept(path: str | Path | None, command: str, **how: Unpack[How]) -> Iterator[Keeper]:
    """A study that is saved in a store; an unfinished one of the same command is resumed.  Without a path
    nothing is saved.

    Raises StoreError, before anything is measured, when the file exists or cannot be written.
    """
    opened = nullcontext() if path is None else open_new(path, command, force=how.get("force", False))
    with opened as journal:
        where = None if path is None else Path(path)
        yield Keeper(journal, how.get("progress"), how.get("team", ALONE), where)


def study(
    name: str, path: str | Path | None, labels: Sequence[Label], measure: Callable[[Keeper], R],
    *options: str, scene: Scene | None = None, **how: Unpack[How],
) -> R:  # fmt: skip
    """Run the study `measure` of these methods and save it in a store (see `kept`); `options` is all that
    determines its numbers apart from the scene."""
    more = options if scene is None else (scene.digest, *options)
    with kept(path, command(name, labels, *more), **how) as keeper:
        found = replace(measure(keeper), resumed=keeper.resumed, path=keeper.path)
        keeper.commit(name, _stored(found), scene)
    return found


_NOT_STORED = ("scene", "path", "resumed")


def _stored(found: Studied) -> dict[str, Any]:
    """The document of a result without what its tables hold, and what `restored` reads: the name of its
    class, its fields, and the names of its tables."""
    own = {one.name: getattr(found, one.name) for one in fields(found)}
    tables = {name: form.names(own.pop(name)) for name, form in found.forms.items()}
    document = {name: x for name, x in found.document().items() if name not in tables}
    values = {name: plain(x) for name, x in own.items() if name not in _NOT_STORED}
    return {**document, "kind": type(found).__name__, "fields": values, "tables": tables}


def restored(name: str, path: Path, kinds: Mapping[str, type]) -> Studied:
    """The result of the study `name` in a store, of one of these classes.

    StoreError where the file holds no such study, or a part of it is missing.
    """
    try:
        known, tables = store.decoded(path, name), store.tables_of(path)
        kind: Any = kinds[known["kind"]]
        if not issubclass(kind, Studied):
            raise TypeError("a class of results")
        hints = get_type_hints(kind, localns={"Scene": Scene, "LeftOut": LeftOut, "Form": list})
        values: dict[str, Any] = {
            field: msgspec.convert(x, hints[field], strict=False) for field, x in known["fields"].items()
        }
        for field, form in kind.forms.items():
            values[field] = tuple(x for table in known["tables"][field] for x in form.listed(tables[table]))
        scene = stored_scene(path) if "scene" in store.summary(path).root else None
        found: Studied = kind(scene=scene, path=path, **values)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, msgspec.ValidationError) as error:
        raise StoreError(f"{path}: its study of {name} lacks {error}; measure it anew") from error
    return found


REFERENCE = "reference"
"""Name of the table with the reference solution of a store's scene."""


def reference_of(scene: Scene) -> list[store.Table]:
    """The reference solution of a scene as a table, none where it was not integrated."""
    digest, columns = references.columns(scene)
    about = "see springcheck.studies.references: Legendre series of the momenta, extended numbers as two"
    attributes = {"digest": digest, "about": about}
    return [store.Table(name=REFERENCE, columns=columns, attributes=attributes)] if columns else []


def stored_scene(path: Path) -> Scene:
    """The scene of a store, parsed from its saved text; its reference is taken from there as well."""
    name = str(store.summary(path).root.get("scene_name", path.stem))
    if known := store.tables_of(path).get(REFERENCE):
        references.take(str(known.attributes.get("digest")), known.columns)
    return scenefile.parse(store.scene_text(path), name=name, where=f"{path} (scene)")


def origin(labels: Iterable[Label]) -> dict[str, str]:
    """The machine, and the versions of all packages that these methods use."""
    found = {name: str(value) for name, value in store.machine().items()}
    for name in sorted({label.engine for label in labels}):
        distribution = engines.engine(name).distribution
        if distribution and engines.absence(name) is None:
            found[distribution] = engines.installed_version(name)
        where = engines.origin(name)
        if where.package != engines.OURS:
            found[where.package] = where.version
    return found


def command(study: str, labels: Sequence[Label], *options: str) -> str:
    """All that determines the numbers of a study; its journal is recognised by it.

    The machine and the versions are part of it: times of two machines, or limits of two releases of an
    engine, must not share a file.
    """
    versions = [f"{name} {version}" for name, version in origin(labels).items()]
    return "\n".join([study, *map(str, labels), *versions, *options])


def plain(data: Any) -> Any:
    """Results as plain data for JSON: dataclasses become objects, arrays lists, non-finite numbers None."""
    return msgspec.json.decode(msgspec.json.encode(data, enc_hook=_plain))


def document(**named: Any) -> dict[str, Any]:
    """Named results as plain data for JSON (see `plain`)."""
    return {name: plain(value) for name, value in named.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no form in JSON")


def read(path: str | Path) -> dict[str, Trajectory]:
    """The trajectories of a store by label.  StoreError where it cannot be read."""
    found = store.read(path)
    if not found:
        raise StoreError(f"{path}: holds no trajectories")
    return found
