"""skfsink: dynamic versus quasi-static crack propagation in soft materials by the material-sink theory."""

__version__ = "0.1.0"
