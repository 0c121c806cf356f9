"""The version of the package, in a module of its own: `stseg.io` writes it into files, and stands below the engine."""

__version__ = "0.1.0"
