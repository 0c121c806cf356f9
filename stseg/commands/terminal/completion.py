"""`stseg completion`: completion of commands and options in a shell."""

from __future__ import annotations

from typing import Literal

from stseg.commands.main import application


def completion(shell: Literal["bash", "zsh", "fish"], /) -> None:
    """Print the completion script of a shell.

    Example: stseg completion bash > ~/.local/share/bash-completion/completions/stseg

    Example: stseg completion zsh > "${fpath[1]}/_stseg"

    Example: stseg completion fish > ~/.config/fish/completions/stseg.fish

    Parameters
    ----------
    shell
        bash, zsh or fish.
    """
    print(application().generate_completion(shell=shell))
