"""What a native vector environment does with a slot that has finished."""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from acl_gym.utils import validation


class ChoosesAutoreset:
    """A vector environment whose autoreset mode can be changed.

    Attributes:
        autoreset_mode: the present one.
        metadata: of the environment, in which it stands too.
    """

    autoreset_mode: AutoresetMode
    metadata: dict[str, Any]

    def set_autoreset_mode(self, mode: str | AutoresetMode) -> None:
        """Change what happens to a slot that finishes from now on.

        Wrappers around the environment keep the mode that they found.

        Args:
            mode: see `autoreset_mode` of the constructor.

        Raises:
            ValueError: there is no such mode.
        """
        self.autoreset_mode = _checked_autoreset_mode(mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}


def _checked_autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """Return the mode of that name."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        choices = ", ".join(repr(choice.value) for choice in AutoresetMode)
        raise ValueError(
            f"autoreset_mode must be one of {choices}, got {validation.shown(mode)}."
        ) from None
