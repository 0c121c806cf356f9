"""Experiments on recordings with known truth; tools/experiment.py runs them."""
