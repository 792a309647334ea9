"""Whatever is given to springcheck is answered: a stranger's store shows nothing of ours, and it ends.

A short form of validation/campaign.py, which says what must hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

import campaign
import forked
import hostile
from springcheck.store import checking

SERVED = tuple[campaign.Place, forked.Warm]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SERVED]:
    place, server = campaign.Place(tmp_path_factory.mktemp("campaign")), forked.Warm()
    place.print_whole(server)
    yield place, server
    server.close()


@pytest.mark.parametrize("kind", hostile.KINDS)
def test_a_hostile_store_does_no_harm(
    kind: str, served: SERVED, whole: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, server = served
    # a short form: a twentieth of the text; each of two arrays above the memory allowed, and the file above
    # what is checked before it is shown
    monkeypatch.setattr(hostile, "REPEATED", hostile.REPEATED // 20)
    monkeypatch.setattr(hostile, "VERDICTS", 2_000)
    monkeypatch.setattr(hostile, "SPARSE", max(2 * campaign.MEMORY, checking.LONGEST_CHECK) + (1 << 20))
    number = list(hostile.KINDS).index(kind)
    # every second one with a seal, but for the file above what is checked, whose seal takes seconds to make;
    # every 24th is drawn, which takes as long as all other commands together
    sealed = number % 2 == 1 and kind != "a sparse file"
    case = place.make("hostile", number + len(hostile.KINDS) * sealed)
    # each is checked, and given to every fifth of the other commands
    commands = [x for i, x in enumerate(case.commands) if whole or x[0] == "check" or i % 5 == number % 5]
    case = replace(case, commands=tuple(commands), complete=number % 24 == 0)
    assert case.what == kind
    assert place.answer(case, server).wrong == []


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("part", ["scenes", "mutated", "arguments", "doors"])
def test_what_is_broken_at_random_is_answered(part: str, number: int, served: SERVED, whole: bool) -> None:
    place, server = served
    case = place.make(part, number)
    # a store is given to every second of the commands that read one
    every = [i for i in range(len(case.commands)) if whole or len(case.commands) < 5 or i % 2 == number % 2]
    of_whole = tuple(case.whole[i] for i in every) if case.whole else ()
    case = replace(case, commands=tuple(case.commands[i] for i in every), whole=of_whole)
    assert place.answer(case, server).wrong == []


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"status": 99}, "exit status"),
        ({"err": "Traceback (most recent call last):"}, "traceback"),
        ({"status": 2, "out": ""}, "0 lines"),
        ({"status": 2, "err": "a\nb\n"}, "2 lines"),
        ({"err": "x" * 501}, "501 characters"),
        ({"out": "\x1b[2J"}, "control"),
        ({"out": hostile.SECRET}, "another file"),
        ({"seconds": 21.0}, "21.0 s"),
        ({"memory": 2 << 30}, "2.0 GiB"),
        ({"out": "8.15"}, "as if nothing were"),
    ],
)
def test_what_must_not_happen_is_seen(changed: dict[str, object], said: str) -> None:
    fine = {"command": ("check", "s.h5"), "status": 0, "seconds": 1.0, "memory": 1, "out": "4.7", "err": ""}
    assert not list(campaign.wrongs(forked.Result(**fine), signalled=False, whole=("4.7",)))  # type: ignore[arg-type]
    found = list(campaign.wrongs(forked.Result(**{**fine, **changed}), signalled=False, whole=("4.7",)))  # type: ignore[arg-type]
    assert any(said in what for what in found), found


@pytest.mark.parametrize("among_programs", [False, True])
def test_a_file_that_nobody_gave_is_seen_by_its_system_call(
    among_programs: bool, served: SERVED, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, _ = served
    if among_programs:
        # as where TMPDIR is a folder of the checkout
        monkeypatch.setattr(campaign, "SYSTEM", (*campaign.SYSTEM, f"{place.home.parent}/"))
    log = place.home / "log"
    lines = [
        f'7 chdir("{place.work}") = 0',
        f'7 openat(AT_FDCWD<{place.work}>, "s.toml", O_RDONLY) = 3<s.toml>',
        f'7 openat(AT_FDCWD<{place.work}>, "../../own/secret.txt", O_RDONLY) = 3',
        f'7 openat(AT_FDCWD<{place.work}>, "/etc/passwd", O_RDWR) = 3',
        f'7 openat(AT_FDCWD<{place.work}>, "/etc/fstab", O_RDONLY) = 3',
        f'8 openat(AT_FDCWD<{place.work}>, "/home/y", O_RDONLY <unfinished ...>',
        f'7 openat(AT_FDCWD<{place.work}>, "/home/z", O_RDONLY <unfinished ...>',
        "8 <... openat resumed>) = -1 ENOENT (No such file or directory)",
        "7 <... openat resumed>) = 5</home/z>",
        f'7 openat(AT_FDCWD<{place.work}>, "/home/x", O_RDONLY) = -1 ENOENT (No such file or directory)',
    ]
    log.write_text("\n".join(lines))
    secret, n = f"{place.own}/secret.txt", place.cases
    assert campaign.trace(log, place, {n: ()}) == {
        n: [f"openat {secret}", "openat /etc/passwd", "openat /home/z"]
    }
    assert campaign.trace(log, place, {n: (secret,)}) == {n: ["openat /etc/passwd", "openat /home/z"]}
