"""Fuzzing of every parser and reader: mutated valid files must give a result or one error, in time and memory."""
