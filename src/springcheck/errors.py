"""The exceptions that springcheck raises on purpose; each message says what, where, and what to do."""

from __future__ import annotations


class SpringcheckError(Exception):
    """Something a user can mend.  The command line prints the message alone and exits with 2."""


class SceneError(SpringcheckError):
    """A scene that cannot be read or makes no sense."""


class MethodError(SpringcheckError):
    """A method label that names nothing, or a method that cannot run here."""


class StoreError(SpringcheckError):
    """A file that cannot be read, written or trusted."""


class IdentificationError(SpringcheckError):
    """States from which no one-step map can be read: too few, at rest, or at uneven times."""
