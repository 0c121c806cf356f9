"""`python -m stseg` is the command `stseg`."""

from stseg.commands.main import command

if __name__ == "__main__":
    command()
