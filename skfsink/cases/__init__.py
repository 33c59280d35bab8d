"""The examples of the paper, one function a module: `python -m skfsink.cases.<name>`."""
